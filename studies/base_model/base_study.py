"""Study of the base model: alone, beside the joint and the fused pose, and as a factor of it.

By time, as `protocol --tables time`: the earlier people are the reference, the camera is
moved, the later ones walk before it; or by random halves of the people. Cases of one window share
its people, so that it is windows that are counted where two ways are held against one another.

    python -m studies base-study ../shared/scenes/*/ ../shared/long/atc_20121024
"""

import argparse
import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from models.errors import TooFewTrajectoriesError
from models.geometry.pose import plane_parameters_of
from models.geometry.rotation import Array
from models.quantiles import Z90
from models.tracks.scenes import Scene
from studies.protocol.cases import RANGES, Answer, ProtocolCase, draw_case
from studies.protocol.estimators import base_model, joint
from studies.protocol.flow_runs import fused
from studies.protocol.learned import learn_case
from studies.protocol.partings import HALVES_IN_TIME, Parting, Split
from studies.recordings import load_recording

_KNOCKS = ("still", "knock", "pan", "tilt-alone", "roll-alone", "height-alone", "pan-alone")
_LONG = 1500  # tracks; of longer recordings parts are taken
_PARTS = tuple(
    Parting(split=Split.TIME, reference_tracks=known, seen_tracks=seen)
    for known, seen in ((200, 100), (1000, 400))
)
_FACTOR = "fused x base model"
# As a factor its variances are so many times as large: it is of the same people, and real sites
# differ from simulated ones by more than it knows.
_INFLATED = 4.0
_UNITS = np.array([180 / math.pi, 180 / math.pi, 100.0])


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseOutcome:
    """One case, answered one way: errors of tilt, roll (deg) and height (per cent) (3,).

    `window` names the people that it shares with other cases, `covered` which 90 % intervals hold
    the truth, `seconds` the CPU time of the answer, less what is learned of the reference.
    """

    window: str
    way: str
    error: tuple[float, float, float]
    covered: tuple[bool, bool, bool]
    seconds: float

    @property
    def angle_deg(self) -> float:
        """Tilt and roll together, about."""
        return math.hypot(*self.error[:2])


def scene_outcomes(
    scene: Scene, seed: int, knocks: Sequence[str], split: Split
) -> Iterator[BaseOutcome]:
    """All cases of a scene; those of which the fused pose identifies nothing are left out."""
    partings: tuple[Parting, ...] = (Parting(split=split),)
    if split == Split.TIME and len(scene.tracks) > _LONG:
        partings = _PARTS
    for parting in partings:
        window = f"{scene.scene_id} {parting.reference_tracks or ''}".strip()
        if parting != HALVES_IN_TIME:  # else nothing is drawn but the knock
            window += f" {seed}"
        for knock in knocks:
            case = draw_case(scene, seed, RANGES[knock], parting)
            try:
                learned = learn_case(case)
            except TooFewTrajectoriesError:
                continue
            answers: dict[str, tuple[Answer, float]] = {}
            for way, ask in (("base model", base_model), ("joint", joint), ("fused", fused)):
                began_s = time.process_time()
                answers[way] = ask(learned), time.process_time() - began_s
            if not answers["fused"][0].identifiable:
                continue
            both = together(answers["fused"][0], answers["base model"][0])
            for way, (answer, seconds) in {**answers, _FACTOR: (both, 0.0)}.items():
                yield _judged(window, way, case, answer, seconds)


def together(served: Answer, other: Answer) -> Answer:
    """The product of two answers as Gaussians, the other one's variance inflated."""
    known = np.linalg.inv(served.covariance)
    added = np.linalg.inv(_INFLATED * other.covariance)
    covariance = np.linalg.inv(known + added)
    values = covariance @ (known @ served.values + added @ other.values)
    return Answer(values=values, covariance=covariance, tracks=served.tracks)


def _judged(
    window: str, way: str, case: ProtocolCase, answer: Answer, seconds: float
) -> BaseOutcome:
    off: Array = answer.values - plane_parameters_of(case.true_pose)
    covered = np.abs(off) <= Z90 * np.sqrt(np.diag(answer.covariance))
    tilt, roll, height = (float(each) for each in off * _UNITS)
    return BaseOutcome(
        window=window,
        way=way,
        error=(tilt, roll, height),
        covered=(bool(covered[0]), bool(covered[1]), bool(covered[2])),
        seconds=seconds,
    )


def report_lines(outcomes: Sequence[BaseOutcome]) -> Iterator[str]:
    """Lines: each way's errors; windows better and worse than fused; the worth of agreement."""
    ways = list(dict.fromkeys(outcome.way for outcome in outcomes))
    for way in ways:
        own = [outcome for outcome in outcomes if outcome.way == way]
        angles = np.quantile([outcome.angle_deg for outcome in own], (0.5, 0.9))
        heights = np.quantile([abs(outcome.error[2]) for outcome in own], (0.5, 0.9))
        covers = 100 * np.mean([outcome.covered for outcome in own], axis=0)
        yield (
            f"{way:20} {len(own):4} cases {angles[0]:5.2f} ({angles[1]:.1f}) deg, "
            f"{heights[0]:4.1f} ({heights[1]:.0f}) %; 90 % intervals hold "
            f"{covers[0]:3.0f}, {covers[1]:3.0f}, {covers[2]:3.0f} %; "
            f"{np.median([outcome.seconds for outcome in own]):.2f} CPU-s"
        )
    windows = list(dict.fromkeys(outcome.window for outcome in outcomes))
    for way in ways:
        pairs = [
            (_of_window(outcomes, window, way), _of_window(outcomes, window, "fused"))
            for window in windows
        ]
        better = np.sum([own < served for own, served in pairs], axis=0)
        yield (
            f"{way:20} nearer than fused in {better[0]} (angle) and {better[1]} (height) of "
            f"{len(pairs)} windows"
        )
    for window in windows:
        parts = ", ".join(
            "{} {:.2f} deg {:.1f} %".format(way, *_of_window(outcomes, window, way)) for way in ways
        )
        yield f"{window:28} {parts}"


def _of_window(outcomes: Sequence[BaseOutcome], window: str, way: str) -> Array:
    """Median errors (2,) of a window's cases: angle, height."""
    own = [each for each in outcomes if (each.window, each.way) == (window, way)]
    return np.median([(each.angle_deg, abs(each.error[2])) for each in own], axis=0)


def main(arguments: Sequence[str]) -> None:
    """Print how far off each way is, and how often it is nearer than what is served."""
    parser = argparse.ArgumentParser("studies base-study", description=__doc__)
    parser.add_argument("recordings", type=Path, nargs="+")
    parser.add_argument("--seeds", default="0", help="of knocks, halves, moments; with commas")
    parser.add_argument("--knocks", default=",".join(_KNOCKS))
    parser.add_argument("--split", type=Split, choices=list(Split), default=Split.TIME)
    chosen = parser.parse_args(arguments)
    outcomes: list[BaseOutcome] = []
    for folder in chosen.recordings:
        for scene in load_recording(folder):
            for seed in chosen.seeds.split(","):
                knocks = chosen.knocks.split(",")
                outcomes += scene_outcomes(scene, int(seed), knocks, chosen.split)
            sys.stderr.write(f"{scene.scene_id} is done\n")
    sys.stdout.write("\n".join(report_lines(outcomes)) + "\n")
