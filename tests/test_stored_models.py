"""What was stored of a site is read to the bit, and stored again as the same bytes.

The files of `golden/stored_models` were written by `python -m tests.test_stored_models`: made anew
when a format changes before the first release, and never after it.
"""

from pathlib import Path

import pytest

from models.monitoring.chart import chart_from_bytes, chart_to_bytes
from models.paths.reference import paths_from_bytes, paths_to_bytes
from models.pose import (
    WalkConfig,
    estimate_pose,
    learn_site,
    observe,
    warm_start_from_bytes,
    warm_start_to_bytes,
)
from models.tracks.trajectory import by_end
from models.walking.reference_learning import learn_speed_reference
from models.walking.speed_reference import reference_from_bytes, reference_to_bytes
from tests.models.sites import LENS, PRIOR, tracks_of

GOLDEN = Path(__file__).parent / "golden" / "stored_models"
FORMATS = {
    "speed_reference": (reference_from_bytes, reference_to_bytes),
    "speed_reference_without_boxes": (reference_from_bytes, reference_to_bytes),
    "paths": (paths_from_bytes, paths_to_bytes),
    "chart": (chart_from_bytes, chart_to_bytes),
    "warm_start": (warm_start_from_bytes, warm_start_to_bytes),
}


def made():
    """The bytes of all formats, by name, of what 60 people of a simulated site are learned as."""
    boxed, bare = (_observed(boxes=boxes) for boxes in (True, False))
    site = learn_site(boxed, LENS, PRIOR)
    last = estimate_pose(boxed, site).warm_start
    assert site.paths is not None
    assert site.chart is not None
    assert last is not None
    without_boxes = learn_speed_reference(bare, PRIOR, WalkConfig(), 0)
    return {
        "speed_reference": reference_to_bytes(site.speed_reference),
        "speed_reference_without_boxes": reference_to_bytes(without_boxes),
        "paths": paths_to_bytes(site.paths),
        "chart": chart_to_bytes(site.chart),
        "warm_start": warm_start_to_bytes(last),
    }


def _observed(*, boxes):
    (tracks,) = tracks_of(3, (PRIOR, 60), boxes=boxes)
    return observe(by_end(tracks), LENS, PRIOR)


@pytest.mark.parametrize("name", FORMATS)
def test_what_was_stored_is_read_and_stored_again_as_the_same_bytes(name):
    read, store = FORMATS[name]
    data = (GOLDEN / f"{name}.bin").read_bytes()
    assert store(read(data)) == data


def test_what_was_stored_says_what_it_said():
    read = {name: FORMATS[name][0]((GOLDEN / f"{name}.bin").read_bytes()) for name in FORMATS}
    assert read["speed_reference"].walking_speed_mps == pytest.approx(1.3, abs=0.1)
    assert read["speed_reference"].stature_m == pytest.approx(1.7, abs=0.1)
    assert read["speed_reference_without_boxes"].statures is None
    assert read["paths"].people == pytest.approx(60, abs=10)
    assert read["chart"].speed_reference.tracks == read["speed_reference"].tracks
    assert read["warm_start"].prior == PRIOR


if __name__ == "__main__":
    for name, data in made().items():
        (GOLDEN / f"{name}.bin").write_bytes(data)
