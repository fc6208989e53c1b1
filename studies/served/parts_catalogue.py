"""The parts that can be switched off, each by what stands in its place."""

import importlib
import inspect
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from models.paths.map_learning import Bandwidths

_ROOT = Path(__file__).parents[2]
_FEW_AND_FAR = ("few", "far")
_COARSE = Bandwidths(place_m=1.0, direction_kappa=6.0)
_SEARCH = (
    "ChangeSearch", "search_change", "_confirmed", "_still_there", "_suspicion", "_suspects",
    "_moved_by_speeds", "_moved_by_places",
)  # fmt: skip
_TESTS_OF_PLACES = ("StillScores", "learn_scores", "moved_within", "_highest", "_squared")


def _none_of_points(uv_or_time: Any, *_: Any) -> Any:
    return np.zeros(len(uv_or_time), dtype=bool)


def _alone(trajectories: Any, *_: Any) -> Any:
    return np.full(len(trajectories), -1, dtype=np.int64)


def _each_by_itself(time_s: Any, owner_idx: Any, place: Any, way: Any, owners: int) -> Any:
    return np.arange(owners)


def _nothing(size: int) -> Callable[..., Any]:
    return lambda *_, **__: np.zeros((size, size))


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A part: where it is called (`module:name`), what stands there instead, and its source.

    `faults` are the protocol's faults, and tables of other cases, that it is there for; `source`
    names files, and functions as `module:name`, that would go with it.
    """

    words: str
    off: tuple[tuple[str, Any], ...]
    source: tuple[str, ...]
    faults: tuple[str, ...] = ()

    @property
    def lines(self) -> int:
        """Lines that would go with it."""
        return sum(_lines(each) for each in self.source)

    @contextmanager
    def switched_off(self) -> Iterator[None]:
        """Have it replaced in this process.

        Raises:
            AttributeError: what it replaces is not there any more.
        """
        kept = []
        try:
            for place, replacement in self.off:
                owner, name = _owner(place)
                kept.append((owner, name, getattr(owner, name)))
                setattr(owner, name, replacement)
            yield
        finally:
            for owner, name, before in reversed(kept):
                setattr(owner, name, before)


def _owner(place: str) -> tuple[Any, str]:
    module, _, path = place.partition(":")
    owner: Any = importlib.import_module(module)
    *classes, name = path.split(".")
    for each in classes:
        owner = getattr(owner, each)
    return owner, name


def _lines(source: str) -> int:
    if ":" not in source:
        return len((_ROOT / source).read_text().splitlines())
    owner, name = _owner(source)
    found = getattr(owner, name)
    return len(inspect.getsource(getattr(found, "__wrapped__", found)).splitlines())


PARTS: dict[str, Part] = {
    "hidden feet": Part(
        words="boxes whose feet are hidden are found by their heights",
        off=(("models.tracks.walks:short_boxes", _none_of_points),),
        source=("models.tracks.hidden_feet:short_boxes", "models.tracks.hidden_feet:_off_the_line"),
        faults=("hidden-feet",),
    ),
    "jumps": Part(
        words="points that jump away and back are left out",
        off=(("models.tracks.walks:jumped", _none_of_points),),
        source=("models.tracks.hidden_feet:jumped", "models.tracks.hidden_feet:_middle_of_five"),
        faults=("jumps", "jumps-later"),
    ),
    "pieces": Part(
        words="pieces of one walk are put together",
        off=(("models.tracks.walks:link_pieces", _alone),),
        source=("models/tracks/linking.py",),
        faults=("fragments",),
    ),
    "walking groups": Part(
        words="people who walk together count once",
        off=(
            ("models.paths.likelihood:walking_groups_of", _each_by_itself),
            ("models.walking.measures:walking_groups_of", _each_by_itself),
        ),
        source=("models.walking.measures:walking_groups_of",),
    ),
    "noise of directions": Part(
        words="information that is noise of directions is taken off",
        off=(("models.walking.fit:noise_information", _nothing(3)),),
        source=(
            "models.walking.fit:noise_information",
            "models.walking.fit:corrected_covariance",
            "models.walking.fit:information_of_noise",
        ),
    ),
    "freedom of the field": Part(
        words="how freely speeds vary by place is chosen by halves",
        off=(
            (
                "models.walking.reference_learning:_cross_validated",
                lambda observations, prior, blank, seed: blank,
            ),
        ),
        source=("models.walking.reference_learning:_cross_validated",),
        faults=_FEW_AND_FAR,
    ),
    "bandwidths": Part(
        words="the map's bandwidths are chosen by people left out",
        off=(("models.paths.folds:best_bandwidths", lambda *_: _COARSE),),
        source=("models.paths.map_learning:best_bandwidths",),
        faults=_FEW_AND_FAR,
    ),
    "path test": Part(
        words="a map that does not fit has no part",
        off=(("models.paths.path_tests:UsualFit.has_changed", lambda *_: False),),
        source=("models.paths.path_tests:UsualFit.has_changed",),
        faults=_FEW_AND_FAR,
    ),
    "Birge ratio": Part(
        words="speeds and places that disagree are less sure",
        off=(("models.pose.fusion:birge_ratio", lambda *_: 1.0),),
        source=("models.pose.modes:birge_ratio",),
        faults=_FEW_AND_FAR,
    ),
    "other modes": Part(
        words="other poses that explain the tracks widen the covariance",
        off=(("models.pose.fusion:covariance_between", _nothing(4)),),
        source=("models.pose.modes:covariance_between",),
        faults=_FEW_AND_FAR,
    ),
    "change search": Part(
        words="a window begins anew at a change",
        off=(("models.pose.estimating:_suspects", lambda *_: iter(())),),
        source=(
            *(f"models.pose.estimating:{name}" for name in _SEARCH),
            "models/pose/change_point.py",
            *(f"models.paths.path_tests:{name}" for name in _TESTS_OF_PLACES),
        ),
        faults=("midway",),
    ),
}
