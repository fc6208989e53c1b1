"""Learn a camera's drift chart of tracks at its prior pose."""

from dataclasses import dataclass, replace

import numpy as np

from models.geometry.pose import CameraPose, array_of
from models.geometry.rotation import Array, Index
from models.monitoring import config
from models.monitoring.chart import OFFSET_GRID, DriftChart, highest, ratios_of
from models.monitoring.group_scores import SCORES, Usual, score_tracks, scores_at
from models.paths.folds import Fold, Folds
from models.paths.likelihood import walkers_of
from models.quantiles import SD_OF_MEDIAN_DEVIATION
from models.tracks.observations import Observations, check_in_time, of_tracks
from models.walking.reference_learning import relearned
from models.walking.speed_reference import SpeedReference


@dataclass(frozen=True, slots=True, kw_only=True)
class _FoldScores:
    """Scores (P, 14) of groups left out, and when each was last seen (P,).

    Of some of these, `before` (Q, 14) are the scores and `offset` (K, Q, 14) those after offsets.
    """

    still: Array
    times: Index
    before: Array
    offset: Array


def learn_chart(
    observations: Observations,
    prior: CameraPose,
    site: SpeedReference,
    folds: Folds,
    seed: int,
) -> DriftChart | None:
    """The chart of a site; None where fewer than 12 walking groups have scores, or all are alike.

    Each quarter of the walking groups is scored by what the others say is usual, and some of them
    again as a camera that has moved would see them. How high the statistic gets by chance is
    learned by bootstrap: what is taken for usual, the people that there really are, and runs of
    these in blocks are all drawn anew.

    `observations` are in the order of the tracks' ends, `site` is learned of these or of others.

    Raises:
        ShapeError: tracks that are not in the order of their ends.
    """
    check_in_time(observations)
    scored: list[_FoldScores] = []
    wanted = config.RESPONSE_GROUPS
    for fold in folds.each:
        scored.append(_fold_scores(observations, prior, site, fold, wanted))
        wanted -= len(scored[-1].before)
    count = sum(len(part.still) for part in scored)
    if count < config.FEWEST_GROUPS:
        return None
    order = np.argsort(np.concatenate([part.times for part in scored]), kind="stable")
    scores = np.concatenate([part.still for part in scored])[order]
    middle = np.median(scores, axis=0)
    width = SD_OF_MEDIAN_DEVIATION * np.median(np.abs(scores - middle), axis=0) + 1e-9
    chart = DriftChart(
        speed_reference=relearned(observations, prior, site),
        middle=middle,
        width=width,
        mean=np.zeros(SCORES),
        covariance=np.eye(SCORES),
        responses=np.zeros((SCORES, len(OFFSET_GRID))),
        walking_groups=float(count),
        typical=0.0,
        tail=1.0,
    )
    bounded = chart.bounded(scores)
    before = chart.bounded(np.concatenate([part.before for part in scored]))
    after = chart.bounded(np.concatenate([part.offset for part in scored], axis=1))
    chart = replace(
        chart,
        mean=bounded.mean(axis=0),
        covariance=_covariance(bounded),
        responses=(after.mean(axis=1) - before.mean(axis=0)).T,
    )
    try:
        reached = _reached(chart, bounded, np.random.default_rng(seed))
    except np.linalg.LinAlgError:  # one walk over and over: nothing is known of chance
        return None
    typical = float(np.median(reached))
    return replace(
        chart, typical=typical, tail=max(float(reached[reached > typical].mean() - typical), 1.0)
    )


def _fold_scores(
    observations: Observations, prior: CameraPose, site: SpeedReference, fold: Fold, wanted: int
) -> _FoldScores:
    """The scores of a fold's groups; of so many as are wanted, after offsets too."""
    seen = of_tracks(observations, fold.test_idx)
    speed_reference = relearned(of_tracks(observations, fold.train_idx), prior, site)
    usual = Usual(prior=prior, speed_reference=speed_reference, paths=fold.paths)
    still = score_tracks(seen, usual, walkers=fold.walkers).groups
    last = still.last
    # Evenly over the time: mornings and evenings answer differently.
    some = np.linspace(0, last.size - 1, min(last.size, wanted)).astype(np.int64)
    answers = np.zeros((1 + len(OFFSET_GRID), 0, SCORES))
    if some.size:
        group_idx = fold.walkers.group_idx
        theirs = np.flatnonzero(np.isin(group_idx, group_idx[last[some]]))
        few = of_tracks(seen, theirs)
        # Who walks with whom hangs on who else is there: the groups stay what they were.
        walkers = replace(walkers_of(few, array_of(prior)), group_idx=group_idx[theirs])
        # A camera that has moved on sees people as one that stays would from a little back.
        moves = [(np.zeros(4), 1.0), *((-offset.step, offset.stretch) for offset in OFFSET_GRID)]
        answers = np.stack([scores_at(few, walkers, usual, *move) for move in moves])
    return _FoldScores(
        still=still.values, times=fold.test_idx[last], before=answers[0], offset=answers[1:]
    )


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
    shrunk = float(np.clip(shrunk, config.LEAST_SHRINKAGE, 1.0))
    own = (1 + config.RIDGE) * np.eye(len(sd))
    return np.asarray(((1 - shrunk) * correlation * beside + own) * np.outer(sd, sd))


def _reached(chart: DriftChart, scores: Array, rng: np.random.Generator) -> Array:
    """The highest statistic of each of so many runs of a still camera."""
    ratios = ratios_of(chart)
    count = len(scores)
    reached = np.empty(config.BOOTSTRAP_RUNS)
    for run in range(config.BOOTSTRAP_RUNS):
        taken_for_usual = scores[drawn_blocks(rng, count, count)].mean(axis=0)
        people = scores[drawn_blocks(rng, count, count)]
        walked = people[drawn_blocks(rng, count, config.RUN)]
        reached[run] = highest(ratios, walked - taken_for_usual)
    return reached


def drawn_blocks(rng: np.random.Generator, count: int, wanted: int) -> Index:
    """Indices (wanted,) of walking groups, some after one another at a time."""
    block = min(config.BLOCK, -(-count // config.LEAST_BLOCKS))
    starts = rng.integers(0, count, -(-wanted // block))
    return np.asarray(((starts[:, None] + np.arange(block)).ravel() % count)[:wanted])
