"""Three cameras and what became of them in the weeks before Monday, 30 March 2026."""

from datetime import UTC, datetime
from typing import Any

from service.reasons import as_said
from service.store.alerts import AlertRecord
from tests.service.fleet_bench import Fleet

# Mondays, 7:00 in Copenhagen: the clocks go forward between them.
BEGIN, END = "2026-03-23T06:00:00Z", "2026-03-30T05:00:00Z"


def at(text: str) -> datetime:
    """A time of March 2026: "24 10:00"."""
    day, _, clock = text.partition(" ")
    return datetime.fromisoformat(f"2026-03-{int(day):02}T{clock}").replace(tzinfo=UTC)


def put(fleet: Fleet, alert_id: str, kind: str, camera_id: str | None, opened: str, **more: Any):
    """An alert as it stands in the store."""
    given = {name: at(value) if name.endswith("_at") else value for name, value in more.items()}
    state = "resolved" if "outcome" in more else "firing"
    with fleet.store.write() as session:
        session.add(
            AlertRecord(
                id=alert_id, camera_id=camera_id, kind=kind, state=state, source="estimate",
                severity="critical", reasons=as_said("a wrong clock"),
                opened_at=at(opened), updated_at=at(opened), **{"drift": {}, **given},
            )
        )  # fmt: skip


def some_weeks(fleet: Fleet) -> None:
    """A knock put back, a false alarm, a clock mended, a tracker's clock, and older ones."""
    for n in (1, 2, 3):
        fleet.add(f"c{n}", f"Corner {n}")
    put(fleet, "a", "drift", "c1", "24 10:00", changed_at="24 09:40", drift={"tilt_rad": 0.0523599},
        acknowledged_by="Ada", acknowledged_at="24 10:12", resolved_by="Ada",
        resolved_at="24 13:00", outcome="put_back", note="a ladder")  # fmt: skip
    put(fleet, "b", "drift", "c2", "25 08:00", resolved_by="Bo", resolved_at="25 08:30",
        outcome="false_alarm")  # fmt: skip
    put(fleet, "c", "clock", "c1", "20 08:00", resolved_by="Bo", resolved_at="24 08:00",
        outcome="fixed")  # fmt: skip
    put(fleet, "d", "no_data", "c3", "10 08:00", resolved_at="12 08:00", outcome="cleared")
    put(fleet, "e", "many_moved", None, "26 08:00", camera_ids=["c1", "c2", "c3"],
        track_source="bytetrack", resolved_at="26 09:00", outcome="cleared")  # fmt: skip
    put(fleet, "m", "clock", "c3", "26 08:00", group_id="e", resolved_at="26 09:00",
        outcome="cleared")  # fmt: skip
    put(fleet, "f", "drift", "c3", "30 05:00", resolved_at="30 06:00", outcome="cleared")
