"""The faults of machines that share a PostgreSQL server: of the server, and of the way to it."""

import random
import time

from tests.faults.database import Database
from tests.faults.ledger import Ledger
from tests.faults.stand import Stand

_CUT_S, _READ_ONLY_S = 20.0, 8.0
_CAME_BACK_S = 3.0  # until what hung on a cut link has ended
_RECOVERED_S = 60.0


def restart(stand: Stand, ledger: Ledger, _: random.Random) -> None:
    """The server crashes and comes back; all connections are gone."""
    _of(stand).restart()
    _recovers(stand, ledger, "a crash of the database")


def partition(stand: Stand, ledger: Ledger, random_: random.Random) -> None:
    """A machine is cut off from the database for 20 s; the others go on without it."""
    number = random_.randrange(len(stand.machines))
    cut = stand.machines[number]
    others = [machine for machine in stand.machines if machine is not cut]
    mark = stand.folder / "witness" / "cut"
    mark.write_text(cut.environment["SUREFOOT_DATA_DIR"])
    _of(stand).links[number].cut()
    end = time.monotonic() + _CUT_S
    while time.monotonic() < end:
        time.sleep(1.0)
        if not all(machine.answers() for machine in others):
            ledger.oddities["partition: a machine that was not cut off did not answer"] += 1
    _of(stand).links[number].mend()
    _recovers(stand, ledger, "a partition")
    time.sleep(_CAME_BACK_S)
    mark.unlink()


def read_only(stand: Stand, ledger: Ledger, _: random.Random) -> None:
    """The server refuses to write for some seconds."""
    before = ledger.refusals()
    _of(stand).read_only(True)
    time.sleep(_READ_ONLY_S)
    if not stand.answers():
        ledger.problem("read-only primary: /healthz is not answered")
    if ledger.refusals() == before:
        ledger.oddities["read-only primary: nothing was refused"] += 1
    _of(stand).read_only(False)
    _recovers(stand, ledger, "a read-only primary")


def _recovers(stand: Stand, ledger: Ledger, name: str) -> None:
    """Wait until all machines are ready, and note how long that took."""
    begun = time.monotonic()
    while not stand.answers("/readyz"):
        if time.monotonic() - begun > _RECOVERED_S:
            ledger.problem(f"not ready {_RECOVERED_S:g} s after {name}")
            return
        time.sleep(0.2)
    ledger.recovered(name, time.monotonic() - begun)


def _of(stand: Stand) -> Database:
    assert stand.database is not None
    return stand.database
