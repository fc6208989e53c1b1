"""The Python of the docs runs as it stands there, on a MOT text of walkers."""

import json
import math
import re
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest

import surefoot
from studies.simulation.lanes import SiteConfig
from tests.models.sites import KNOCKED, LENS, PRIOR, near, tracks_of

DOCS = Path(__file__).parents[1] / "docs"


def code(page: str = "start.md") -> str:
    """The example of a page."""
    (found,) = re.findall(r"```python\n(.*?)```", (DOCS / page).read_text(), re.DOTALL)
    return found


def test_each_example_has_a_test():
    pages = {page for page in DOCS.rglob("*.md") if "```python" in page.read_text()}
    tested = {"start.md": __file__, "guides/trackers.md": "tests/surefoot/test_client.py"}
    assert {str(page.relative_to(DOCS)) for page in pages} == set(tested)


def mot_lines(tracks) -> list[str]:
    """Boxes half a metre wide of 1.7 m, whose feet are those of the tracks; 25 frames a second."""
    lines = []
    for number, track in enumerate(tracks, start=1):
        for time_s, (u, v) in zip(track.time_s, track.uv, strict=True):
            box = f"{u + 1 - 20:.3f},{v + 1 - 100:.3f},40,100"
            lines.append(f"{round(time_s * 25)},{number},{box},1,-1,-1,-1")
    return lines


def test_ten_lines_learn_a_site_and_find_a_knock(tmp_path, monkeypatch, capsys):
    config = SiteConfig(aside_m=0.8, standing_share=0.0)
    known, after = tracks_of(3, (PRIOR, 200), (KNOCKED, 80), config=config)
    lines = mot_lines([*known, *after])
    shuffled = np.random.default_rng(0).permutation(lines)  # trackers write frame by frame
    (tmp_path / "tracks.txt").write_text("\n".join(shuffled))
    camera = {"intrinsics": asdict(LENS), "prior_pose": asdict(surefoot.Pose.of(PRIOR))}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    exec(compile(code(), "docs/start.md", "exec"), names)  # noqa: S102
    pose = names["result"].pose.in_radians
    assert names["result"].probability > 0.99
    assert (np.abs(near(pose) - near(KNOCKED)) < [0.9, 0.9, 0.6]).all(), pose
    assert pose.heading_rad == pytest.approx(PRIOR.heading_rad, abs=math.radians(1.5))
    printed = capsys.readouterr().out
    assert printed.startswith("True moved with a probability of 99.9%: tilt ")
    told = dict(re.findall(r"^(\w+): ([\d.-]+ to [\d.-]+)$", printed, re.MULTILINE))
    assert set(told) == {"tilt_deg", "roll_deg", "height_m", "heading_deg"}
    low, high = map(float, told["tilt_deg"].split(" to "))
    assert low < math.degrees(pose.tilt_rad) < high < low + 4
    assert surefoot.read_site("corner.site").camera == names["camera"]


def test_it_is_about_ten_lines():
    statements = [line for line in code().splitlines() if line.strip()]
    assert len(statements) <= 16
