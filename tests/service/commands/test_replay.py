"""Real people: recorded scenes, where they lie beside the project; never copied into it."""

import json
import math
import os
import subprocess
import sys

import pytest

from models.tracks.scenes import load_scene
from tests.conftest import SCENES, path_to_small_trainings
from tests.running import wait_for

pytestmark = [
    pytest.mark.slow,
    pytest.mark.nightly,
    pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}"),
]


def surefoot(module: str, *arguments: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        timeout=280,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def averaged_of(service):
    """What the averaged estimator says, while the reference is being learned."""
    return service.http.get("/cameras/town-centre/pose").json()["estimates"].get("averaged")


@pytest.fixture(scope="session")
def offline(once):
    """What `python -m studies centred` says of a scene, by a small training, in its folder."""

    def make(folder):
        text = surefoot(
            "studies", "centred", str(SCENES / "town_centre"), "--epochs", "1", "--seeds", "0",
            "--speeds", "1.4", "--processes", "1", "--output", str(folder / "out.json"),
            "--plot", str(folder / "out.png"), PYTHONPATH=path_to_small_trainings(folder),
        )  # fmt: skip
        (folder / "printed.txt").write_text(text)

    return once("centred", make)


def test_a_replay_through_http_is_the_offline_evaluation(training_service, offline):
    service = training_service
    output = surefoot("service.cli", "replay", str(SCENES / "town_centre"), "--url", service.url)
    assert "142 tracks accepted, 0 known already, 14 rejected" in " ".join(output.split())
    served = wait_for(lambda: averaged_of(service), timeout_s=180)
    (run,) = json.loads((offline / "out.json").read_text())["runs"]
    assert served["tracks"] == run["tracks"]
    assert served["height_m"] == pytest.approx(run["height_m"], abs=1e-4)
    assert served["tilt_deg"] == pytest.approx(run["tilt_deg"], abs=1e-3)
    assert served["roll_deg"] == pytest.approx(run["roll_deg"], abs=1e-3)


def test_every_recorded_camera_can_be_loaded():
    for folder in sorted(SCENES.iterdir()):
        if folder.is_dir():
            scene = load_scene(folder)
            truth = json.loads((folder / "camera.json").read_text())["true_pose"]
            assert math.degrees(scene.true_pose.tilt_rad) == pytest.approx(truth["tilt_deg"])
            assert len(scene.tracks) > 20
