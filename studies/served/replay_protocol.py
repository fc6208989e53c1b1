"""Put a case of the protocol to a running service: tracks at the prior pose, then knocked ones."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.console import Console
from rich.table import Table

from models.errors import TooFewTrajectoriesError
from models.geometry.intrinsics import Intrinsics
from models.geometry.rotation import Array, angle_between
from models.geometry.upright import tops_of_boxes
from models.pose import count_walks, observe
from models.tracks.scenes import load_scene
from models.tracks.trajectory import Trajectory
from models.walking.config import FEWEST_WALKERS
from service.commands.replay import camera_body, client_of
from service.enums import ReferenceState
from studies.protocol.cases import RANGES, ProtocolCase, draw_case
from studies.protocol.partings import HALVES_IN_TIME, HALVES_OF_PEOPLE

_SOURCE = "surefoot-protocol"
_BATCH_TRACKS = 500  # a whole half of most scenes: one estimate of all
_FEWEST = 5
_HALF_WIDTH_PX = 2.0**-10
_GAP_S = 60.0
_POLL_S = 0.3
_LONGEST_S = 300.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ProtocolReplay:
    """Outcome of a case that a service served, beside the truth.

    `lost_tops` is how many known upper edges no box could carry.
    """

    case: ProtocolCase
    camera_id: str
    served: dict[str, Any]
    angle_error_deg: float
    height_error: float
    lost_tops: int


def replay_protocol(
    folder: Path,
    url: str,
    *,
    seed: int,
    knock: str,
    by_time: bool = False,
    batch: int | None = None,
    on_progress: Callable[[str, int, int], None],
    token: str | None = None,
) -> ProtocolReplay:
    """Register a camera for one case, let it learn its reference, and show it the knocked tracks.

    After each batch the estimate is waited for, so that a service sees what `looks` sees offline.

    Args:
        folder: the scene.
        url: the running service.
        seed: of the case: who walks before the knock, and the knock.
        knock: how far it may go, a name in `studies.protocol.cases.RANGES`.
        by_time: whether the earlier people are the reference; else one half of them by lot.
        batch: how many of the knocked tracks are posted at once; 500 unless it is said.
        on_progress: is told what is waited for, how much there is, and how much is wanted.
        token: for a service that wants one: of the scopes admin and ingest.

    Raises:
        httpx.HTTPError: the service cannot be reached or refuses.
        TooFewTrajectoriesError: the case has too few tracks for a reference.
        TimeoutError: the service took longer than five minutes over one of its parts.
    """
    parting = HALVES_IN_TIME if by_time else HALVES_OF_PEOPLE
    case = draw_case(load_scene(folder), seed, RANGES[knock], parting)
    people = count_walks(case.reference, case.intrinsics, case.prior_pose)
    seen = observe(case.seen, case.intrinsics, case.prior_pose)
    walking = np.unique(seen.steps.rows.owner_idx)
    if people < _FEWEST or walking.size < FEWEST_WALKERS:
        raise TooFewTrajectoriesError(
            f"tracks: {_FEWEST} before and after the knock are needed, got {people} and "
            f"{len(case.seen)}"
        )
    camera_id = f"{case.scene_id}-{knock}-{seed}" + ("-by-time" if by_time else "")
    if batch is not None:
        camera_id += f"-{batch}"
    batch = batch or _BATCH_TRACKS
    shifts = _shifts(case)
    with client_of(url, token) as http:
        body = camera_body(camera_id, case.intrinsics, case.prior_pose)
        http.post("/cameras", json={**body, "reference_tracks": people}).raise_for_status()
        lost = _post(http, camera_id, case.reference, "r", shifts[0], case.intrinsics)
        _wait(
            http, camera_id, lambda pose: pose["reference"]["state"] == ReferenceState.READY,
            lambda pose: on_progress("reference", pose["reference"]["tracks"], people),
        )  # fmt: skip
        for at in range(0, len(case.seen), batch):
            some = case.seen[at : at + batch]
            lost += _post(http, camera_id, some, f"s{at}-", shifts[1], case.intrinsics)
            if (walking < at + len(some)).sum() < FEWEST_WALKERS:
                continue  # no estimate is made of so few
            covers = partial(_covers, newest_s=float(some[-1].time_s[-1]) + shifts[1])
            served = _wait(
                http, camera_id, covers,
                lambda pose: on_progress("estimate", pose["tracks"], len(case.seen)),
            )  # fmt: skip
    return ProtocolReplay(
        case=case,
        camera_id=camera_id,
        served=served,
        angle_error_deg=math.degrees(
            float(
                angle_between(
                    np.array(served["pose"]["quaternion_wxyz"]), case.true_pose.quaternion_wxyz
                )
            )
        ),
        height_error=abs(served["pose"]["height_m"] / case.true_pose.height_m - 1),
        lost_tops=lost,
    )


def print_outcome(outcome: ProtocolReplay, console: Console) -> None:
    """The served pose beside the prior and the true one."""
    pose, sd = outcome.served["pose"], outcome.served["sd"] or {}
    table = Table(title=f"{outcome.camera_id}: {outcome.served['state']}", title_justify="left")
    for column in ("", "prior", "true", "served", "sd"):
        table.add_column(column, justify="right" if column else "left")
    prior, true = outcome.case.prior_pose, outcome.case.true_pose
    for field, before, after in (
        ("tilt_deg", math.degrees(prior.tilt_rad), math.degrees(true.tilt_rad)),
        ("roll_deg", math.degrees(prior.roll_rad), math.degrees(true.roll_rad)),
        ("height_m", prior.height_m, true.height_m),
        ("heading_deg", math.degrees(prior.heading_rad), math.degrees(true.heading_rad)),
    ):
        shown = "not told" if sd.get(field) is None else f"{sd[field]:.3f}"
        table.add_row(field, f"{before:.3f}", f"{after:.3f}", f"{pose[field]:.3f}", shown)
    console.print(table)
    console.print(
        f"{outcome.angle_error_deg:.2f} deg and {100 * outcome.height_error:.1f} % of height off. "
        f"{outcome.served['reason']}"
    )
    if outcome.lost_tops:
        console.print(
            f"{outcome.lost_tops} upper edges of boxes went unsaid: their feet are within two "
            "pixels of the picture's border, where boxes are taken for cut"
        )


def boxes_of(trajectory: Trajectory, intrinsics: Intrinsics) -> Array | None:
    """Boxes (N, 4) that carry a track's feet, bit by bit, and its upper edges; None without these.

    The boxes are narrow, so that the border of the picture cuts none that need not be cut. Where
    the upper edge is not known, the box reaches the picture's upper border, as that of a person
    whom it cuts. An upper edge is lost where the foot itself is within two pixels of the border:
    the service then takes the box for cut.
    """
    if trajectory.top_v is None:
        return None
    u, v = trajectory.uv.T
    # The outer side is rounded first; the inner one then makes the sum 2 u to the bit.
    outward = np.abs(u)
    half = np.where(u == 0, _HALF_WIDTH_PX, np.minimum(_HALF_WIDTH_PX, outward / 2))
    far = outward + half
    near = 2 * outward - far
    x1, x2 = np.where(u >= 0, near, -far), np.where(u >= 0, far, -near)
    assert ((x1 + x2) / 2 == u).all()
    top = np.where(np.isfinite(trajectory.top_v), trajectory.top_v, np.minimum(0.0, v - 1))
    return np.stack([x1, np.minimum(top, v - 1e-3), x2, v], axis=-1)


def tops_carried(trajectory: Trajectory, intrinsics: Intrinsics) -> Trajectory:
    """The track as the service reads it out of the boxes of `boxes_of`."""
    boxes = boxes_of(trajectory, intrinsics)
    tops = None if boxes is None else tops_of_boxes(intrinsics, boxes)
    return Trajectory(time_s=trajectory.time_s, uv=trajectory.uv, top_v=tops)


def _shifts(case: ProtocolCase) -> tuple[float, float]:
    """Whole seconds to add to the times before and after the knock: the last track ends now."""
    spans = [
        (min(float(t.time_s[0]) for t in part), max(float(t.time_s[-1]) for t in part))
        for part in (case.reference, case.seen)
    ]
    seen_shift = math.floor(time.time()) - math.ceil(spans[1][1])
    gap_s = math.ceil(spans[0][1]) + _GAP_S
    return math.floor(spans[1][0]) + seen_shift - gap_s, float(seen_shift)


def _post(
    http: httpx.Client,
    camera_id: str,
    tracks: Sequence[Trajectory],
    prefix: str,
    shift_s: float,
    intrinsics: Intrinsics,
) -> int:
    """Post tracks in their order, with boxes where they have them; returns lost upper edges."""
    bodies, lost = [], 0
    for number, track in enumerate(tracks):
        times = (track.time_s + shift_s).tolist()
        boxes = boxes_of(track, intrinsics)
        rows = (track.uv if boxes is None else boxes).tolist()
        form = "points" if boxes is None else "boxes"
        points = [[t, *row] for t, row in zip(times, rows, strict=True)]
        bodies.append({"id": f"{prefix}{number}", form: points})
        if track.top_v is not None:
            carried = tops_carried(track, intrinsics).top_v
            assert carried is not None
            lost += int((np.isfinite(track.top_v) & ~np.isfinite(carried)).sum())
    for at in range(0, len(bodies), _BATCH_TRACKS):
        body = {"source": _SOURCE, "tracks": bodies[at : at + _BATCH_TRACKS]}
        answer = http.post(f"/cameras/{camera_id}/tracks", json=body)
        answer.raise_for_status()
        refused = answer.json()["rejected"]
        assert not refused, refused
    return lost


def _wait(
    http: httpx.Client,
    camera_id: str,
    done: Callable[[dict[str, Any]], bool],
    tell: Callable[[dict[str, Any]], None],
) -> dict[str, Any]:
    end = time.monotonic() + _LONGEST_S
    while time.monotonic() < end:
        answer = http.get(f"/cameras/{camera_id}/pose")
        answer.raise_for_status()
        pose: dict[str, Any] = answer.json()
        tell(pose)
        if done(pose):
            return pose
        time.sleep(_POLL_S)
    raise TimeoutError(f"{camera_id}: nothing came within {_LONGEST_S:g} s: {pose['reason']}")


def _covers(pose: dict[str, Any], newest_s: float) -> bool:
    """True where an estimate after the reference has the newest track in it."""
    if not pose["to"]:
        return False
    return datetime.fromisoformat(pose["to"]).timestamp() >= newest_s - 1e-3
