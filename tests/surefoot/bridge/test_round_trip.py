"""A recorded scene as each format tells it: its pose is that of the tracks posted directly."""

import csv
import json
import math
from datetime import UTC, datetime

import numpy as np
import pytest

import surefoot
from models.geometry.upright import tops_of_boxes
from models.tracks.scenes import load_scene
from service.formats.batch import read_json
from service.formats.track import Clock, Limits
from surefoot.bridge.assembler import Assembler
from surefoot.bridge.feeds import Topics, read_feeds
from surefoot.bridge.values import WholeTrack, body_of
from surefoot.tracks import in_order
from tests.conftest import SCENES
from tests.surefoot.bridge.stand import frigate_event

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}"),
]
T0 = 1_795_161_600.0
FEEDS = "axis:axis/+/s,onvif-grid:grid/+/s,onvif-normalised:norm/+/s,deepstream-960x540:gpu"
TOPICS = Topics(prefix="surefoot", frigate="frigate", cameras={}, feeds=read_feeds(FEEDS))
EDGES = ("left", "top", "right", "bottom")
LEARNED = 75  # of 150 people


@pytest.fixture(scope="module")
def scene():
    return load_scene(SCENES / "town_centre")


@pytest.fixture(scope="module")
def frames(scene):
    """Boxes in shares of the picture by time and person; pixels count from the first's centre."""
    lens, found = scene.intrinsics, {}
    size = np.array([lens.width, lens.height] * 2)
    with (SCENES / "town_centre" / "boxes.csv").open() as lines:
        for row in csv.DictReader(lines):
            box = np.array([float(row[name]) for name in ("x1", "y1", "x2", "y2")])
            time_s = T0 + int(row["frame"]) / scene.frame_rate_hz
            found.setdefault(time_s, {})[row["track_id"]] = (box + 0.5) / size
    return dict(sorted(found.items()))


def axis(time_s, seen):
    detections = [
        {"object_track_id": name, "bounding_box": dict(zip(EDGES, box.round(4), strict=True))}
        for name, box in seen.items()
    ]
    return "axis/yard/s", {"channel_id": 1, "timestamp": iso(time_s), "detections": detections}


def onvif(topic, of):
    def message(time_s, seen):
        objects = [
            {
                "@ObjectId": name,
                "Appearance": {
                    "Shape": {
                        "BoundingBox": dict(zip(map("@{}".format, EDGES), of(box), strict=True))
                    }
                },
            }
            for name, box in seen.items()
        ]
        return topic, {"Frame": [{"@UtcTime": iso(time_s), "Object": objects}]}

    return message


def deepstream(time_s, seen):
    objects = [
        "|".join([name, *(f"{x:g}" for x in box * (960, 540, 960, 540)), "Person"])
        for name, box in seen.items()
    ]
    return "gpu", {"sensorId": "yard", "@timestamp": iso(time_s), "objects": objects}


def plain(time_s, seen):
    half = np.array([960, 540] * 2)
    boxes = [{"id": name, "box": (box * half - 0.5).tolist()} for name, box in seen.items()]
    return "surefoot/yard/frames", {"time_s": time_s, "size": [960, 540], "detections": boxes}


def iso(time_s):
    return datetime.fromtimestamp(time_s, UTC).isoformat()


FORMATS = {
    "axis, four decimals": axis,
    "onvif, 0 to 8192": onvif("grid/yard/s", lambda box: (8192 * box).round().tolist()),
    "onvif, -1 to 1": onvif(
        "norm/yard/s", lambda box: ((2 * box - 1) * (1, -1, 1, -1)).round(6).tolist()
    ),
    "deepstream, six digits": deepstream,
    "plain, half the size": plain,
}


def tracks_of(scene, found):
    """Tracks as the service makes them of posts."""
    lens = scene.intrinsics
    limits = Limits(width=lens.width, height=lens.height, now_s=T0 + 1e5, max_ahead_s=60.0)
    body = body_of(found[0].head("x"), [each.to_json() for each in found])
    batch = read_json(body, Clock(frame_rate_hz=None, started_at_s=None), limits)
    return in_order(
        surefoot.Track(
            time_s=each.points[:, 0],
            uv=each.points[:, 1:3],
            top_v=None if each.boxes is None else tops_of_boxes(lens, each.boxes),
        )
        for each in batch.tracks
    )


def assembled(messages):
    assembler = Assembler()
    for now_s, (topic, document) in messages:
        _, found = TOPICS.read(topic, json.dumps(document).encode())
        assembler.tick(now_s)
        for each in found:
            assembler.add(each, now_s)
    assembler.finish_all()
    return assembler.take()


@pytest.fixture(scope="module")
def direct(scene, frames):
    """The tracks as they are posted in pixels of the camera's own picture, and their pose."""
    lens = scene.intrinsics
    size = np.array([lens.width, lens.height] * 2)
    rows = {}
    for time_s, seen in frames.items():
        for name, box in seen.items():
            rows.setdefault(name, []).append([time_s, *(box * size - 0.5).tolist()])
    body = {"source": "x", "tracks": [{"id": n, "boxes": boxes} for n, boxes in rows.items()]}
    limits = Limits(width=lens.width, height=lens.height, now_s=T0 + 1e5, max_ahead_s=60.0)
    clock = Clock(frame_rate_hz=None, started_at_s=None)
    batch = read_json(json.dumps(body).encode(), clock, limits)
    tracks = in_order(
        surefoot.Track(
            time_s=each.points[:, 0],
            uv=each.points[:, 1:3],
            top_v=tops_of_boxes(lens, each.boxes),
        )
        for each in batch.tracks
    )
    camera = surefoot.Camera(intrinsics=lens, prior_pose=surefoot.Pose.of(scene.true_pose))
    site = surefoot.learn(camera, tracks[:LEARNED])
    return tracks, site, surefoot.estimate(site, tracks[LEARNED:]).pose


def apart_deg(one, other):
    return max(abs(one.tilt_deg - other.tilt_deg), abs(one.roll_deg - other.roll_deg))


@pytest.mark.parametrize("name", FORMATS)
def test_a_pose_by_frames_is_the_pose_of_the_tracks(scene, frames, direct, name):
    tracks, site, pose = direct
    found = assembled((time_s, FORMATS[name](time_s, seen)) for time_s, seen in frames.items())
    ours = tracks_of(scene, found)
    assert len(ours) == len(tracks)
    by_frames = surefoot.estimate(site, ours[LEARNED:]).pose
    assert apart_deg(by_frames, pose) < 0.01
    assert by_frames.height_m == pytest.approx(pose.height_m, abs=0.01)


def test_a_pose_by_frigates_thinned_paths_is_near(scene, frames, direct):
    _, site, pose = direct
    paths = {}
    for time_s, seen in frames.items():
        for name, (x1, _, x2, y2) in seen.items():
            path = paths.setdefault(name, [])
            # A new point after 5 % of the diagonal, as Frigate's tracker keeps them.
            x, y = float(x1 + x2) / 2, float(y2)
            if not path or math.hypot(x - path[-1][0][0], y - path[-1][0][1]) > 0.05:
                path.append([[x, y], time_s])
    found = []
    for name, path in paths.items():
        event = frigate_event("end", name, "yard", path)
        found += TOPICS.read("frigate/events", json.dumps(event).encode())[1]
    assert all(isinstance(each, WholeTrack) for each in found)
    thinned = tracks_of(scene, found)
    by_paths = surefoot.estimate(site, thinned[len(thinned) // 2 :]).pose
    assert apart_deg(by_paths, pose) < 0.1
