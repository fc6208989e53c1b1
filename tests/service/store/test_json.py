"""JSON in the store, whatever the database: what is written can be read."""

import math
from datetime import UTC, datetime

from service.enums import EventType
from service.store import journal
from service.store.engines.store import Store
from service.store.journal import EventRecord


def test_what_is_not_finite_is_kept_as_null(settings):
    """PostgreSQL refused it, so that no alert could be opened; SQLite could not read it back."""
    store = Store(settings)
    payload = {"creep": {"by": math.nan, "sd": math.inf}, "sizes": [1.5, -math.inf], "way": "ü"}
    with store.write() as session:
        journal.add_event(session, EventType.POSE, payload, datetime.now(UTC))
    with store.read() as session:
        record = session.get_one(EventRecord, journal.newest_event_id(session))
        kept = {"creep": {"by": None, "sd": None}, "sizes": [1.5, None], "way": "ü"}
        assert record.payload == kept
    store.close()
