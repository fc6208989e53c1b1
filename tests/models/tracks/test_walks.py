"""What is read of tracks, each walk once."""

import numpy as np

from models.reasons import Reason, TracksCode
from models.tracks.observations import check_in_time
from models.tracks.trajectory import by_end
from models.tracks.walks import observe, observe_each, observe_walks
from tests.models.sites import LENS, PRIOR, tracks_of
from tests.models.tracks.test_linking import START_M, walk


def test_pieces_count_once_with_their_last():
    pieces = [walk(0, 4), walk(5, 9), walk(0, 9.5, start=START_M + [0.0, 6.0]), walk(10, 14)]
    walks = observe_walks(pieces, LENS, PRIOR)
    assert walks.walk_idx.tolist() == [3, 3, 2, 3]
    assert walks.pieces == 2
    seen = walks.observations
    assert np.unique(seen.steps.rows.owner_idx).tolist() == [2, 3]
    assert seen.tracks == 4
    assert seen.ended_s.tolist() == [piece.time_s[-1] for piece in pieces]
    check_in_time(seen)
    one = observe([pieces[2], walk(0, 14)], LENS, PRIOR)
    assert len(one.steps.rows) >= len(seen.steps.rows) > len(one.steps.rows) - 3


def test_boxes_of_pieces_come_along():
    pieces = [walk(0, 4, tall_m=1.7), walk(5, 9), walk(10, 14, tall_m=1.7)]
    seen = observe(pieces, LENS, PRIOR)
    assert np.unique(seen.tops.rows.owner_idx).tolist() == [2]
    whole = observe_each([walk(0, 14, tall_m=1.7)], LENS)
    assert 0.5 * len(whole.tops.rows) < len(seen.tops.rows) < 0.8 * len(whole.tops.rows)


def test_strangers_are_read_one_by_one():
    (tracks,) = tracks_of(7, (PRIOR, 80))
    tracks = by_end(tracks)
    walks = observe_walks(tracks, LENS, PRIOR)
    assert walks.pieces <= 2
    alone = np.flatnonzero(np.bincount(walks.walk_idx, minlength=len(tracks)) == 1)
    steps, whole = walks.observations.steps, observe_each(tracks, LENS).steps
    here, there = (np.isin(each.rows.owner_idx, alone) for each in (steps, whole))
    np.testing.assert_array_equal(steps.start_rays[here], whole.start_rays[there])


def test_a_tracker_that_cuts_walks_is_told_of():
    (tracks,) = tracks_of(8, (PRIOR, 80))
    assert observe_walks(by_end(tracks), LENS, PRIOR).reason is None
    assert observe_walks([], LENS, PRIOR).reason is None
    assert observe_walks([walk(0, 4), walk(5, 9)], LENS, PRIOR).reason == Reason(
        code=TracksCode.PIECES, values={"tracks": 2.0, "pieces": 1.0}
    )
