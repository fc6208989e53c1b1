"""Tasks of `protocol`: cases and replays of recordings, each with a name of its own."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache
from pathlib import Path

import numpy as np

from models.errors import ShapeError, TooFewTrajectoriesError
from models.pose import CameraSite, learn_site, observe
from models.simulation.poses import PoseOffset
from models.tracks.scenes import Scene
from studies.faults.catalogue import FAULTS
from studies.protocol.cases import PANNED, RANGES, draw_case
from studies.protocol.partings import Parting, Split
from studies.recordings import load_recording
from studies.served.outcomes import ServedOutcome, serve_case
from studies.served.replays import ReplayOutcome, ReplayPlan, replay


class Table(StrEnum):
    """The tables, each of cases of its own."""

    TIME = "time"
    PEOPLE = "people"
    FAULTS = "faults"
    REPLAYS = "replays"
    FEW = "few"
    FAR = "far"
    MIDWAY = "midway"
    NAMES = "names"


ALONE = ("tilt-alone", "roll-alone", "height-alone", "pan-alone")
_KNOCKS = {
    Table.TIME: ("still", "pan", "knock", *ALONE),
    Table.PEOPLE: ("still", "pan", "knock", "pan-alone"),
    Table.FAULTS: ("still", "pan"),
    Table.MIDWAY: ("still", "pan", "knock", *ALONE),
    Table.FEW: ("still", "tilt-alone", "pan-alone", "pan"),
}
FEW = (8, 15, 20, 40)  # tracks
FAR_DEG = (12, 20, 30, 45, 60, 90, 120, 150, 180)  # pans, both ways
_TURNED_RAD = math.radians(2)  # of one angle, in a long replay
_TURNED = {"tilt-2": "tilt_rad", "roll-2": "roll_rad", "pan-2": "heading_rad"}
MOVES = ("still", *_TURNED, "pan")
LATER = tuple(name for name, fault in FAULTS.items() if fault.later)
_LONG = 1500  # tracks; of longer recordings parts are taken
_SIZES = ((200, 100), (1000, 400))
_WINDOW = 400


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseId:
    """Name of one case or replay, under which its outcome is stored."""

    table: Table
    scene: str
    seed: int
    knock: str
    batch: int
    fault: str = ""
    reference: int | None = None
    seen: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Task:
    """Some that share a recording and a reference, in the order that they are worked out."""

    folder: Path
    camera: int
    case_ids: tuple[CaseId, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class CaseResult:
    """Result of one case or replay; `failure` is an error that nobody foresaw."""

    case_id: CaseId
    outcome: ServedOutcome | ReplayOutcome | None
    failure: str = ""


def tasks_of(
    folders: Sequence[Path],
    *,
    tables: Sequence[Table],
    seeds: Sequence[int],
    batch: int,
    faults: Sequence[str],
) -> list[Task]:
    """All tasks on recordings, table by table.

    Raises:
        ShapeError: a recording cannot be read, or a fault has no such name.
    """
    for fault in faults:
        if fault not in FAULTS:
            raise ShapeError(f"faults: {', '.join(FAULTS)} are known, got {fault!r}")
    cameras = [
        (folder, camera, scene.scene_id, len(scene.tracks))
        for folder in folders
        for camera, scene in enumerate(load_recording(folder))
    ]
    return [
        Task(folder=folder, camera=camera, case_ids=case_ids)
        for table in tables
        for folder, camera, name, tracks in cameras
        for case_ids in _case_ids(table, name, tracks > _LONG, seeds, batch, faults)
    ]


def work(task: Task, plan: ReplayPlan) -> list[CaseResult]:
    """Results of a task, each part by itself: what fails is recorded and stops no other."""
    scene = _cameras(task.folder)[task.camera]
    found = []
    sites: dict[int, CameraSite | None] = {}
    for case_id in task.case_ids:
        try:
            outcome = (
                _replayed(scene, case_id, plan)
                if case_id.table == Table.REPLAYS
                else _served(scene, case_id, plan, sites)
            )
            found.append(CaseResult(case_id=case_id, outcome=outcome))
        except Exception as error:
            found.append(CaseResult(case_id=case_id, outcome=None, failure=repr(error)))
    return found


def _case_ids(
    table: Table,
    scene: str,
    long: bool,
    seeds: Sequence[int],
    batch: int,
    faults: Sequence[str],
) -> Iterator[tuple[CaseId, ...]]:
    """Cases of a camera in a table, in parts that share a reference."""
    if table == Table.REPLAYS:
        if not long:
            return
        for seed in seeds:
            for move in MOVES if seed == seeds[0] else MOVES[1:]:  # nothing is drawn while still
                case_id = CaseId(
                    table=table,
                    scene=scene,
                    seed=seed,
                    knock=move,
                    batch=batch,
                    reference=_SIZES[-1][0],
                )
                yield (case_id,)
        return
    if table == Table.FAR:
        yield from _far_ids(scene, long, seeds, batch)
        return
    if table == Table.NAMES:
        yield from _name_ids(scene, long, seeds, batch)
        return
    sizes: Sequence[tuple[int | None, int]] = _SIZES if long else ((None, _WINDOW),)
    if table == Table.FEW:
        sizes = [(_SIZES[0][0] if long else None, few) for few in FEW]
    names = [""] if table != Table.FAULTS else ["", *faults]
    for seed in seeds:
        for reference, seen in sizes if table != Table.FAULTS else sizes[-1:]:
            for fault in names:
                # Of halves in time nothing is drawn but the knock and the fault.
                drawn = table == Table.PEOPLE or long or bool(fault) or seed == seeds[0]
                yield tuple(
                    CaseId(
                        table=table, scene=scene, seed=seed, knock=knock, batch=batch,
                        fault=fault, reference=reference, seen=seen,
                    )
                    for knock in _KNOCKS[table]
                    if drawn or knock != "still"
                )  # fmt: skip


def _far_ids(
    scene: str, long: bool, seeds: Sequence[int], batch: int
) -> Iterator[tuple[CaseId, ...]]:
    """Far pans of a camera: of short recordings all later people come, of long ones 40 and 200."""
    for seed in seeds if long else seeds[:1]:
        for seen in (40, 200) if long else (_WINDOW,):
            yield tuple(
                CaseId(
                    table=Table.FAR,
                    scene=scene,
                    seed=seed,
                    knock=f"pan{turn:+d}",
                    batch=batch,
                    reference=_SIZES[0][0] if long else None,
                    seen=seen,
                )
                for size in FAR_DEG
                for turn in ((size, -size) if size < 180 else (size,))
            )


def _name_ids(
    scene: str, long: bool, seeds: Sequence[int], batch: int
) -> Iterator[tuple[CaseId, ...]]:
    """What sets in after the reference, before a camera that stands."""
    for seed in seeds:
        yield tuple(
            CaseId(
                table=Table.NAMES,
                scene=scene,
                seed=seed,
                knock="still",
                batch=batch,
                fault=fault,
                reference=_SIZES[-1][0] if long else None,
                seen=_WINDOW,
            )
            for fault in LATER
        )


def _served(
    scene: Scene, case_id: CaseId, plan: ReplayPlan, sites: dict[int, CameraSite | None]
) -> ServedOutcome:
    parting = Parting(
        split=Split.PEOPLE if case_id.table == Table.PEOPLE else Split.TIME,
        reference_tracks=case_id.reference,
        seen_tracks=case_id.seen,
    )
    fault = FAULTS[case_id.fault] if case_id.fault else None
    far = case_id.table == Table.FAR
    heading = math.radians(float(case_id.knock.removeprefix("pan"))) if far else None
    drawn = RANGES["still" if far else case_id.knock]
    still_share = 0.5 if case_id.table == Table.MIDWAY else 0.0
    case = draw_case(scene, case_id.seed, drawn, parting, fault, heading, still_share)
    if 0 not in sites:  # the tracks before the knock are the same whatever the knock
        known = observe(case.reference, case.intrinsics, case.prior_pose)
        try:
            sites[0] = learn_site(known, case.intrinsics, case.prior_pose, chart=False)
        except TooFewTrajectoriesError:
            sites[0] = None
    return serve_case(case, sites[0], plan.window)


def _replayed(scene: Scene, case_id: CaseId, plan: ReplayPlan) -> ReplayOutcome:
    rng = np.random.default_rng([case_id.seed, 1])
    knock: PoseOffset | None = None
    if case_id.knock in _TURNED:
        turn = float(rng.choice([-1, 1])) * _TURNED_RAD
        knock = PoseOffset(**{_TURNED[case_id.knock]: turn})
    elif case_id.knock == "pan":
        tilt, roll, log_height, heading = rng.uniform(-1, 1, 4)
        knock = PoseOffset(
            tilt_rad=tilt * PANNED.tilt_rad,
            roll_rad=roll * PANNED.roll_rad,
            log_height=log_height * PANNED.log_height,
            heading_rad=heading * PANNED.heading_rad,
        )
    return replay(scene, knock, case_id.seed, case_id.reference or _SIZES[-1][0], plan)


@lru_cache(maxsize=1)
def _cameras(folder: Path) -> list[Scene]:
    return load_recording(folder)
