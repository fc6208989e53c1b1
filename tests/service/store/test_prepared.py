"""Statements that the driver runs itself: the same values, rows and errors as SQLAlchemy's."""

import sqlite3
from datetime import UTC, datetime, timedelta, timezone

import pytest
from sqlalchemy import bindparam, select, update
from sqlalchemy.exc import IntegrityError, OperationalError

from service.errors import OverloadedError
from service.store.cameras import CameraRecord
from service.store.engines.failures import failure_of
from service.store.engines.sqlite import Prepared
from service.store.engines.store import Store, joined
from tests.conftest import CAMERA

_NAME = Prepared(select(CameraRecord.name).where(CameraRecord.id == bindparam("camera")).limit(1))
_SEEN = Prepared(
    update(CameraRecord.__table__)
    .where(CameraRecord.id == bindparam("camera"))
    .values(updated_at=bindparam("now"), name=bindparam("called"))
)
_NOON = datetime(2026, 11, 20, 12, 30, 0, 250, tzinfo=UTC)


@pytest.fixture
def store(http, settings):
    http.post("/cameras", json={**CAMERA, "name": "Corner"}).raise_for_status()
    made = Store(settings, patience_s=0.1)
    yield made
    made.close()


def see(store, now, called="Seen"):
    with store.change() as connection:
        return _SEEN.change(connection, {"camera": "corner", "now": now, "called": called})


def test_a_row_is_found_or_none(store):
    with store.look() as connection:
        assert _NAME.row(connection, {"camera": "corner"}) == ("Corner",)
        assert _NAME.row(connection, {"camera": "nowhere"}) is None


def test_values_are_stored_as_sessions_store_them(store):
    assert see(store, _NOON.astimezone(timezone(timedelta(hours=5)))) == 1
    with store.read() as session:
        record = session.get(CameraRecord, "corner")
        assert (record.updated_at, record.name) == (_NOON, "Seen")
    with pytest.raises(ValueError, match="aware"):
        see(store, _NOON.replace(tzinfo=None))


def test_columns_that_would_be_converted_are_not_taken():
    with pytest.raises(AssertionError, match="updated_at"):
        Prepared(select(CameraRecord.updated_at))


def test_errors_are_those_that_the_service_knows(store, settings):
    with pytest.raises(IntegrityError):
        see(store, _NOON, called=None)
    with sqlite3.connect(settings.database_path) as other:
        other.execute("BEGIN IMMEDIATE")
        with store.look() as connection, pytest.raises(OperationalError) as raised:
            _SEEN.change(connection, {"camera": "corner", "now": _NOON, "called": "Seen"})
        assert isinstance(failure_of(raised.value), OverloadedError)


def test_nothing_is_kept_of_a_change_that_fails(store):
    both = [{"camera": "corner", "now": _NOON, "called": called} for called in ("Seen", None)]
    with pytest.raises(IntegrityError), store.change() as connection:
        _SEEN.change(connection, *both)
    with store.look() as connection:
        assert _NAME.row(connection, {"camera": "corner"}) == ("Corner",)


def test_who_may_not_write_in_time_is_told_so(store, settings):
    with sqlite3.connect(settings.database_path) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(OperationalError) as raised:
            see(store, _NOON)
        assert isinstance(failure_of(raised.value), OverloadedError)
    assert see(store, _NOON) == 1


def test_a_session_within_a_change_is_committed_with_it_or_not_at_all(store):
    for fails in (True, False):
        try:
            with store.change() as connection:
                with joined(connection) as session:
                    session.get(CameraRecord, "corner").name = "Joined"
                if fails:
                    raise ZeroDivisionError
        except ZeroDivisionError:
            pass
        with store.look() as connection:
            row = _NAME.row(connection, {"camera": "corner"})
        assert row == ("Corner" if fails else "Joined",)
