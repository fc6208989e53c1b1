"""Zones after each knock of the protocol: served corners beside the true ones.

    python -m studies zones SCENE... [--seeds 12] [--knocks knock,pan] [--by-time]
    python -m studies zones SCENE... --turned 3,-2,3

Three zones of each scene on the ground where its people walk (all, near, far) and one in the scene
are drawn before the knock, and moved by the pose that would be served. The table has, of corners in
the image:

- cases in which a parameter that changed was not determined (`open`), and the others (`followed`)
- the error in shares of the image width, and for followed cases where the camera turned by up to
  8 deg
- the share of errors within 1.645 of the served `sd_px` (its major semi-axis), which the page shows
- the share within the 95 % ellipse
"""

import argparse
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from models.geometry.outlines import Outline, View, moved_outlines
from models.geometry.rotation import Array
from models.monitoring.drift import LIKELY, served_error
from models.quantiles import Z90
from models.simulation.poses import PoseOffset
from models.tracks.scenes import load_scene
from studies.protocol.cases import RANGES, ProtocolCase, angle_deg, draw_case
from studies.protocol.learned import learn_case
from studies.protocol.partings import HALVES_IN_TIME, HALVES_OF_PEOPLE
from studies.protocol.served import served_pose
from studies.runs import process_pool, with_bar

_WITHIN_95 = 5.991  # chi square of two degrees of freedom
_FAR_DEG = 8.0
_FLOOR_PX = 0.1  # of an ellipse that is a line


@dataclass(frozen=True, slots=True, kw_only=True)
class CornerError:
    """A corner's error.

    `share` of the image width; `sds` in units of the major semi-axis of its one-sd ellipse, and
    `squared` in units of that ellipse. `open`: a parameter that changed was not determined.
    """

    share: float
    sds: float
    squared: float
    turned_deg: float
    open: bool


def zones_of(case: ProtocolCase) -> list[Outline]:
    """Zones by quantiles of the reference's feet; the last one is in the scene."""
    feet = np.concatenate([track.uv for track in case.reference])
    (left, far), (_, middle), (right, near) = np.quantile(feet, (0.15, 0.5, 0.85), axis=0)
    drawn = View(intrinsics=case.intrinsics, pose=case.prior_pose)
    boxes = [(far, near, True), (middle, near, True), (far, middle, True), (far, near, False)]
    return [
        Outline(
            corners=np.array([[left, top], [right, top], [right, low], [left, low]]),
            drawn=drawn,
            on_ground=on_ground,
        )
        for top, low, on_ground in boxes
    ]


def corner_errors(
    folder: Path, seed: int, knock: str, by_time: bool, offset: PoseOffset | None = None
) -> list[CornerError]:
    """The errors of a case's corners that are in the image.

    Args:
        folder: of the scene.
        seed: of the case.
        knock: range of the offset, by its name in `RANGES`.
        by_time: whether the reference is the first half in time.
        offset: in place of one that is drawn.
    """
    parting = HALVES_IN_TIME if by_time else HALVES_OF_PEOPLE
    case = draw_case(load_scene(folder), seed, RANGES[knock], parting, offset=offset)
    learned = learn_case(case)
    found = served_pose(learned.seen, learned.site)
    names = found.drift.identifiable
    moved = found.posterior.moved >= LIKELY
    covariance = served_error(
        found.drift, case.prior_pose, found.posterior.covariance, found.pose, moved=moved
    )
    turned = case.true_pose.heading_rad != case.prior_pose.heading_rad
    needed = {"tilt", "roll", "height"} | ({"heading"} if turned else set())
    errors = []
    for zone in zones_of(case):
        now = View(intrinsics=case.intrinsics, pose=found.pose)
        (true,) = moved_outlines([zone], replace(now, pose=case.true_pose), None)
        (told,) = moved_outlines([zone], now, covariance)
        if len(true.corners) != 4 or len(told.corners) != 4 or told.ellipses is None:
            continue  # cut at the horizon
        seen = case.intrinsics.contains(true.corners)
        off = told.corners - true.corners
        squared = _squared(off, told.ellipses)
        errors += [
            CornerError(
                share=float(np.hypot(*off[number])) / case.intrinsics.width,
                sds=float(np.hypot(*off[number]) / max(told.ellipses[number, 0], _FLOOR_PX)),
                squared=float(squared[number]),
                turned_deg=angle_deg(case.true_pose, case.prior_pose),
                open=not needed <= set(names),
            )
            for number in np.flatnonzero(seen)
        ]
    return errors


def _squared(off: Array, ellipses: Array) -> Array:
    """Squared distances (N,) of errors (N, 2) in units of one-sd ellipses (N, 3)."""
    major, minor, angle = ellipses.T
    along = off[:, 0] * np.cos(angle) + off[:, 1] * np.sin(angle)
    aside = off[:, 1] * np.cos(angle) - off[:, 0] * np.sin(angle)
    along, aside = along / np.maximum(major, _FLOOR_PX), aside / np.maximum(minor, _FLOOR_PX)
    return np.asarray(along**2 + aside**2)


def main(arguments: Sequence[str]) -> None:
    """Print a table of scenes and ranges."""
    asked = argparse.ArgumentParser(
        prog="studies zones", description=(__doc__ or "").splitlines()[0]
    )
    asked.add_argument("scenes", nargs="+", type=Path)
    asked.add_argument("--seeds", type=int, default=12)
    asked.add_argument("--knocks", default="knock,pan")
    asked.add_argument("--by-time", action="store_true")
    asked.add_argument("--turned", help="tilt,roll,heading in degrees, in place of a drawn knock")
    asked.add_argument("--processes", type=int, default=2)
    wanted = asked.parse_args(arguments)
    tasks = [
        (folder, seed, knock)
        for knock in wanted.knocks.split(",")
        for folder in wanted.scenes
        for seed in range(wanted.seeds)
    ]
    console = Console(width=110)
    offset = None
    if wanted.turned:
        tilt, roll, heading = map(math.radians, map(float, wanted.turned.split(",")))
        offset = PoseOffset(tilt_rad=tilt, roll_rad=roll, log_height=0.0, heading_rad=heading)
    work = [partial(_named, *task, wanted.by_time, offset) for task in tasks]
    found: defaultdict[tuple[str, str], list[CornerError]] = defaultdict(list)
    with process_pool(wanted.processes) as pool:
        for knock, scene, errors in with_bar(pool, work, console):
            found[knock, scene] += errors
            found[knock, "all"] += errors
    table = Table(
        "knock",
        "scene",
        "",
        "corners",
        "median %",
        "90 %",
        "median %, to 8 deg",
        "in 1.645 sd",
        "in 95 %",
    )
    for (knock, scene), errors in sorted(found.items()):
        for name, is_open in (("followed", False), ("open", True)):
            part = [each for each in errors if each.open == is_open]
            if part:
                table.add_row(knock, scene, name, *_row(part))
    console.print(table)


def _named(
    folder: Path, seed: int, knock: str, by_time: bool, offset: PoseOffset | None
) -> tuple[str, str, list[CornerError]]:
    return knock, folder.name, corner_errors(folder, seed, knock, by_time, offset)


def _row(errors: Sequence[CornerError]) -> list[str]:
    shares = [100 * each.share for each in errors]
    near = [100 * each.share for each in errors if each.turned_deg <= _FAR_DEG] or [math.nan]
    return [
        str(len(errors)),
        f"{np.median(shares):.2f}",
        f"{np.quantile(shares, 0.9):.2f}",
        f"{np.median(near):.2f}",
        f"{100 * np.mean([each.sds <= Z90 for each in errors]):.0f} %",
        f"{100 * np.mean([each.squared <= _WITHIN_95 for each in errors]):.0f} %",
    ]
