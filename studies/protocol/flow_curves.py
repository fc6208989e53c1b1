"""Curves of the fused pose's error over the number of reference tracks, and of new ones."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.pose import Observations, learn_site, observe
from models.tracks.observations import of_tracks
from models.tracks.scenes import Scene
from studies.protocol.cases import (
    PANNED,
    OffsetRange,
    ProtocolCase,
    draw_case,
    judge_answer,
)
from studies.protocol.flow_runs import served_answer

_SEED = 0
Varied = Literal["reference", "seen"]


@dataclass(frozen=True, slots=True, kw_only=True)
class CurvePoint:
    """The whole angle's error from so many reference or new tracks, and all of the other.

    `asked` is the number wanted; None for all there are.
    """

    varied: Varied
    asked: int | None
    tracks: int
    angle_error_deg: float


def flow_errors(
    scene: Scene, seed: int, counts: Sequence[int], offset_range: OffsetRange = PANNED
) -> list[CurvePoint]:
    """The fused pose's error for some numbers of reference tracks, and of new tracks.

    Numbers beyond what the case has are left out, and those that tell too little for any estimate.
    The tracks of a smaller number are among those of a larger one.
    """
    case = draw_case(scene, seed, offset_range)
    known, seen = (
        observe(tracks, case.intrinsics, case.prior_pose) for tracks in (case.reference, case.seen)
    )
    points = []
    for some in _parts(known, counts, seed):
        try:
            error = _error_deg(case, some, [seen])[0]
        except TooFewTrajectoriesError:
            continue
        asked = None if some is known else some.tracks
        points.append(_point("reference", asked, some, error))
    parts = _parts(seen, counts, seed)
    try:
        errors = _error_deg(case, known, parts)
    except TooFewTrajectoriesError:
        return points
    points += [
        _point("seen", None if some is seen else some.tracks, some, error)
        for some, error in zip(parts, errors, strict=True)
    ]
    return points


def _parts(whole: Observations, counts: Sequence[int], seed: int) -> list[Observations]:
    order = np.random.default_rng(seed).permutation(whole.tracks)
    few = [count for count in counts if count < whole.tracks]
    return [*(of_tracks(whole, np.sort(order[:count])) for count in few), whole]


def _error_deg(
    case: ProtocolCase, known: Observations, after: Sequence[Observations]
) -> list[float]:
    """The whole angle off, for each set of new tracks, with one reference for all."""
    site = learn_site(known, case.intrinsics, case.prior_pose, seed=_SEED, chart=False)
    answers = [served_answer(seen, site) for seen in after]
    return [judge_answer(case, "fused", answer, 0.0).angle_error_deg for answer in answers]


def _point(varied: Varied, asked: int | None, some: Observations, error: float) -> CurvePoint:
    return CurvePoint(varied=varied, asked=asked, tracks=some.tracks, angle_error_deg=error)
