"""After the run: what was acknowledged is there once, messages came in order, nothing waits."""

import sqlite3
import time
from collections import Counter, defaultdict
from collections.abc import Sequence
from typing import Any

import httpx

from tests.faults.ledger import Ledger
from tests.faults.stand import Stand
from tests.service.notifications.receiver import Receiver
from tests.stores.databases import ask

_STUCK_S, _LONGEST_S = 60.0, 900.0
_JOBS = "jobs of the engine"
# What has to become 0, and how it is counted in the store.
_WAITING = {
    "cameras with tracks that nothing looked at": (
        "SELECT c.id FROM cameras c WHERE (SELECT max(t.id) FROM tracks t WHERE t.camera_id = c.id)"
        " > coalesce(c.read_track_pk, 0)"
    ),
    "trainings queued or running": (
        "SELECT camera_id || ' ' || state || ' ' || step FROM trainings"
        " WHERE state IN ('queued', 'running')"
    ),
    "deliveries pending": "SELECT type FROM deliveries WHERE state = 'pending'",
    _JOBS: (
        "SELECT queue_name || ' ' || status FROM workflow_status"
        " WHERE status IN ('ENQUEUED', 'PENDING') AND queue_name IN ('train','estimate','deliver')"
    ),
}


def settle(stand: Stand, ledger: Ledger) -> float:
    """Wait until nothing is left to be done; seconds that took. What does not get on is stuck."""
    start = moved = time.monotonic()
    before: dict[str, list[str]] = {}
    while time.monotonic() - start < _LONGEST_S:
        waiting = _waiting(stand)
        # Jobs come and go also where none of them gets on; readiness counts its seconds.
        state = {name: rows for name, rows in waiting.items() if name in _WAITING and name != _JOBS}
        if state != before:
            before, moved = state, time.monotonic()
        if not waiting or time.monotonic() - moved > _STUCK_S:
            break
        time.sleep(0.5)
    took_s = time.monotonic() - start
    for name, found in waiting.items():
        words = f"stuck after {took_s:.0f} s: {len(found)} {name}: {dict(Counter(found))}"
        ledger.problem(words[:300])
    return took_s


def _waiting(stand: Stand) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    try:
        answers = [httpx.get(f"{each.url}/readyz", timeout=5) for each in stand.machines]
        if unready := [answer.text for answer in answers if answer.status_code != 200]:
            found["not ready"] = unready
    except httpx.HTTPError as error:
        found["not ready"] = [type(error).__name__]
    for name, statement in _WAITING.items():
        rows = [str(row[0]) for row in query(stand, statement)]
        if rows:
            found[name] = rows
    return found


def query(stand: Stand, statement: str) -> Sequence[Any]:
    """Rows out of the store, read beside the service."""
    if stand.database is not None:
        return ask(stand.settings, statement)
    path = stand.settings.database_path
    connection = sqlite3.connect(f"file:{path}?mode=ro", uri=True, timeout=30)
    try:
        return connection.execute(statement).fetchall()
    finally:
        connection.close()


def audit(stand: Stand, ledger: Ledger, receiver: Receiver, *, trained: bool) -> dict[str, int]:
    """The counts; whatever is wrong joins the ledger's problems."""
    jobs = ("run_estimate", "run_deliver", *(["run_training"] if trained else []))
    return {
        **_tracks(stand, ledger),
        **_messages(stand, ledger, receiver),
        **_witness(stand, ledger, jobs),
    }


def _tracks(stand: Stand, ledger: Ledger) -> dict[str, int]:
    rows = query(stand, "SELECT camera_id, source, track_id, started_s FROM tracks")
    stored = Counter(tuple(row) for row in rows)
    lost = ledger.acknowledged - set(stored)
    twice = [key for key, count in stored.items() if count > 1]
    if lost:
        ledger.problem(f"{len(lost)} acknowledged tracks are not stored, such as {min(lost)}")
    if twice:
        ledger.problem(f"{len(twice)} tracks are stored twice, such as {min(twice)}")
    return {
        "tracks acknowledged": len(ledger.acknowledged),
        "tracks stored": len(stored),
        "acknowledged and lost": len(lost),
        "stored twice": len(twice),
    }


def _messages(stand: Stand, ledger: Ledger, receiver: Receiver) -> dict[str, int]:
    rows = query(stand, "SELECT id, number, alert_id, type, state FROM deliveries")
    number = {row[0]: row[1] for row in rows}
    wanted = {row[0] for row in rows}
    got: dict[str, list[tuple[int, str]]] = defaultdict(list)
    seen = set()
    for message in list(receiver.received):
        message_id = message.headers["webhook-id"]
        if message_id in seen:
            continue
        seen.add(message_id)
        if message_id not in number:
            ledger.problem("a message came that the store does not know")
            continue
        got[message.json["data"]["id"]].append((number[message_id], message.json["type"]))
    missing = wanted - seen
    if missing:
        ledger.problem(f"{len(missing)} of {len(wanted)} messages were never delivered")
    disorder = [alert for alert, messages in got.items() if messages != sorted(messages)]
    if disorder:
        ledger.problem(
            f"the messages of {len(disorder)} alerts came out of order: {got[disorder[0]]}"
        )
    # The client's own books: an act that was answered with 200 was told, after those before it.
    acts: dict[str, list[str]] = defaultdict(list)
    for alert, type_ in ledger.acts:
        acts[alert].append(type_)
    untold = [
        alert for alert, types in acts.items() if not _within(types, [t for _, t in got[alert]])
    ]
    if untold:
        example = (acts[untold[0]], [t for _, t in got[untold[0]]])
        ledger.problem(f"the acts on {len(untold)} alerts were not told in order: {example}")
    return {
        "alert acts acknowledged": len(ledger.acts),
        "messages in the outbox": len(wanted),
        "messages received": len(receiver.received),
        "of them different": len(seen),
        "never delivered": len(missing),
        "alerts told out of order": len(disorder) + len(untold),
    }


def _within(part: list[str], whole: list[str]) -> bool:
    """Whether all of a part comes in a whole, in that order."""
    rest = iter(whole)
    return all(any(step == other for other in rest) for step in part)


def _witness(stand: Stand, ledger: Ledger, jobs: Sequence[str]) -> dict[str, int]:
    path = stand.folder / "witness" / "lines"
    lines = path.read_text().splitlines() if path.exists() else []
    kinds = Counter(line.split()[0] for line in lines)
    runs = Counter(line.split()[1] for line in lines if line.startswith("run "))
    twice = [line for line in lines if line.startswith("twice_at_once")]
    if twice:
        ledger.problem(f"{len(twice)} jobs ran twice at once, such as {twice[0]}")
    for line in sorted({line for line in lines if line.startswith("blind")}):
        ledger.problem(f"what happens at once cannot be told: {line}")
    for name in jobs:
        if not runs[name]:
            ledger.problem(f"no {name} was seen: what happens at once cannot be told")
    return {
        **{f"{name} seen": runs[name] for name in sorted(runs)},
        "jobs twice at once": len(twice),
        "jobs beside a stopped process": kinds["beside_a_stopped_one"],
        "jobs beside a machine that was cut off": kinds["beside_a_cut_one"],
    }
