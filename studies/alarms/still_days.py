"""Recorded days of cameras that stand: what alarms there, and how much people's habits move.

`python -m studies still-days RECORDING... [--alarms-a-year 1]`: after a reference
of 1,000 people, and after others that begin later, the chart reads everybody who comes. The same
people are then looked at as a camera would that has just been moved, to tell how many walking
groups it takes. Nothing grows, and nobody says that a camera is where it should be.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.durations import DAY_S
from models.geometry.pose import array_of
from models.geometry.rotation import Array
from models.monitoring.chart import OFFSET_GRID, DriftChart, Ratios, ratios_of, slope_of, trace
from models.monitoring.config import RUN
from models.monitoring.group_scores import score_groups, scores_at
from models.paths.likelihood import walkers_of
from models.pose import learn_site, observe
from models.tracks.observations import of_tracks
from models.tracks.scenes import Scene
from models.tracks.trajectory import by_end
from studies.protocol.partings import first_seen
from studies.recordings import load_recording

_REFERENCE = 1000  # tracks
_BEGIN = (0, 1500, 3000)
_FEWEST = 600  # tracks after the reference
_BLOCK = 100  # walking groups
_YEAR_S = 365.25 * DAY_S
_LEAD, _WAIT, _MOMENTS, _MOVED = 150, 350, 4, 2500
_DEG = float(np.radians(1))
_NUMBERS = ("tilt", "roll", "height", "pan", "pace")
_PERCENT_OR_DEG = np.array([1 / _DEG, 1 / _DEG, 100, 1 / _DEG, 100])
_ROUNDS = 300
MOVES = {
    f"{name} {sign * size:+g} {unit}": (parameter, sign * size * of_unit)
    for parameter, name, size, unit, of_unit in (
        (3, "pan", 2.0, "deg", _DEG),
        (0, "tilt", 1.5, "deg", _DEG),
        (1, "roll", 2.0, "deg", _DEG),
        (2, "height", 10.0, "%", 0.01),
    )
    for sign in (1, -1)
}


@dataclass(frozen=True, slots=True, kw_only=True)
class StillDay:
    """Chart of people before a camera that stands.

    `excess` is the highest statistic in units of the level, by an offset of the grid,
    `offset_idx`; the first alarm was after `alarm_after` tracks, None where there was none.
    `habits` (5,) are standard deviations of tilt, roll, log height, heading and log pace among
    blocks of 100 walking groups, beyond chance. `delays` are how many walking groups each move
    took at each of some moments; infinite where it took more than were waited for.
    """

    camera: str
    begin: int
    tracks: int
    excess: float
    offset_idx: int
    alarm_after: int | None
    habits: Array
    delays: dict[str, list[float]]


def still_days(scene: Scene, alarms_a_year: float) -> Iterator[StillDay]:
    """Charts of a camera after references that begin with one person or another."""
    prior, lens = scene.true_pose, scene.intrinsics
    tracks = [track.trajectory for track in first_seen(scene, scene.tracks, prior, None)]
    tracks.sort(key=lambda track: float(track.time_s[0]))
    for begin in _BEGIN:
        known = by_end(tracks[begin : begin + _REFERENCE])
        learned_s = max((float(track.time_s[-1]) for track in known), default=0.0)
        rest = [t for t in tracks[begin + _REFERENCE :] if t.time_s[0] > learned_s]
        if len(rest) < _FEWEST:
            return
        site = learn_site(observe(known, lens, prior), lens, prior)
        if site.chart is None or site.paths is None:
            continue
        chart, usual = site.chart, site.usual(site.paths, site.chart)
        seen = observe(by_end(rest), lens, prior)
        scores = score_groups(seen, usual)
        groups_a_year = len(scores.last) * _YEAR_S / (float(rest[-1].time_s[0]) - learned_s)
        level = chart.level(RUN * alarms_a_year / groups_a_year)
        apart = chart.bounded(scores.values) - chart.mean
        ratios = ratios_of(chart)
        path = trace(ratios, apart)
        highest = int(path.statistic.argmax())
        over = np.flatnonzero(path.statistic > level)
        first = of_tracks(seen, np.arange(min(seen.tracks, _MOVED)))
        walkers = walkers_of(first, array_of(prior))
        delays = {}
        for name, (parameter, size) in MOVES.items():
            # A camera that has moved on sees people as one that stays would from a little back.
            moved = scores_at(first, walkers, usual, -size * np.eye(4)[parameter])
            delays[name] = list(_delays(ratios, apart, chart.bounded(moved) - chart.mean, level))
        yield StillDay(
            camera=scene.scene_id,
            begin=begin,
            tracks=len(rest),
            excess=float(path.statistic[highest]) / level,
            offset_idx=int(path.offset_idx[highest]),
            alarm_after=int(scores.last[over[0]]) if over.size else None,
            habits=habits_of(chart, apart),
            delays=delays,
        )


def _delays(ratios: Ratios, still: Array, moved: Array, level: float) -> Iterator[float]:
    """Delays of a move at some moments, in walking groups after others before a still camera."""
    for begin in np.linspace(0, max(len(moved) - _WAIT, 0), _MOMENTS).astype(int):
        lead = still[max(begin - _LEAD, 0) : begin]
        both = np.concatenate([lead, moved[begin : begin + _WAIT]])
        over = np.flatnonzero(trace(ratios, both).statistic[len(lead) :] > level)
        yield float(over[0] + 1) if over.size else np.inf


def habits_of(chart: DriftChart, apart: Array) -> Array:
    """Variances (5,) of blocks of 100 walking groups among one another, as moves, beyond chance.

    Source: Laird and Ware 1982, the variances of random effects by EM.

    Args:
        chart: of the camera.
        apart: bounded scores (T, 14) of walking groups, less the chart's mean.
    """
    count = len(apart) // _BLOCK
    means = apart[: count * _BLOCK].reshape(count, _BLOCK, -1).mean(axis=1)
    slopes = np.stack([slope_of(chart, number) for number in range(len(_NUMBERS))], axis=1)
    weights = np.linalg.solve(chart.covariance / _BLOCK, slopes)
    known, shown = slopes.T @ weights, means @ weights
    variance = np.full(len(_NUMBERS), 0.03**2)
    for _ in range(_ROUNDS):
        covariance = np.linalg.inv(known + np.diag(1 / variance))
        variance = ((shown @ covariance) ** 2).mean(axis=0) + np.diag(covariance)
    return np.asarray(np.sqrt(variance))


def report_lines(days: Sequence[StillDay]) -> Iterator[str]:
    """Lines: each reference; alarms among all; habits; delays."""
    for day in days:
        offset = OFFSET_GRID[day.offset_idx]
        habits = ", ".join(f"{each:.2f}" for each in day.habits * _PERCENT_OR_DEG)
        yield (
            f"{day.camera:20} from {day.begin:4}, {day.tracks:4} tracks: "
            f"highest {day.excess:.2f} of the level ({_NUMBERS[offset.parameter]}), "
            f"alarm after {day.alarm_after}; habits {habits} (deg, deg, %, deg, %)"
        )
    alarms = sum(day.alarm_after is not None for day in days)
    yield f"alarms: {alarms} of {len(days)}, while still"
    squares = np.array([day.habits**2 for day in days])
    for name, habits in (
        ("in the root mean square", np.sqrt(squares.mean(axis=0))),
        ("in the median", np.sqrt(np.median(squares, axis=0))),
    ):
        each = ", ".join(f"{habit:.2f}" for habit in habits * _PERCENT_OR_DEG)
        yield f"habits {name}: {each} (tilt, roll in deg, height in %, pan in deg, pace in %)"
    for move in MOVES:
        taken = [delay for day in days for delay in day.delays[move]]
        middle, most = np.quantile(taken, (0.5, 0.8), method="higher")
        yield f"{move}: {middle:.0f} walking groups in the median, {most:.0f} in 80 %"


def main(arguments: Sequence[str]) -> None:
    """Print what alarms before still cameras, and how soon moved ones do."""
    parser = argparse.ArgumentParser("studies still-days", description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--alarms-a-year", type=float, default=1.0)
    chosen = parser.parse_args(arguments)
    days: list[StillDay] = []
    for folder in chosen.recordings:
        for scene in load_recording(folder):
            days += still_days(scene, chosen.alarms_a_year)
            sys.stderr.write(f"{scene.scene_id} is done\n")
    sys.stdout.write("\n".join(report_lines(days)) + "\n")
