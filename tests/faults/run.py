"""The run: a schedule of faults by a seed, under load, and the audit after it."""

import random
import shutil
import sys
import tempfile
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.faults.audit import audit, settle
from tests.faults.clients import Client, Operator, Tracker, register
from tests.faults.faults import FAULTS, Fault, clock_back, corrupt, mount_disk
from tests.faults.ledger import Ledger
from tests.faults.stand import Stand
from tests.service.notifications.receiver import Receiver, receiver

_START_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """How much of what."""

    kills: int
    seed: int
    cameras: int
    trackers: int
    trainings: int
    workers: int
    machines: int
    pause_s: float
    only: Sequence[str]
    keep: bool


def run(plan: Plan) -> int:
    """Run, print the counts, and return 0 where nothing is wrong."""
    start = time.monotonic()
    ledger, folder = Ledger(), Path(tempfile.mkdtemp(prefix="surefoot-faults-"))
    stand = Stand(folder, plan.workers, plan.machines, on_server=plan.machines > 1)
    counts: dict[str, int] = {}
    try:
        if stand.database is None and (missing := mount_disk(stand)) is not None:
            say(f"not tried: a disk of its own: {missing}")
        stand.prepare()
        with receiver() as inbox:
            load_s = _under_load(plan, stand, ledger, inbox)
            settled_s = settle(stand, ledger)
            stand.stop()
            counts = audit(stand, ledger, inbox, trained=bool(plan.trainings))
        if _wanted(plan, "corrupt") and stand.database is None:
            corrupt(stand, ledger)
        say(f"under load for {load_s:.0f} s, settled after {settled_s:.0f} s more")
    finally:
        stand.close()
        if plan.keep:
            say(f"kept: {folder}")
        else:
            shutil.rmtree(folder, ignore_errors=True)  # a mount goes with its namespace
    _tell(plan, stand, ledger, counts, time.monotonic() - start)
    return 1 if ledger.problems else 0


def _under_load(plan: Plan, stand: Stand, ledger: Ledger, inbox: Receiver) -> float:
    over = threading.Event()
    stand.start()
    first = Client(stand, ledger, over, plan.seed)
    end = time.monotonic() + _START_S
    while not stand.answers("/readyz"):
        if time.monotonic() > end:
            raise RuntimeError(f"no service after {_START_S:g} s: {stand.log.read_text()[-2000:]}")
        time.sleep(0.3)
    cameras = [f"street-{n}" for n in range(plan.cameras)]
    for camera_id in [*cameras, "acts-0", "acts-1"]:
        register(first, camera_id, 30)
    for camera_id in [*cameras[plan.trainings :], "acts-0", "acts-1"]:
        _cancel_trainings(first, camera_id)
    first.insist("POST webhooks", "POST", "/webhooks", json={"url": inbox.url})
    clients: list[Client] = [
        Tracker(cameras[n % len(cameras)], n, plan.pause_s, stand, ledger, over, plan.seed + n)
        for n in range(plan.trackers)
    ]
    clients += [Operator(f"acts-{n}", stand, ledger, over, plan.seed + 100 + n) for n in (0, 1)]
    start = time.monotonic()
    for client in clients:
        client.start()
    _carry_out(plan, stand, ledger, inbox)
    if stand.database is None and stand.has_clock and _wanted(plan, "clock"):
        clock_back(stand, ledger)
        inbox.answer(503, 503, 204)
    time.sleep(5)
    over.set()
    for client in clients:
        client.join(30)
        if client.is_alive():
            ledger.problem(f"a client is still waiting: {client}")
    inbox.answer(204)
    return time.monotonic() - start


def _cancel_trainings(client: Client, camera_id: str) -> None:
    """Trainings are the slow part; few are enough."""
    path = f"/cameras/{camera_id}/trainings"
    for training in client.http.get(path).json()["items"]:
        client.insist("DELETE trainings", "DELETE", f"/trainings/{training['id']}")


def _carry_out(plan: Plan, stand: Stand, ledger: Ledger, inbox: Receiver) -> None:
    """Kills by the schedule, and every other fault in turn between them."""
    random_ = random.Random(plan.seed)
    between = [fault for fault in FAULTS if _wanted(plan, fault.name) and _possible(fault, stand)]
    # Once each in a short run, some times in a long one.
    rounds = max(1, plan.kills // 40)
    schedule: list[Fault | str] = [*between] * rounds
    schedule += [random_.choice(("api", "worker")) for _ in range(plan.kills)]
    random_.shuffle(schedule)
    for number, fault in enumerate(schedule):
        time.sleep(random_.choice((0.2, 1.0, 2.0, 4.0)))  # some come in the midst of a start
        inbox.answer(*(random_.choice((204, 204, 503)) for _ in range(5)), 204)
        if isinstance(fault, Fault):
            say(f"{number + 1}/{len(schedule)}: {fault.name}")
            _await(stand, ledger, _START_S)  # what is told of a fault is not a kill's
            fault.do(stand, ledger, random_)
            ledger.fault(fault.name)
        else:
            _kill(stand, ledger, fault, random_)


def _await(stand: Stand, ledger: Ledger, longest_s: float) -> None:
    """Wait until the service answers."""
    end = time.monotonic() + longest_s
    while not stand.answers():
        if time.monotonic() > end:
            ledger.problem(f"the service does not answer for {longest_s:g} s after a kill")
            return
        time.sleep(0.2)


def _kill(stand: Stand, ledger: Ledger, which: str, random_: random.Random) -> None:
    """One kill, as soon as there is something to kill."""
    end = time.monotonic() + _START_S
    while time.monotonic() < end:
        machine = random_.choice(stand.machines)
        if machine.kill_api() if which == "api" else machine.kill_worker(random_):
            ledger.fault(f"kill -9 {which}")
            return
        time.sleep(0.2)
    ledger.problem(f"no {which} to kill within {_START_S:g} s: the service does not come back")


def _wanted(plan: Plan, name: str) -> bool:
    return not plan.only or name in plan.only


def _possible(fault: Fault, stand: Stand) -> bool:
    missing = fault.missing(stand)
    if missing is not None:
        say(f"not tried: {fault.name}: {missing}")
    return missing is None


def _tell(plan: Plan, stand: Stand, ledger: Ledger, counts: dict[str, int], took_s: float) -> None:
    say(f"\nseed {plan.seed}, {took_s:.0f} s, {stand.starts} starts of the service")
    for title, table in (
        ("faults", {name: n for name, n in sorted(ledger.faults.items())}),
        ("answers", {f"{what} {n}": c for (what, n), c in sorted(ledger.answers.items())}),
        ("audit", counts),
        ("seconds until all was ready after", ledger.recoveries()),
        ("oddities", dict(ledger.oddities.most_common(12))),
        ("PROBLEMS", dict(ledger.problems.most_common())),
    ):
        say(f"\n{title}{'' if table else ': none'}")
        for name, count in table.items():
            say(f"  {count:>8}  {name}")


def say(line: str) -> None:
    """One line for who watches."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()
