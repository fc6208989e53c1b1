"""An operator's trial: a fleet of 300 one morning, a briefing, and how each case was handled.

    python -m tests.trial [--port 8080] [--minutes 15]

Twelve cameras knocked, two clocks, one turned far, five silent, a tracker's four at once; nobody
else needs a person. It serves the pages and prints the briefing, which has what a person would know
from the street; then, as each case is handled, when and whether rightly. It ends once all are, or
when its time is over; exits with 1 where one is handled wrongly or not at all.
"""

import argparse
import signal
import sys
import tempfile
import time
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path

from sqlalchemy import select, update

from service.alerts.alerts import open_alert
from service.commands.migrate import migrate
from service.enums import AlertKind, Severity
from service.reasons import as_said
from service.settings import Settings
from service.store import references
from service.store.alerts import AlertRecord
from service.store.engines.store import Store
from service.store.tracks import TrackRecord
from tests.running import RunningService
from tests.service.fleet_bench import PLACES, Fleet

_FLEET = 300
_TRACKER = "nvr-east"
# Of which camera, by its number: what the street knows of it.
_PUT_BACK = (17, 41, 66, 98, 130, 171)
_KEPT = (203, 204, 205, 206)
_STOOD = (233, 262)
_CLOCKS, _FAR, _SILENT = (55, 120), 144, (20, 81, 160, 222, 280)
_TOGETHER = (48, 49, 50, 51)


@dataclass(frozen=True, kw_only=True)
class Case:
    """A camera, or the group, with the outcomes that are right; None: acknowledged will do."""

    name: str
    alert_id: str
    right: tuple[str | None, ...]


def name_of(number: int) -> str:
    """The name of a camera."""
    return f"{PLACES[number % len(PLACES)]} {number // len(PLACES) + 1}"


def id_of(number: int) -> str:
    """Its id."""
    return name_of(number).lower().replace(" ", "-")


def briefing() -> str:
    """What the operator is told at the begin of the shift."""

    def named(numbers: tuple[int, ...]) -> str:
        return ", ".join(map(name_of, numbers))

    return "\n".join(
        (
            "It is the morning after a storm. Handle all that needs a person.",
            f"- The crew has put these back where they were, an hour ago: {named(_PUT_BACK)}.",
            f"- The crew has left these as they hang now, on purpose: {named(_KEPT)}.",
            f"- Somebody has looked at these and their pictures: nothing moved: {named(_STOOD)}.",
            "- Clocks that were wrong have been set right.",
            "- Whatever looks elsewhere altogether: take it on yourself, the crew will go.",
            "- Who is silent: take it on yourself, the network's people are at it.",
            f"- The recorder {_TRACKER} was started anew in the night; it is well again.",
        )
    )


def seeded(settings: Settings) -> list[Case]:
    """The fleet in a migrated store, and what is to be handled."""
    fleet, cases = Fleet(settings), []
    special = {*_PUT_BACK, *_KEPT, *_STOOD, *_CLOCKS, _FAR, *_SILENT, *_TOGETHER}
    for number in range(_FLEET):
        state = "no_data" if number in _SILENT else "ok"
        fleet.add(id_of(number), name_of(number), state, tracks=20 + number % 30, estimates=12)
    outcomes = {number: ("put_back",) for number in _PUT_BACK}
    outcomes |= {number: ("accepted",) for number in _KEPT}
    outcomes |= {number: ("false_alarm",) for number in _STOOD}
    for number, right in outcomes.items():
        tilt = 2.0 + 0.02 * number
        cases.append(_case(number, fleet.knock(id_of(number), tilt_deg=tilt), right))
    for number in _CLOCKS:
        cases.append(_case(number, fleet.knock(id_of(number), kind="clock"), ("fixed",)))
    far = fleet.knock(id_of(_FAR), kind="unsure", severity="warning")
    cases.append(_case(_FAR, far, (None,)))
    with fleet.store.write() as session:
        for number in _SILENT:
            alert = open_alert(
                session, settings, id_of(number), AlertKind.NO_DATA, Severity.WARNING, {},
                fleet.now - timedelta(hours=26), reasons=as_said("the newest track is 26 h old"),
            )  # fmt: skip
            assert alert is not None
            cases.append(_case(number, alert.id, (None, "fixed")))
        for number in _TOGETHER:
            references.newest(session, id_of(number)).source = _TRACKER
            theirs = TrackRecord.camera_id == id_of(number)
            session.execute(update(TrackRecord).where(theirs).values(source=_TRACKER))
    for number in _TOGETHER:
        fleet.knock(id_of(number), tilt_deg=2.5)
    with fleet.store.read() as session:
        (group,) = session.scalars(select(AlertRecord).where(AlertRecord.camera_id.is_(None)))
        cases.append(Case(name=_TRACKER, alert_id=group.id, right=("fixed", "false_alarm")))
    fleet.close()
    assert len(special) == len(cases) - 1 + len(_TOGETHER)
    return cases


def _case(number: int, alert_id: str, right: tuple[str | None, ...]) -> Case:
    return Case(name=name_of(number), alert_id=alert_id, right=right)


def handled(store: Store, cases: list[Case]) -> dict[str, bool]:
    """Whether each case that is handled was so rightly, by its alert."""
    found = {}
    with store.read() as session:
        for case in cases:
            record = session.get_one(AlertRecord, case.alert_id)
            if record.outcome is not None:
                found[case.alert_id] = record.outcome in case.right
            elif record.acknowledged_at is not None and None in case.right:
                found[case.alert_id] = True
    return found


def main() -> int:
    """Serve, brief, and say how each case is handled."""
    words = argparse.ArgumentParser(prog="python -m tests.trial", description=__doc__)
    words.add_argument("--port", type=int, default=8080)
    words.add_argument("--minutes", type=float, default=15.0)
    asked = words.parse_args()
    with tempfile.TemporaryDirectory(prefix="surefoot-trial-") as folder:
        # No worker: what it would find in made-up tracks is not what the trial is about.
        settings = Settings(data_dir=Path(folder) / "data", port=asked.port, workers=0)
        migrate(settings)
        cases = seeded(settings)
        service = RunningService(settings, forked=False)
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # which stops the service, too
        service.start()
        try:
            return _watch(settings, cases, service.url, 60 * asked.minutes)
        finally:
            service.stop()


def _watch(settings: Settings, cases: list[Case], url: str, lasts_s: float) -> int:
    say(f"{briefing()}\nThe clock runs: {url}")
    begun, known, store = time.monotonic(), dict[str, bool](), Store(settings)
    while len(known) < len(cases) and time.monotonic() - begun < lasts_s:
        time.sleep(0.5)
        found = handled(store, cases)
        for case in cases:
            if known.get(case.alert_id) != found.get(case.alert_id):
                well = {True: "rightly", False: "WRONGLY", None: "taken back"}
                at_s = time.monotonic() - begun
                say(f"{at_s:6.1f} s  {case.name}: {well[found.get(case.alert_id)]}")
        known = found
    store.close()
    right = sum(known.values())
    lasted_s = time.monotonic() - begun
    say(f"{right} of {len(cases)} handled rightly after {lasted_s:.0f} s")
    return 0 if right == len(cases) else 1


def say(words: str) -> None:
    """Print at once."""
    sys.stdout.write(words + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
