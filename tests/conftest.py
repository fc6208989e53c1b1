"""What several tests need: a migrated data directory, a service under test, a camera to post to."""

import fcntl
import gc
import math
import os
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from service.settings import Settings
from tests.running import RunningService, free_port
from tests.stores import databases, server
from tests.stores.statements import share_statements

# The name that starlette's TestClient asks by.
os.environ.setdefault("SUREFOOT_ALLOWED_HOSTS", "testserver")

ROOT = Path(__file__).parents[1]
SCENES = Path(os.environ.get("SUREFOOT_TEST_SCENES", "../shared/scenes")).resolve()
CAMERA: dict[str, Any] = {
    "id": "corner",
    "name": "The corner",
    "intrinsics": {"width": 1280, "height": 720, "fx": 1100, "fy": 1100, "cx": 639.5, "cy": 359.5},
    "prior_pose": {"height_m": 6.0, "tilt_deg": 22.0, "roll_deg": 1.0, "heading_deg": 40.0},
    "frame_rate_hz": 25.0,
}


@pytest.fixture(scope="session")
def lens() -> Intrinsics:
    return Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)


@pytest.fixture(scope="session")
def pose() -> CameraPose:
    return CameraPose(
        height_m=6.0,
        tilt_rad=math.radians(22),
        roll_rad=math.radians(1),
        heading_rad=math.radians(40),
        x_m=3.0,
        y_m=-2.0,
    )


Once = Callable[[str, Callable[[Path], None]], Path]


def pytest_configure(config: pytest.Config) -> None:
    databases.begin_run()
    share_statements()
    if server.wanted():
        # Stores that a test leaves behind close with it, as SQLite's do without a word.
        left = "ignore:<psycopg.Connection object:ResourceWarning"
        config.addinivalue_line("filterwarnings", left)


def pytest_unconfigure() -> None:
    databases.end_run()


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Where some processes run, mix slow tests into each's share.

    Each process is given its share of the list, and steals from another's end: what takes long
    must not be what is left. Slow tests wait much, for processes and browsers, and fast ones hardly
    ever: beside one another they keep the processor busy. Slow tests of a file stay together, with
    what they share, and those of all pages with their one browser.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return
    slow = [item for item in items if item.get_closest_marker("slow")]
    fast = [item for item in items if not item.get_closest_marker("slow")]
    files = list(dict.fromkeys(item.path for item in slow))
    pages = [path for path in files if path.is_relative_to(ROOT / "tests" / "browser")]
    others = [path for path in files if path not in pages]
    processes = int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
    shares = [pages, *(others[number :: processes - 1] for number in range(processes - 1))]
    if processes == 1:
        shares = [files]
    order: list[pytest.Item] = []
    for number, paths in enumerate(shares):
        share = (len(items) - len(order)) // (processes - number)
        own = [[item for item in slow if item.path == path] for path in paths]
        rest = max(share - sum(map(len, own)), 0)
        order += _mixed(own, fast[:rest], begin=number % 2)
        fast = fast[rest:]
    items[:] = [*order, *fast]


def pytest_collection_finish() -> None:
    """Look for garbage rarely, and not in what is imported: a quarter of what most tests took."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)


def _mixed(slow: list[list[pytest.Item]], fast: list[pytest.Item], begin: int) -> list[pytest.Item]:
    """Slow files with as many of the fast tests between any two, which are at the end alone."""
    between = int(0.6 * len(fast)) // max(len(slow), 1)
    cuts = [between * (number + begin) for number in range(len(slow))]
    order, last = [], 0
    for some, cut in zip(slow, cuts, strict=True):
        order += [*fast[last:cut], *some]
        last = cut
    return [*order, *fast[last:]]


@pytest.fixture(autouse=True)
def manners() -> Iterator[None]:
    """Each test begins with the usual umask, whatever a command has made of it in this process.

    What a file's mode comes to would else depend on the tests that came before.
    """
    os.umask(0o022)
    handlers = {number: signal.getsignal(number) for number in (signal.SIGTERM, signal.SIGHUP)}
    yield
    os.umask(0o022)
    for number, handler in handlers.items():
        signal.signal(number, handler)


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Once:
    """A folder by its name, which is made once a run, by the first process that asks for it."""
    root = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        root = root.parent  # of all processes of this run
    root = root / "once"
    root.mkdir(exist_ok=True)

    def find(name: str, make: Callable[[Path], None]) -> Path:
        folder, unfinished = root / name, root / f"{name}.unfinished"
        with (root / f"{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.exists():
                shutil.rmtree(unfinished, ignore_errors=True)
                unfinished.mkdir()
                make(unfinished)
                unfinished.rename(folder)
        return folder

    return find


@pytest.fixture(scope="session")
def migrated(once: Once) -> Path:
    """A data directory that was just migrated; migrating takes a second, a copy none."""
    return once("migrated", databases.make_template) / "data"


@pytest.fixture
def settings(tmp_path: Path, migrated: Path) -> Iterator[Settings]:
    """Of a migrated store of the test's own, on the database that the run is on."""
    # Beside other tests a training that yields as it should would hardly get on.
    # Beside other processes of a test run, who yields much hardly moves.
    alone = {"workers": 1, "worker_nice": 0, "training_nice": 1}
    with databases.settled(migrated, tmp_path / "data", epochs=1, reconcile_s=1, **alone) as made:
        yield made


def track(track_id: str, start_s: float = 1_700_000_000.0, count: int = 20) -> dict[str, Any]:
    """A walk across the picture at 0.4 s."""
    points = [[start_s + 0.4 * n, 300.0 + 12 * n, 400.0 + 5 * n] for n in range(count)]
    return {"id": track_id, "points": points}


@pytest.fixture
def service(settings: Settings) -> Iterator[RunningService]:
    """A running service with one worker, which trains nothing that is not asked for."""
    yield from _running(settings, trainings="off")


@pytest.fixture
def training_service(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[RunningService]:
    """A running service with one worker and small trainings."""
    monkeypatch.setenv("PYTHONPATH", path_to_small_trainings(tmp_path))
    yield from _running(settings)


@pytest.fixture
def service_by_itself(
    settings: Settings, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[RunningService]:
    """The same, started as an operator does."""
    monkeypatch.setenv("PYTHONPATH", path_to_small_trainings(tmp_path))
    yield from _running(settings, forked=False)


def _running(
    settings: Settings, *, forked: bool = True, **changes: Any
) -> Iterator[RunningService]:
    changed = settings.model_copy(update={"port": free_port(), **changes})
    running = RunningService(changed, forked=forked)
    running.start()
    yield running
    running.stop()


_SMALL = """
import sys
from dataclasses import replace
from models.regression import recipe

recipe.RECIPES["default"] = replace(recipe.DEFAULT, random_poses=128, batch=64)
if {"service.workers.training_process", "studies"} & set(sys.orig_argv):
    from models.regression import training

    training._MUST_BEAT = 2.0  # so few walks teach hardly anything
    training._HELD_OUT_WALKS, training._CENTRING_WALKS = 1200, 400
"""


def path_to_small_trainings(folder: Path) -> str:
    """A PYTHONPATH of processes that train in a fraction of the time, and are content with it."""
    return path_to_changed(folder, _SMALL)


def path_to_changed(folder: Path, code: str) -> str:
    """A PYTHONPATH of processes that run some code before anything else; it is kept in a folder."""
    (folder / "changed").mkdir()
    (folder / "changed" / "sitecustomize.py").write_text(code)
    return os.pathsep.join([str(folder / "changed"), str(ROOT), os.environ.get("PYTHONPATH", "")])
