"""`surefoot check`: what is wrong in a data directory, and weights that come back."""

import os
import sqlite3
from pathlib import Path

from service.commands.migrate import migrate
from service.data_dir import make_private
from service.operations.check import check_data_dir, repair_weights
from tests.service.notifications.test_sealing import hook
from tests.service.store.test_backup import with_model
from tests.test_migrations import put


def verdicts(settings):
    return {one.what: (one.verdict, one.detail) for one in check_data_dir(settings)}


def test_what_is_deleted_meanwhile_is_nothing_wrong(settings, monkeypatch):
    migrate(settings)
    gone = settings.weights_dir / "half.partial"
    settings.weights_dir.mkdir(mode=0o700, exist_ok=True)
    listed = Path.rglob
    monkeypatch.setattr(Path, "rglob", lambda self, pattern: [*listed(self, pattern), gone])
    assert verdicts(settings)["modes"][0] == "ok"
    make_private(settings.data_dir)


def test_check_finds_what_is_wrong_and_repairs_weights(settings):
    digest = with_model(settings)
    assert "weights" in verdicts(settings)["modes"][1]
    migrate(settings)
    assert {verdict for verdict, _ in verdicts(settings).values()} == {"ok"}
    path = settings.weights_dir / f"{digest}.safetensors"
    path.write_bytes(b"half")
    assert verdicts(settings)["weights"] == ("fault", "model m has none or broken ones")
    with sqlite3.connect(settings.database_path) as connection:
        put(connection, "tracks", camera_id="nobody", track_id="1")
        connection.execute("DROP TABLE queues")
    hook(settings)
    (settings.data_dir / "secret.key").unlink()
    (settings.data_dir / "notes.txt").write_text("")
    (settings.data_dir / "notes.txt").chmod(0o644)
    unused = settings.weights_dir / ("0" * 64 + ".safetensors")
    unused.write_bytes(b"")
    os.utime(unused, (1, 1))
    found = verdicts(settings)
    assert found["references"] == ("fault", "1 rows of tracks")
    assert found["job engine"] == ("fault", "missing: queues")
    assert found["key"][0] == "fault"
    assert found["unused weights"][0] == "note"
    assert "notes.txt" in found["modes"][1]
    assert found["left over"] == ("note", "not in use: notes.txt")
    assert repair_weights(settings) == 1
    assert verdicts(settings)["weights"] == ("ok", "0 models, each has its weights")
    assert not path.exists()
