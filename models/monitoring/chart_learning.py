"""Learn a camera's drift chart of tracks at its prior pose."""

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from models.monitoring.chart import (
    FEWEST,
    KNOCKS,
    RUN,
    DriftChart,
    highest,
    ratios_of,
)
from models.monitoring.group_scores import SCORES, Usual, scores_at
from models.paths.folds import Fold, Folds
from models.paths.likelihood import walkers_of
from models.paths.reference import candidate_of
from models.paths.turn_detection import groups_in_time
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.reference.learning import relearned
from models.walking.speed_reference import SpeedReference

_ENOUGH = 400  # walking groups that the answers to knocks are learned of, to some 4 %
_RIDGE = 0.05  # of each score's variance is its own, so that no direction is too good
# Walking groups after one another that the bootstrap keeps together: people share their quarter of
# an hour, and runs of 16 are held against a knock. Of fewer, recorded days alarm twice as often.
_BLOCK = 24
_BLOCKS = 12  # at least, of a reference
_RUNS = 100
_LEAST_SHRUNK = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class _Asked:
    """Scores (P, 14) of groups left out, and when each was last seen (P,).

    Of some of these, `before` (Q, 14) are the scores and `knocked` (K, Q, 14) those after knocks.
    """

    still: Array
    times: npt.NDArray[np.int64]
    before: Array
    knocked: Array


def learn_chart(
    observations: Observations,
    prior: CameraPose,
    site: SpeedReference,
    folds: Folds,
    seed: int,
) -> DriftChart | None:
    """The chart of a site; None where fewer than 12 walking groups have scores.

    Each quarter of the walking groups is scored by what the others say is usual, and some of them
    again as a camera that has been knocked would see them. How high the statistic gets by chance is
    learned by bootstrap: what is taken for usual, the people that there really are, and runs of
    these in blocks are all drawn anew.

    Args:
        observations: of the tracks, in the order of their ends.
        prior: where the camera stood.
        site: how people walk, learned of these or of other tracks.
        folds: the quarters and the maps of the others.
        seed: of the bootstrap.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(observations)
    asked: list[_Asked] = []
    wanted = _ENOUGH
    for fold in folds.each:
        asked.append(_asked(observations, prior, site, fold, wanted))
        wanted -= len(asked[-1].before)
    known = sum(len(part.still) for part in asked)
    if known < FEWEST:
        return None
    order = np.argsort(np.concatenate([part.times for part in asked]), kind="stable")
    scores = np.concatenate([part.still for part in asked])[order]
    middle = np.median(scores, axis=0)
    width = SD_OF_MEDIAN_DEVIATION * np.median(np.abs(scores - middle), axis=0) + 1e-9
    chart = DriftChart(
        speed_reference=relearned(observations, prior, site),
        middle=middle,
        width=width,
        mean=np.zeros(SCORES),
        covariance=np.eye(SCORES),
        responses=np.zeros((SCORES, len(KNOCKS))),
        walking_groups=float(known),
        typical=0.0,
        tail=1.0,
    )
    bounded = chart.bounded(scores)
    before = chart.bounded(np.concatenate([part.before for part in asked]))
    after = chart.bounded(np.concatenate([part.knocked for part in asked], axis=1))
    chart = replace(
        chart,
        mean=bounded.mean(axis=0),
        covariance=_covariance(bounded),
        responses=(after.mean(axis=1) - before.mean(axis=0)).T,
    )
    reached = _reached(chart, bounded, np.random.default_rng(seed))
    typical = float(np.median(reached))
    return replace(
        chart, typical=typical, tail=max(float(reached[reached > typical].mean() - typical), 1.0)
    )


def _asked(
    observations: Observations, prior: CameraPose, site: SpeedReference, fold: Fold, wanted: int
) -> _Asked:
    """The scores of a fold's groups; of so many as are wanted, after knocks too."""
    seen = of_tracks(observations, fold.test_idx)
    speed_reference = relearned(of_tracks(observations, fold.train_idx), prior, site)
    usual = Usual(prior=prior, speed_reference=speed_reference, paths=fold.paths)
    _, _, last = groups_in_time(fold.walkers)
    still = scores_at(seen, fold.walkers, usual, np.zeros(4))
    # Evenly over the time: mornings and evenings answer differently.
    some = np.linspace(0, last.size - 1, min(last.size, wanted)).astype(np.int64)
    answers = np.zeros((1 + len(KNOCKS), 0, SCORES))
    if some.size:
        group_idx = fold.walkers.group_idx
        theirs = np.flatnonzero(np.isin(group_idx, group_idx[last[some]]))
        few = of_tracks(seen, theirs)
        # Who walks with whom hangs on who else is there: the groups stay what they were.
        walkers = replace(walkers_of(few, candidate_of(prior)), group_idx=group_idx[theirs])
        # A camera that has moved on sees people as one that stays would from a little back.
        moves = [(np.zeros(4), 1.0), *((-knock.step, knock.stretch) for knock in KNOCKS)]
        answers = np.stack([scores_at(few, walkers, usual, *move) for move in moves])
    return _Asked(still=still, times=fold.test_idx[last], before=answers[0], knocked=answers[1:])


def _covariance(scores: Array) -> Array:
    """The covariance (14, 14) of scores (P, 14), its correlations shrunk as few groups demand.

    Source: Schäfer and Strimmer 2005, target "diagonal, unequal variance".
    """
    count = len(scores)
    sd = scores.std(axis=0, ddof=1) + 1e-9
    unit = (scores - scores.mean(axis=0)) / sd
    products = np.einsum("pi,pj->pij", unit, unit)
    correlation = products.sum(axis=0) / (count - 1)
    variance = products.var(axis=0) * count**2 / (count - 1) ** 3
    beside = ~np.eye(len(sd), dtype=bool)
    shrunk = variance[beside].sum() / max(float((correlation[beside] ** 2).sum()), 1e-9)
    shrunk = float(np.clip(shrunk, _LEAST_SHRUNK, 1.0))
    own = (1 + _RIDGE) * np.eye(len(sd))
    return np.asarray(((1 - shrunk) * correlation * beside + own) * np.outer(sd, sd))


def _reached(chart: DriftChart, scores: Array, rng: np.random.Generator) -> Array:
    """The highest statistic of each of so many runs of a still camera."""
    ratios = ratios_of(chart)
    count = len(scores)
    reached = np.empty(_RUNS)
    for run in range(_RUNS):
        taken_for_usual = scores[drawn_blocks(rng, count, count)].mean(axis=0)
        people = scores[drawn_blocks(rng, count, count)]
        walked = people[drawn_blocks(rng, count, RUN)]
        reached[run] = highest(ratios, walked - taken_for_usual)
    return reached


def drawn_blocks(rng: np.random.Generator, count: int, wanted: int) -> npt.NDArray[np.int64]:
    """Indices (wanted,) of walking groups, some after one another at a time."""
    block = min(_BLOCK, -(-count // _BLOCKS))
    starts = rng.integers(0, count, -(-wanted // block))
    return np.asarray(((starts[:, None] + np.arange(block)).ravel() % count)[:wanted])
