"""A spool that cannot be used is moved aside, and the bridge goes on with a new one."""

import logging
import sqlite3

import pytest

from surefoot.bridge.spool import Part, Spool
from tests.surefoot.bridge.halves import inward

MIB = 2**20


def no_database(path):
    path.write_bytes(b"no database, whoever wrote it\n" * 200)


def cut_off(path):
    spool = Spool(path, MIB)
    spool.keep(0.0, None, [Part("yard", b"", b"x" * 5_000) for _ in range(50)])
    spool.close()
    path.write_bytes(path.read_bytes()[:20_000])


def overwritten(path):
    spool = Spool(path, MIB)
    spool.keep(0.0, None, [Part("yard", b"", b"x" * 5_000) for _ in range(50)])
    spool.close()
    content = bytearray(path.read_bytes())
    for page in range(4096, len(content), 3 * 4096):
        content[page : page + 200] = b"\xff" * 200
    path.write_bytes(content)


def of_another_program(path):
    with sqlite3.connect(path) as db:
        db.execute("CREATE TABLE posts (id, title)")


@pytest.mark.parametrize("damage", [no_database, cut_off, overwritten, of_another_program])
def test_damaged_spool_is_moved_aside_and_begun_anew(tmp_path, damage, caplog):
    path = tmp_path / "bridge.sqlite"
    damage(path)
    was = path.read_bytes()
    with caplog.at_level(logging.ERROR):
        spool = Spool(path, MIB)
    (aside,) = tmp_path.glob("bridge.sqlite.damaged-*[0-9Z]")
    assert aside.read_bytes()[:16] == was[:16]
    assert [each.message for each in caplog.records] == ["spool_moved_aside"]
    assert spool.moved_aside == 1
    spool.keep(0.0, None, [Part("yard", b"", b"{}")])
    assert spool.waiting == 1
    spool.close()
    again = Spool(path, MIB)
    assert (again.waiting, again.moved_aside) == (1, 1)
    again.close()


def test_state_of_another_release_costs_the_open_tracks_alone(tmp_path, caplog):
    spool = Spool(tmp_path / "bridge.sqlite", MIB)
    spool.keep(0.0, None, [Part("yard", b"", b"{}")], b"no state")
    with caplog.at_level(logging.ERROR):
        inward(None, spool)._begin(0.0)
    assert [each.message for each in caplog.records] == ["open_tracks_dropped"]
    assert spool.waiting == 1
    spool.close()
