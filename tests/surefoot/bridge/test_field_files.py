"""Small files from the field that were read as something else, or not at all."""

import os
from pathlib import Path

import pytest

from surefoot.bridge.feeds import Topics, read_feeds
from tests.conftest import SCENES

FIELD = Path(os.environ.get("SUREFOOT_TEST_FIELD", SCENES.parent / "field"))
FEEDS = "axis:cams/+/scene,onvif-normalised:onvif/+/x"
TOPICS = Topics(prefix="surefoot", frigate=None, cameras={}, feeds=read_feeds(FEEDS))
# By the file: topic, id, class, time, box in shares.
FILES = {
    "axis_v0_beta.json": ("cams/a/scene", "3", "Human", 1795766400.1, (0.1, 0.3, 0.2, 0.6)),
    "onvif_wrapped.json": ("onvif/a/x", "5", "Human", 1795766400.0, (0.25, 0.25, 0.3, 0.6)),
    "onvif_prefix_not_declared.xml": (
        *("onvif/a/x", "7", "Human", 1795766400.5),
        (0.65, 0.25, 0.7, 0.75),
    ),
}


@pytest.mark.skipif(not FIELD.is_dir(), reason=f"no files from the field in {FIELD}")
@pytest.mark.parametrize("name", FILES)
def test_file_from_the_field_is_read_with_its_values(name):
    topic, track_id, label, time_s, box = FILES[name]
    _, (found,) = TOPICS.read(topic, (FIELD / name).read_bytes())
    assert (found.camera, found.track_id, found.label) == ("a", track_id, label)
    assert found.time_s == pytest.approx(time_s, abs=1e-6)
    assert found.box == pytest.approx(box)
