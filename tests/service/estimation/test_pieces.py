"""A tracker that cuts walks into pieces: references and windows count people."""

from datetime import UTC, datetime

import numpy as np
import pytest

from models.pose import count_walks
from models.tracks.linking import Links
from models.tracks.trajectory import Trajectory
from service.estimation.evidence import Unpacked, until_so_many
from service.store.tracks import TrackRecord, pack
from tests.conftest import CAMERA
from tests.service.estimation.test_batchings import Recording, at_once, at_random
from tests.service.street import KNOCKED, LENS, PRIOR

REFERENCE, LATER = 30, 30
PIECE, GAP = 6, 1  # points, 0.4 s apart


class Pieces(Recording):
    """People whom the tracker loses every two seconds, and finds again under another name."""

    def _post(self):
        for body in self._bodies:
            points = body["points"]
            for number, first in enumerate(range(0, len(points), PIECE + GAP)):
                piece = points[first : first + PIECE]
                if len(piece) == PIECE:
                    self.people.append({"id": f"{body['id']}.{number}", "points": piece})
        self._bodies.clear()
        self.people.sort(key=lambda piece: piece["points"][-1][0])

    def count(self, pieces):
        """How many walks the first so many pieces are of."""
        return count_walks([trajectory(piece) for piece in self.people[:pieces]], LENS, PRIOR)


def trajectory(piece):
    points = np.array(piece["points"])
    return Trajectory(time_s=points[:, 0], uv=points[:, 1:])


@pytest.fixture
def pieces(http, settings):
    http.post("/cameras", json={**CAMERA, "reference_tracks": REFERENCE}).raise_for_status()
    return Pieces(http, settings)


@pytest.mark.parametrize(
    "sizes",
    [
        pytest.param(at_once, id="at once"),
        pytest.param(at_random(1), id="at random", marks=pytest.mark.slow),
        pytest.param(at_random(2), id="at random again", marks=pytest.mark.nightly),
    ],
)
def test_a_reference_is_of_so_many_people_however_they_were_posted(pieces, sizes):
    pieces.walk(PRIOR, REFERENCE + 10)
    pieces.walk(KNOCKED, LATER)
    wanted = next(n for n in range(len(pieces.people)) if pieces.count(n) == REFERENCE)
    assert wanted > 1.5 * REFERENCE
    pieces.play(sizes(len(pieces.people)))
    assert pieces.pose()["reference"]["tracks"] == wanted
    assert pieces.end() == ("drifting", ["drift"])
    assert "are pieces of others' walks" in pieces.pose()["reason"]


def test_tracks_that_are_all_pieces_are_linked_a_few_times_and_not_for_each(monkeypatch):
    one = np.column_stack([np.arange(6.0), np.full((6, 2), 300.0)])
    records = [
        TrackRecord(id=n, points=pack(one), received_at=datetime.now(UTC)) for n in range(2_001)
    ]
    sizes = []

    def all_but_one(trajectories, *_):
        sizes.append(len(trajectories))
        before = np.where(np.arange(len(trajectories)) < 399, -1, 0)
        return Links(before=before, scale=None)

    monkeypatch.setattr("service.estimation.evidence.linked", all_but_one)
    found = until_so_many(lambda limit: records[:limit], 400, LENS, PRIOR, Unpacked())
    assert (found.enough, len(found.records)) == (True, 2_000)
    assert sizes[:12] == list(range(400, 412))
    assert len(sizes) <= 30


def test_as_many_tracks_are_read_as_are_of_so_many_people(pieces):
    pieces.walk(PRIOR, REFERENCE)
    stored = pieces.people[: len(pieces.people) // 2]
    walks = [pieces.count(n) for n in range(len(stored) + 1)]
    assert set(b - a for a, b in zip(walks, walks[1:], strict=False)) == {0, 1}
    records = [
        TrackRecord(id=n, points=pack(np.array(piece["points"])), received_at=datetime.now(UTC))
        for n, piece in enumerate(stored)
    ]
    for wanted in (5, 8):
        found = until_so_many(lambda limit: records[:limit], wanted, LENS, PRIOR, Unpacked())
        assert found.enough
        assert len(found.records) == walks.index(wanted)
    short = until_so_many(lambda limit: records[:limit], 10**6, LENS, PRIOR, Unpacked())
    assert (short.enough, len(short.records)) == (False, len(stored))


def test_what_counts_is_said_while_the_reference_is_learned_and_after(pieces):
    pieces.walk(PRIOR, 2 * REFERENCE)
    everybody, posted = pieces.people, len(pieces.people) // 4
    pieces.people = everybody[:posted]
    pieces.play([posted])
    counted = pieces.count(posted)
    body = pieces.pose()
    learned = body["reference"]
    assert (learned["tracks"], learned["counted"]) == (posted, counted)
    assert learned["pieces"] == posted - counted > 0
    ends_s = [piece["points"][-1][0] for piece in pieces.people]
    assert learned["hours"] == len({end_s // 3600 for end_s in ends_s})
    assert body["reason"] == (
        f"{counted} of {REFERENCE} people for the reference; "
        f"{posted - counted} of {posted} tracks are pieces of others' walks"
    )
    pieces.people = everybody
    pieces.play([len(everybody) - posted])
    learned = pieces.pose()["reference"]
    assert (learned["state"], learned["counted"]) == ("ready", REFERENCE)
    assert learned["tracks"] == REFERENCE + learned["pieces"]
