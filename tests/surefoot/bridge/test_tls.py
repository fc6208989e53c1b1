"""`mqtts`: no certificate that cannot be checked is accepted, and each fault has its words."""

import subprocess

import pytest

from service.commands.bridge import run_bridge
from service.data_dir import StartError
from tests.surefoot.bridge.stand import bridged, broker, needs_mosquitto

SERVICE = "http://127.0.0.1:9"


def certificate(folder, name, days="2"):
    """A self-signed certificate for 127.0.0.1, and its key."""
    paths = {end: folder / f"{name}.{end}" for end in ("key", "csr", "crt", "ext")}
    subprocess.run(
        ["openssl", "req", "-new", "-newkey", "rsa:2048", "-nodes", "-keyout", paths["key"],
         "-out", paths["csr"], "-subj", "/CN=broker"], check=True, capture_output=True
    )  # fmt: skip
    paths["ext"].write_text("subjectAltName=IP:127.0.0.1\n")
    subprocess.run(
        ["openssl", "x509", "-req", "-in", paths["csr"], "-signkey", paths["key"], "-days", days,
         "-out", paths["crt"], "-extfile", paths["ext"]], check=True, capture_output=True
    )  # fmt: skip
    return paths["crt"], paths["key"]


@pytest.mark.slow
@needs_mosquitto
@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("expired", "certificate has expired"),
        ("of another", "CERTIFICATE_VERIFY_FAILED"),
        ("no file", "CERTIFICATE_VERIFY_FAILED"),
        ("no tls at the broker", "mqtt_away"),
    ],
)
def test_broker_that_cannot_be_verified_is_not_used(tmp_path, fault, words):
    days = "-1" if fault == "expired" else "2"
    crt, key = certificate(tmp_path, "broker", days)
    other, _ = certificate(tmp_path, "other")
    lines = [] if fault == "no tls at the broker" else [f"certfile {crt}", f"keyfile {key}"]
    settings = {"ca_file": str(other if fault == "of another" else crt)}
    if fault == "no file":
        settings = {}
    with broker(tmp_path, *lines) as port:
        given = {"url": f"mqtts://127.0.0.1:{port}", **settings}
        with bridged(tmp_path, port, SERVICE, "mqtt_away", **given) as bridge:
            log = bridge.log.read_text()
            assert words in log
            assert "mqtt_connected" not in log
            assert bridge.process.poll() is None


@pytest.mark.parametrize("content", [None, "no certificate", ""])
def test_file_of_certificates_that_has_none_is_named_in_a_line(settings, tmp_path, content):
    path = tmp_path / "ca.crt"
    if content is not None:
        path.write_text(content)
    changed = {"mqtt_url": "mqtts://127.0.0.1:1", "mqtt_ca_file": path}
    with pytest.raises(StartError, match="SUREFOOT_MQTT_CA_FILE: a file with PEM certificates"):
        run_bridge(settings.model_copy(update=changed), SERVICE, None)
