"""Reasons: every code has its words, which are those that have always been said."""

import json
import math
from dataclasses import replace
from zoneinfo import ZoneInfo

import pytest

from models.assessment import Verdict, reason_of_drift
from models.assessment.reasons import reason_of_chart
from models.geometry.pose import PoseParameters
from models.monitoring.chart import CLOCK, ChartResult
from models.monitoring.drift import (
    Drift,
    DriftLimits,
    MoveProbabilities,
)
from models.reasons import Reason, TracksCode
from service.reasons import (
    CODES,
    ServiceCode,
    as_said,
    code_of,
    from_json,
    some,
    to_json,
    values_of,
)
from service.wording.reasons import group_in_words, in_words

LIMITS = {"certainty": 0.99, "floor_rad": math.radians(0.5), "floor_m": 0.2}
SURE, MAYBE, HARDLY = {"moved": 0.9996}, {"moved": 0.87}, {"moved": 0.004}
TILT = {"tilt_rad": math.radians(3.1), "tilt_sd_rad": math.radians(0.3)}
HEIGHT = {"height_m": -0.234, "height_sd_m": 0.1}
T, S = TracksCode, ServiceCode
SAID = [
    (T.BEYOND_LIMITS, {**LIMITS, **SURE, **TILT, **HEIGHT},
     "tilt +3.10 deg (sd 0.30), height -0.23 m (sd 0.10) against the prior pose; "
     "moved: over 99.9 %, by more than 0.5 deg or 0.2 m"),
    (T.BEYOND_LIMITS, {**LIMITS, "moved": 0.9954, **TILT},
     "tilt +3.10 deg (sd 0.30) against the prior pose; moved: 99.5 %, "
     "by more than 0.5 deg or 0.2 m"),
    (T.BEYOND_LIMITS, {**LIMITS, **SURE}, "moved: over 99.9 %, by more than 0.5 deg or 0.2 m"),
    (T.SUSPECTED, {**LIMITS, **MAYBE, **TILT},
     "tilt +3.10 deg (sd 0.30) against the prior pose; moved: 87 %, "
     "which is not sure enough for an alert"),
    (T.BEYOND_LIMITS_BEFORE, {**LIMITS, **MAYBE, **TILT},
     "tilt +3.10 deg (sd 0.30) against the prior pose; moved: 87 %: "
     "was beyond 0.5 deg or 0.2 m; it ends once a move is unlikely"),
    (T.BEYOND_LIMITS_LAST_IDENTIFIABLE, {**LIMITS, **MAYBE},
     "beyond 0.5 deg or 0.2 m when it was last told"),
    (T.WITHIN_LIMITS, {**LIMITS, **HARDLY, **TILT},
     "tilt +3.10 deg (sd 0.30) against the prior pose; moved: under 1 %"),
    (T.CHART, {"number": "heading", "sign": -1, "parties": 20, "statistic": 30.4, "level": 8.6},
     "the last 20 walking groups walk as they would if the heading had gone down "
     "(drift chart: 30, alarm at 9)"),
    (T.CHART, {"number": "times", "sign": 1, "parties": 20, "statistic": 30.4, "level": 8.6},
     "the last 20 walking groups walk as they would if all times were too long "
     "(drift chart: 30, alarm at 9)"),
    (T.SLOW_DRIFT, {"number": "heading", "by_rad": math.radians(1.24), "sd_rad": math.radians(0.3),
               "since": "2026-08-20T07:12:00+00:00", "statistic": 17.2, "level": 14.4},
     "has drifted slowly by +1.2 deg (sd 0.3) in heading since 2026-08-20, relative to the first "
     "map and speeds of its reference (score 17, alarm at 14)"),
    (T.SCALE_CHANGED, {"factor": 1.2, "rate_hz": 25.0},
     "the scale has changed by +20 % and the angles have not: as if 30 frames a second were taken "
     "for 25, or the camera was raised"),
    (T.LENS_CHANGED, {"factor": 1.15},
     "a focal length that differs by +15 % explains where people walk, and how fast, better than "
     "any move: the lens was zoomed, or the picture is cut or scaled otherwise"),
    (T.SCALE_CHANGED, {"factor": 0.8, "rate_hz": 25.0},
     "the scale has changed by -20 % and the angles have not: as if 20 frames a second were taken "
     "for 25, or the camera was lowered"),
    (T.WAYS_CHANGED, {},
     "people walk the same ground other ways than they did: where they do tells no pose"),
    (T.PATHS_CHANGED, {},
     "people walk on none of the paths that were learned: the camera was turned far, or they walk "
     "elsewhere"),
    (T.HEADING_AMBIGUOUS, {"turns_rad": [math.radians(-12), math.radians(0.04)]},
     "turns of -12.0 deg and +0.0 deg explain where people walk about as well"),
    (T.HEADING_UNIDENTIFIABLE, {"heading_sd_rad": math.radians(4.26)},
     "where people walk does not tell the heading (sd 4.3 deg)"),
    (T.UNIDENTIFIABLE, {"roll_sd_rad": math.radians(3.0), "log_height_sd": 0.154},
     "the tracks cannot tell roll (sd 3.0 deg) and height (sd 15 %)"),
    (T.UNIDENTIFIABLE, {"tilt_sd_rad": math.radians(3.0), "alike": ["tilt", "height"]},
     "the tracks cannot tell tilt (sd 3.0 deg): people walk too much alike, one way or along one "
     "path, and tilt makes up for height"),
    (T.TOO_FEW_GROUPS, {"tracks": 12, "parties": 1, "least_parties": 5},
     "the 12 tracks are of 1 walking group, at least 5 are needed to tell the camera's "
     "drift from theirs"),
    (T.TOO_FEW_GROUPS, {"tracks": 12, "parties": 3, "least_parties": 5},
     "the 12 tracks are of 3 walking groups, at least 5 are needed to tell the camera's "
     "drift from theirs"),
    (T.SPEED_UNUSUAL, {"speed_mps": 2.994, "slow_mps": 0.7, "fast_mps": 2.0},
     "people walk at 2.99 m/s at the prior pose, 0.7 to 2 m/s is usual: the prior height or the "
     "frame rate is wrong"),
    (T.STATURE_UNUSUAL, {"stature_m": 2.5, "short_m": 1.4, "tall_m": 2.2},
     "boxes say that people are 2.50 m tall at the prior pose, 1.4 to 2.2 m is usual: the prior "
     "height is wrong"),
    (T.PIECES, {"tracks": 400.0, "pieces": 250.0},
     "250 of 400 tracks are pieces of others' walks: the tracker loses people, each of whom "
     "counts once"),
    (T.PRIOR_POSE_DOUBTED, {"tilt_rad": math.radians(5), "roll_rad": math.radians(-0.3)},
     "the reference tracks put the camera +5.0 deg in tilt and -0.3 deg in roll from its prior "
     "pose: the prior pose is wrong, or the camera had moved before"),
    (T.IMAGE_SHARES, {"tracks": 40, "largest_px": 0.9312},
     "no number of the 40 tracks is above 0.93: they look like shares of the image, not pixels"),
    (T.OTHER_IMAGE_SIZE, {"tracks": 200, "width_px": 640, "height_px": 360,
                          "sizes_px": ["640x360"], "rescaled_speed_mps": 1.312, "speed_mps": 6.2},
     "the 200 tracks fit an image of 640 x 360 pixels: people walk more evenly there, at 1.31 m/s, "
     "than in pixels of the camera's frame, at 6.20 m/s"),
    (T.OTHER_IMAGE_SIZE, {"tracks": 200, "width_px": 640, "height_px": 360,
                          "sizes_px": ["640x360"], "rescaled_speed_mps": 1.312},
     "the 200 tracks fit an image of 640 x 360 pixels: people walk on the ground there, at "
     "1.31 m/s, but outside it in pixels of the camera's frame"),
    (S.AS_SAID, {"text": "it has turned"}, "it has turned"),
    (S.LEARNING_REFERENCE, {}, "the reference is being learned"),
    (S.NOBODY_POSTED, {}, "no track of anybody has been posted for it yet"),
    (S.POSE_UNKNOWN, {"tracks": 3, "least_walkers": 5},
     "its pose is found by the people before it: 3 tracks so far, of 5 or more that walk"),
    (S.POSE_UNTOLD, {"tracks": 30, "groups": 22, "tilt_sd_rad": math.radians(6),
                     "roll_sd_rad": math.radians(2), "height_sd_m": 1.0},
     "30 tracks of 22 people or groups do not tell its pose yet (sure to 9.9° in tilt, 3.3° in "
     "roll, 1.6 m in height); more people help, and such as walk other ways"),
    (S.POSE_PROPOSED, {"tracks": 70, "groups": 64, "tilt_sd_rad": math.radians(1),
                       "roll_sd_rad": math.radians(1), "height_sd_m": 0.5},
     "pose estimated from 70 tracks (sure to 1.6° in tilt, 1.6° in roll, 0.8 m in height); an "
     "operator has to confirm it"),
    (S.REFERENCE_TRACKS, {"counted": 40, "wanted": 60, "tracks": 40, "pieces": 0},
     "40 of 60 people for the reference"),
    (S.REFERENCE_TRACKS, {"counted": 98, "wanted": 133, "tracks": 133, "pieces": 35},
     "98 of 133 people for the reference; 35 of 133 tracks are pieces of others' walks"),
    (S.TRACKS_SINCE, {"tracks": 3, "cause": "put_back", "least_walkers": 5},
     "3 tracks since the camera was put back; at least 5 of people who walk for a few seconds "
     "inside the image are needed"),
    (S.LAST_IDENTIFIABLE, {}, "when it was last told:"),
    (S.MAINTENANCE, {"until": "2026-11-22T09:30:00Z"},
     "maintenance is under way until 2026-11-22 09:30Z"),
    (S.MAINTENANCE, {"until": "2026-11-22T09:30:00Z", "note": "new lens"},
     "maintenance is under way until 2026-11-22 09:30Z (new lens)"),
    (S.WITHOUT_PART, {"part": "flow_map", "why": "cannot be read"},
     "without the flow map: cannot be read"),
    (S.BY_PICTURE, {"taken_at": "2026-11-25T09:30:00Z"},
     "estimated from the image of 2026-11-25 09:30Z, without tracks since"),
    (S.AWAITING_IMAGE, {"compared": 5},
     "5 images were compared; the next that matches shows where the camera is"),
    (S.AWAITING_IMAGE, {"compared": 1},
     "1 image was compared; the next that matches shows where the camera is"),
    (T.SITE_CHANGED, {},
     "the picture says that it stands, and people walk elsewhere: the site changed"),
    (S.PICTURE_SHIFTED, {},
     "near and far things moved apart in the picture: the camera was moved aside, too, and how far "
     "it turned is known less well"),
    (S.PICTURE_FROZEN, {"unchanged_s": 9000.0}, "the same picture for 2.5 h"),
    (S.PICTURE_BLACK, {}, "its picture is black"),
    (S.PICTURE_BLINDED, {}, "it is blinded: far more of its picture is white than ever"),
    (S.PICTURE_COVERED, {}, "something covers its view"),
    (S.PICTURE_DEFOCUSED, {}, "its picture is out of focus"),
    (S.PICTURE_UPSIDE_DOWN, {}, "its picture is upside down"),
    (S.PICTURE_OTHER_SCENE, {}, "its picture is of another scene: covered, or turned far"),
    (S.SILENT_USUAL, {"silent_s": 28800.0}, "no track for 8.0 h, as is usual at this hour"),
    (S.SILENT_UNUSUAL, {"silent_s": 12960.0, "missed_tracks": 41.7, "late_s": 72000.0},
     "no track for 3.6 h, where about 42 are usual by now; its tracks come up to 20.0 h late"),
    (S.SILENT_UNKNOWN, {"silent_s": 90000.0, "limit_s": 86400.0},
     "the newest track ended 25.0 h ago; up to 24 h are waited for"),
    (S.MOVED_TOGETHER, {"cameras": 4, "track_source": "byte's"},
     "4 cameras of the tracker \"byte's\" moved together: the tracker or its clock is the likely "
     "cause, rather than each camera by itself; cameras that hang on one mast or building would "
     "look the same"),
    (S.FELL_SILENT_TOGETHER, {"cameras": 4, "track_source": "bytetrack"},
     "4 cameras of the tracker 'bytetrack' fell silent together: the tracker, its network or its "
     "clock is the likely cause, rather than each camera by itself"),
    (S.OTHER_SOURCES, {"sources": ["a", "b"], "counting": "c", "silent_s": 21600.0, "wanted": 60},
     "tracks of 'a' and 'b' come beside those of 'c', which count: they are kept and move nothing. "
     "Should 'c' fall silent for 6 h, they take over once 60 of them were seen while the camera "
     "was where it should be; a person can say so at once"),
    (S.LOOKS_FAIL, {"tries": 3, "error": "KeyError('x')"},
     "its tracks cannot be looked at: 3 tries failed in a row, the last with KeyError('x')"),
    (S.TRACKS_WAIT, {"waits_s": 1230.0, "limit_s": 900.0},
     "its tracks have waited for 20 min; up to 15 min are waited for"),
    (S.TRACKS_SKIPPED, {"tracks": 7, "track_ids": ["17", "it's"], "share": 1.0},
     "7 of its tracks are not looked at, for a look would take too long of them: '17', \"it's\" "
     "and others"),
    (S.TRACKS_SKIPPED, {"tracks": 1, "track_ids": ["17"], "share": 0.25},
     "1 of its tracks is not looked at, for a look would take too long of it: '17'"),
    (S.DISABLED_BY_PERSON, {}, "disabled by a person"),
    (S.ENDPOINT_GONE, {}, "it answered 410: it is gone for good"),
    (S.ENDPOINT_FAILS, {"patience_s": 259200.0, "error": "answered 500"},
     "it failed for more than 72 h: answered 500"),
    (S.BRIDGE_SILENT, {"bridge": "nvr-east", "silent_s": 660.0},
     "the MQTT bridge nvr-east has not reported for 11 min: tracks that it carries do not arrive"),
    (S.BRIDGE_RESTARTS, {"bridge": "nvr-east", "starts": 4, "within_s": 600.0},
     "the MQTT bridge nvr-east was started 4 times within 10 min"),
    (S.BRIDGE_ENDS, {"bridge": "nvr-east", "error": "ended by signal 11"},
     "the MQTT bridge nvr-east does not keep running: ended by signal 11"),
    (S.SECRET_LOST, {},
     "its secret was lost with the key: fetch a new one, tell the receiver, enable it"),
]  # fmt: skip


@pytest.mark.parametrize(("code", "values", "words"), SAID)
def test_the_words_of_a_reason_outlive_a_store(code, values, words):
    reasons = (Reason(code=code, values=values),)
    kept = from_json(json.loads(json.dumps(to_json(reasons), allow_nan=False)))
    assert in_words(kept) == in_words(reasons) == words
    assert kept == reasons
    assert kept[0].code is code


def test_every_code_has_words():
    assert {str(code) for code, _, _ in SAID} == set(CODES)


def test_reasons_are_said_one_after_the_other():
    assert in_words(()) == ""
    changed = Reason(code=T.HEADING_UNIDENTIFIABLE, values={"heading_sd_rad": 0.1})
    missing = Reason(
        code=S.REFERENCE_TRACKS, values={"counted": 1, "wanted": 2, "tracks": 1, "pieces": 0}
    )
    assert in_words((Reason(code=S.LAST_IDENTIFIABLE), changed, missing)) == (
        "when it was last told: where people walk does not tell the heading (sd 5.7 deg); "
        "1 of 2 people for the reference"
    )
    assert in_words(some(None, *as_said("far"), None)) == "far"


@pytest.mark.parametrize(
    ("code", "name", "words"),
    [
        (S.MAINTENANCE, "until", "until 2026-11-25 18:30"),
        (S.BY_PICTURE, "taken_at", "of 2026-11-25 18:30,"),
    ],
)
def test_times_are_said_by_the_operators_clock(code, name, words):
    reason = Reason(code=code, values={name: "2026-11-25T09:30:00Z"})
    assert words in in_words((reason,), ZoneInfo("Asia/Tokyo"))


def test_a_group_is_said_beside_its_trackers_name_without_it():
    values = {"cameras": 4, "track_source": "bytetrack"}
    words = group_in_words((Reason(code=S.FELL_SILENT_TOGETHER, values=values),))
    assert words.startswith("4 cameras fell silent together: the tracker, its network or its clock")


def test_clients_get_the_first_code_and_its_angles_in_degrees():
    reasons = (
        Reason(code=T.WITHIN_LIMITS, values={**LIMITS, **HARDLY, **TILT}),
        Reason(code=T.HEADING_AMBIGUOUS, values={"turns_rad": [0.1]}),
    )
    assert code_of(reasons) == "within_limits"
    assert values_of(reasons) == {
        "moved": 0.004, "certainty": 0.99, "floor_deg": pytest.approx(0.5), "floor_m": 0.2,
        "tilt_deg": pytest.approx(3.1), "tilt_sd_deg": pytest.approx(0.3),
    }  # fmt: skip
    assert values_of(reasons[1:]) == {"turns_deg": [pytest.approx(math.degrees(0.1))]}
    assert (code_of(()), values_of(())) == (None, {})


DRIFT = Drift(
    by=PoseParameters(height_m=0.3, tilt_rad=0.1, roll_rad=0.0, heading_rad=0.2),
    sd=PoseParameters(height_m=0.1, tilt_rad=0.01, roll_rad=0.01, heading_rad=0.01),
    angle_rad=0.1, identifiable=("tilt", "heading"),
    move=MoveProbabilities(moved=0.004, parameters={}),
)  # fmt: skip


@pytest.mark.parametrize(
    ("excess", "drifted", "identifiable", "moved", "code"),
    [
        (1.5, ("tilt",), DRIFT.identifiable, 0.999, T.BEYOND_LIMITS),
        (0.8, ("tilt",), DRIFT.identifiable, 0.999, T.BEYOND_LIMITS_BEFORE),
        (0.0, (), DRIFT.identifiable, 0.5, T.SUSPECTED),
        (0.0, (), DRIFT.identifiable, 0.49, T.WITHIN_LIMITS),
        (0.0, ("tilt",), (), 0.999, T.BEYOND_LIMITS_LAST_IDENTIFIABLE),
        (1.0, ("heading",), (), 0.999, T.BEYOND_LIMITS),
    ],
)
def test_a_verdict_gives_what_is_identifiable_as_its_reason(
    excess, drifted, identifiable, moved, code
):
    verdict = Verdict(streak=0, excess=excess, drifted=drifted)
    move = MoveProbabilities(moved=moved, parameters={})
    reason = reason_of_drift(
        replace(DRIFT, identifiable=identifiable, move=move), verdict, DriftLimits(**LIMITS)
    )
    assert reason is not None
    assert reason.code is code
    numbers = {} if not identifiable else {
        "tilt_rad": 0.1, "tilt_sd_rad": 0.01, "heading_rad": 0.2, "heading_sd_rad": 0.01,
    }  # fmt: skip
    assert reason.values == {**LIMITS, "moved": moved, **numbers}


def test_where_nothing_is_told_and_nothing_drifted_a_verdict_is_no_reason():
    verdict = Verdict(streak=0, excess=0.0, drifted=())
    assert reason_of_drift(replace(DRIFT, identifiable=()), verdict, DriftLimits(**LIMITS)) is None


@pytest.mark.parametrize(("number", "name"), [(0, "tilt"), (2, "height"), (CLOCK, "times")])
def test_a_suspicious_reading_is_a_reason(number, name):
    chart = ChartResult(
        statistic=9.0,
        level=8.0,
        parameter=number,
        sign=1,
        walking_groups=20,
        track_idx=3,
        suspicious=True,
    )
    reason = reason_of_chart(chart)
    assert reason is not None
    assert (reason.code, reason.values["number"]) == (T.CHART, name)
    assert reason_of_chart(replace(chart, suspicious=False)) is None
