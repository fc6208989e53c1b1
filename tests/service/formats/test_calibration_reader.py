"""Files that are made to harm: the reader rejects them or is ended, the service goes on."""

import io
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from service.formats import calibration_file
from service.formats.calibration_file import read_calibration
from tests.service.conftest import problem

GOOD = b"""%YAML:1.0
---
K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 9., 0., 1., 0., 9., 1., 0., 0., 1. ]
"""
NESTED = {
    "json": b'{"K":' + b"[" * 80_000,
    "yaml flow": b"%YAML:1.0\n---\nK: " + b"[" * 80_000,
    "yaml dashes": b"%YAML:1.0\n---\nK:\n   " + b"- " * 80_000 + b"1\n",
    "yaml indents": b"%YAML:1.0\n---\n" + b"".join(b" " * n + b"a:\n" for n in range(1300)),
    "xml": b"<?xml version='1.0'?><opencv_storage>" + b"<a>" * 80_000,
}


def read_by_itself(body: bytes) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "service.formats.calibration_reader", "5", ""],
        input=body,
        check=False,
        capture_output=True,
        timeout=60,
    )


@pytest.mark.parametrize("name", NESTED)
def test_lists_in_lists_do_not_end_the_service(http, name):
    headers = {"Content-Type": "text/plain"}
    answer = http.post("/ui/calibration", content=NESTED[name], headers=headers)
    assert problem(answer, 422, "malformed")["errors"][0]["pointer"] == "/file"
    assert http.get("/healthz").status_code == 200


@pytest.mark.parametrize("name", NESTED)
def test_reader_rejects_deep_nesting_by_itself(name):
    done = read_by_itself(NESTED[name])
    assert (done.returncode, b"rejected" in done.stdout) == (0, True), done.stderr


def test_a_crash_of_the_reader_is_an_answer_in_words(http, monkeypatch):
    with monkeypatch.context() as patched:
        patched.setattr(calibration_file, "_READER", "service.formats.no_such_reader")
        document = problem(http.post("/ui/calibration", content=GOOD), 422, "malformed")
    assert "reader ended" in document["detail"]
    assert http.post("/ui/calibration", content=GOOD).status_code == 200


def test_larger_file_than_a_calibration_is_rejected():
    with pytest.raises(calibration_file.MalformedError, match="at most 4194304 bytes"):
        read_calibration(GOOD + b"# and so on\n" * 400_000)


def test_archive_that_unpacks_too_large_is_rejected():
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("cameras.txt", b"#" * 20_000_000)
    with pytest.raises(calibration_file.MalformedError, match="bytes unpacked"):
        read_calibration(packed.getvalue())


def test_pickled_array_is_not_loaded():
    packed = io.BytesIO()
    np.savez(packed, mtx=np.array([{"a": 1}], dtype=object))
    with pytest.raises(calibration_file.MalformedError, match="mtx.npy: must be an array of num"):
        read_calibration(packed.getvalue())


def test_a_matrix_as_large_as_the_machine_is_refused(http):
    body = GOOD.replace(b"rows: 3", b"rows: 40000").replace(b"cols: 3", b"cols: 40000")
    problem(http.post("/ui/calibration", content=body), 422, "malformed")


def test_a_reader_that_takes_its_time_is_ended(http):
    with pytest.raises(calibration_file.MalformedError, match="not read within"):
        read_calibration(GOOD, timeout_s=0.01)


def test_only_so_many_are_read_at_once(http):
    for _ in range(2):
        assert calibration_file._free.acquire(blocking=False)
    try:
        answer = http.post("/ui/calibration", content=GOOD)
    finally:
        for _ in range(2):
            calibration_file._free.release()
    problem(answer, 503, "overloaded")
    assert int(answer.headers["Retry-After"]) > 0
    assert http.post("/ui/calibration", content=GOOD).status_code == 200


def test_the_reader_opens_no_file_and_no_connection_and_its_memory_ends():
    program = """
import socket
from service.formats import confined as reader
reader.give_up_rights()
for what in (lambda: open("/etc/hostname"), lambda: open("/tmp/x", "w"), socket.socket):
    try:
        what()
    except OSError:
        print("refused")
try:
    bytearray(2 * reader.MAX_MEMORY_BYTES)
except MemoryError:
    print("refused")
"""
    command = [sys.executable, "-c", program]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.stdout.split() == ["refused"] * 4, done.stderr


def test_names_of_files_in_a_file_are_names_only(tmp_path):
    secret = tmp_path / "secret.yml"
    secret.write_bytes(GOOD)
    for body in (
        str(secret).encode(),
        f'<?xml version="1.0"?><!DOCTYPE x [<!ENTITY k SYSTEM "file://{secret}">]>'
        "<opencv_storage>&k;</opencv_storage>".encode(),
        f"%YAML:1.0\n---\nK: !include {secret}\n".encode(),
    ):
        with pytest.raises(calibration_file.MalformedError):
            read_calibration(body)


def test_the_reader_is_given_none_of_the_environment(monkeypatch, tmp_path):
    """What the process was started with is all that it could tell: no secrets are in it."""
    monkeypatch.setenv("SUREFOOT_SECRET_KEY", "s3cret")
    shown = tmp_path / "environment"
    (tmp_path / "yaml.py").write_text(
        f"import os; open({str(shown)!r}, 'w').write(repr(dict(os.environ)))\n"
    )
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    with pytest.raises(calibration_file.MalformedError):
        read_calibration(GOOD)
    assert shown.exists()
    assert "s3cret" not in shown.read_text()
