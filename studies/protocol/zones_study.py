"""Zones after each knock of the protocol: where their corners are told to be, and where they are.

    python -m studies zones SCENE... [--seeds 12] [--knocks knock,pan] [--by-time]

Three zones of each scene on the ground where its people walk (all, near, far) and one in the scene
are drawn before the knock, and moved by the pose that would be served. Of corners that are in the
picture: their error in shares of its width, of all and where the camera turned by up to 8 deg, and
how many are within the ellipse told for 95 of 100. Cases in which a number that changed is not
identifiable are declared, and stand in a column of their own.
"""

import argparse
import math
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from models.geometry.outlines import Outline, View, moved_outline
from models.geometry.propagation import restricted
from models.geometry.rotation import Array
from models.tracks.scenes import load_scene
from studies.protocol.cases import RANGES, ProtocolCase, angle_deg, draw_case
from studies.protocol.learned import learn_case
from studies.protocol.partings import HALVES_IN_TIME, HALVES_OF_PEOPLE
from studies.protocol.served import served_pose
from studies.runs import process_pool, with_bar

_WITHIN_95 = 5.991  # chi square of two degrees of freedom
_FAR_DEG = 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class CornerError:
    """A corner's error: as a share of the picture's width, and squared in units of its ellipse."""

    share: float
    squared: float
    turned_deg: float
    declared: bool


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


def corner_errors(folder: Path, seed: int, knock: str, by_time: bool) -> list[CornerError]:
    """The errors of a case's corners that are in the picture."""
    parting = HALVES_IN_TIME if by_time else HALVES_OF_PEOPLE
    case = draw_case(load_scene(folder), seed, RANGES[knock], parting)
    learned = learn_case(case)
    found = served_pose(learned.seen, learned.site)
    names = found.drift.identifiable
    covariance = restricted(found.posterior.covariance, names)
    needed = {"tilt", "roll", "height"} | ({"heading"} if RANGES[knock].heading_rad else set())
    errors = []
    for zone in zones_of(case):
        true = moved_outline(zone, View(intrinsics=case.intrinsics, pose=case.true_pose), None)
        told = moved_outline(zone, View(intrinsics=case.intrinsics, pose=found.pose), covariance)
        if len(true.corners) != 4 or len(told.corners) != 4 or told.ellipses is None:
            continue  # cut at the horizon
        seen = case.intrinsics.contains(true.corners)
        off = told.corners - true.corners
        squared = _squared(off, told.ellipses)
        errors += [
            CornerError(
                share=float(np.hypot(*off[number])) / case.intrinsics.width,
                squared=float(squared[number]),
                turned_deg=angle_deg(case.true_pose, case.prior_pose),
                declared=not needed <= set(names),
            )
            for number in np.flatnonzero(seen)
        ]
    return errors


def _squared(off: Array, ellipses: Array) -> Array:
    """Squared distances (N,) of errors (N, 2) in units of one-sd ellipses (N, 3)."""
    major, minor, angle = ellipses.T
    along = off[:, 0] * np.cos(angle) + off[:, 1] * np.sin(angle)
    aside = off[:, 1] * np.cos(angle) - off[:, 0] * np.sin(angle)
    floor = 0.1  # of a pixel, where an ellipse is but a line
    return np.asarray(
        (along / np.maximum(major, floor)) ** 2 + (aside / np.maximum(minor, floor)) ** 2
    )


def main(arguments: Sequence[str]) -> None:
    """Print a table of scenes and ranges."""
    asked = argparse.ArgumentParser(
        prog="studies zones", description=(__doc__ or "").splitlines()[0]
    )
    asked.add_argument("scenes", nargs="+", type=Path)
    asked.add_argument("--seeds", type=int, default=12)
    asked.add_argument("--knocks", default="knock,pan")
    asked.add_argument("--by-time", action="store_true")
    asked.add_argument("--processes", type=int, default=2)
    wanted = asked.parse_args(arguments)
    tasks = [
        (folder, seed, knock)
        for knock in wanted.knocks.split(",")
        for folder in wanted.scenes
        for seed in range(wanted.seeds)
    ]
    console = Console(width=110)
    work = [partial(_named, *task, wanted.by_time) for task in tasks]
    found: defaultdict[tuple[str, str], list[CornerError]] = defaultdict(list)
    with process_pool(wanted.processes) as pool:
        for knock, scene, errors in with_bar(pool, work, console):
            found[knock, scene] += errors
            found[knock, "all"] += errors
    table = Table(
        "knock",
        "scene",
        "corners",
        "declared",
        "median %",
        "90 %",
        "median %, to 8 deg",
        "within 95",
    )
    for (knock, scene), errors in sorted(found.items()):
        table.add_row(knock, scene, *_row(errors))
    console.print(table)


def _named(
    folder: Path, seed: int, knock: str, by_time: bool
) -> tuple[str, str, list[CornerError]]:
    return knock, folder.name, corner_errors(folder, seed, knock, by_time)


def _row(errors: Sequence[CornerError]) -> list[str]:
    told = [each for each in errors if not each.declared]
    shares = [100 * each.share for each in told] or [math.nan]
    near = [100 * each.share for each in told if each.turned_deg <= _FAR_DEG] or [math.nan]
    within = [float(each.squared <= _WITHIN_95) for each in told] or [math.nan]
    return [
        str(len(errors)),
        str(len(errors) - len(told)),
        f"{np.median(shares):.2f}",
        f"{np.quantile(shares, 0.9):.2f}",
        f"{np.median(near):.2f}",
        f"{100 * np.mean(within):.0f} %",
    ]
