"""The same tracks come to the same state and alerts, however they were posted."""

import numpy as np
import pytest

from tests.conftest import CAMERA
from tests.service.street import KNOCKED, PRIOR, Street

REFERENCE, STILL, LATER = 40, 20, 40


class Recording(Street):
    """People who are taken down, to be posted in whatever portions."""

    def __init__(self, http, settings):
        super().__init__(http, settings)
        self.people = []
        self.played = 0

    def _post(self):
        self.people += self._bodies
        self._bodies.clear()

    def play(self, sizes):
        """Post them in portions of these sizes, and look at the camera after each."""
        for size in sizes:
            part = self.people[self.played : self.played + size]
            self.played += len(part)
            answer = self.http.post("/cameras/corner/tracks", json={"tracks": part})
            assert answer.json()["accepted"] == len(part), answer.text
            self.look()
        assert self.played == len(self.people)

    def end(self):
        """What it has come to."""
        return self.pose()["state"], [alert["kind"] for alert in self.alerts(state="firing")]


@pytest.fixture
def recording(http, settings):
    http.post("/cameras", json={**CAMERA, "reference_tracks": REFERENCE}).raise_for_status()
    return Recording(http, settings)


def at_once(count):
    return [count]


def at_random(seed):
    def sizes(count):
        ends = np.cumsum(np.random.default_rng(seed).integers(3, 40, count))
        return np.diff([0, *ends[ends < count], count]).tolist()

    return sizes


STANDS = "learning"  # of people who walk everywhere alike: a turn would not be noticed
BATCHINGS = [
    pytest.param(at_once, id="at once"),
    pytest.param(at_random(1), id="at random", marks=pytest.mark.slow),
]


@pytest.mark.parametrize("sizes", BATCHINGS)
@pytest.mark.parametrize(
    ("later", "end"),
    [
        pytest.param([PRIOR], (STANDS, []), id="still"),
        pytest.param([KNOCKED], ("drifting", ["drift"]), id="knocked"),
        pytest.param([KNOCKED, PRIOR], (STANDS, []), id="knocked and put back"),
    ],
)
def test_it_matters_not_how_tracks_were_posted(recording, later, end, sizes):
    recording.walk(PRIOR, REFERENCE + STILL)
    for pose in later:
        recording.walk(pose, LATER)
    recording.play(sizes(len(recording.people)))
    assert recording.end() == end


@pytest.mark.nightly
@pytest.mark.slow
def test_it_matters_not_if_they_are_posted_one_by_one(recording):
    """The three of above in a row: each is looked at on the way to the next."""
    recording.walk(PRIOR, REFERENCE)
    recording.play([REFERENCE])
    for pose, count, end in (
        (PRIOR, STILL, (STANDS, [])),
        (KNOCKED, LATER, ("drifting", ["drift"])),
        (PRIOR, LATER, (STANDS, [])),
    ):
        recording.walk(pose, count)
        recording.play([1] * count)
        assert recording.end() == end
