"""A full disk and a read-only one: told as what they are, and nothing acknowledged is lost."""

import json
import os
import shutil
import subprocess
import sys

import pytest

MOUNTS = shutil.which("unshare") is not None and (
    subprocess.run(["unshare", "-m", "mount", "-t", "tmpfs", "tmpfs", "/mnt"], check=False,
                   capture_output=True).returncode == 0
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(not MOUNTS, reason="needs to mount a small disk: root, and a kernel that lets")
def test_a_full_disk_and_a_read_only_one(migrated, tmp_path):
    (tmp_path / "disk").mkdir()
    program = [sys.executable, "-m", "tests.service.store.small_disk", migrated, tmp_path / "disk"]
    ran = subprocess.run(
        ["unshare", "-m", *program], capture_output=True, text=True, check=False, env=os.environ
    )
    assert ran.returncode == 0, ran.stderr[-4000:]
    found = json.loads(ran.stdout)
    for name in ("full", "full_register"):
        status, code, retry_after, _ = found[name]
        assert (status, code) == (507, "storage_full"), found[name]
        assert int(retry_after) >= 1
    assert found["full_ready"][0] == 503
    assert "the disk is full" in found["full_ready"][3]
    assert '"store_writable":false' in found["full_ready"][3]
    assert found["full_health"][0] == found["full_read"][0] == 200
    assert found["room"][0] == 202
    assert found["room_ready"]["store_writable"]
    assert found["stored"] == found["accepted"]
    assert found["little"]["problems"][0].startswith("disk: ")
    status, code, retry_after, _ = found["read_only"]
    assert (status, code) == (503, "store_unavailable"), found["read_only"]
    assert int(retry_after) >= 1
    assert found["read_only_ready"][0] == 503
    assert '"store_writable":false' in found["read_only_ready"][3]
    assert found["read_only_health"][0] == 200
