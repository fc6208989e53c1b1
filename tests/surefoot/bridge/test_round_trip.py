"""A recorded scene as each format, and the client, tell it: its pose is that of a direct post."""

import csv
import json
import math
from datetime import UTC, datetime
from io import StringIO

import numpy as np
import pytest

import surefoot
from models.geometry.upright import tops_of_boxes
from models.pose import self_calibrate
from models.simulation.walkers import WalkConfig
from models.tracks.scenes import load_scene
from models.tracks.trajectory import Trajectory, by_end
from service.formats.batch import read_json
from service.formats.track import Clock, Limits
from service.formats.track_text import read_text
from surefoot import client
from surefoot.bridge import rows
from surefoot.bridge.assembler import Assembler
from surefoot.bridge.feeds import Topics, read_feeds
from surefoot.bridge.values import WholeTrack, body_of
from tests.conftest import SCENES
from tests.surefoot.bridge.stand import frigate_event
from tests.surefoot.test_client import OK, Stub

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SCENES.is_dir(), reason=f"no recorded scenes in {SCENES}"),
]
T0 = 1_795_161_600.0
FEEDS = "axis:axis/+/s,onvif-grid:grid/+/s,onvif-normalised:norm/+/s,deepstream-960x540:gpu"
TOPICS = Topics(prefix="surefoot", frigate="frigate", cameras={}, feeds=read_feeds(FEEDS))
EDGES = ("left", "top", "right", "bottom")
LEARNED = 75  # of 150 people
NO_CLOCK = Clock(frame_rate_hz=None, started_at_s=None)


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
    return tracks_in(scene, body_of(found[0].head("x"), [each.to_json() for each in found]))


def tracks_in(scene, body, read=read_json, clock=NO_CLOCK):
    lens = scene.intrinsics
    limits = Limits(width=lens.width, height=lens.height, now_s=T0 + 1e5, max_ahead_s=60.0)
    batch = read(body, clock, limits)
    assert not batch.rejections or {each.code for each in batch.rejections} == {"too_short"}
    return by_end(
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
    """The tracks as they are posted in pixels of the camera's own picture, and their poses.

    One is what is served, the other (3,) by the people alone.
    """
    lens = scene.intrinsics
    size = np.array([lens.width, lens.height] * 2)
    boxes_of = {}
    for time_s, seen in frames.items():
        for name, box in seen.items():
            boxes_of.setdefault(name, []).append([time_s, *(box * size - 0.5).tolist()])
    body = {"source": "x", "tracks": [{"id": n, "boxes": boxes} for n, boxes in boxes_of.items()]}
    tracks = tracks_in(scene, json.dumps(body).encode())
    camera = surefoot.Camera(intrinsics=lens, prior_pose=surefoot.Pose.of(scene.true_pose))
    site = surefoot.learn(camera, tracks[:LEARNED])
    pose = surefoot.estimate(site, tracks[LEARNED:]).pose
    return tracks, site, pose, calibrated(site, tracks)


def apart_deg(one, other):
    return max(abs(one.tilt_deg - other.tilt_deg), abs(one.roll_deg - other.roll_deg))


@pytest.mark.parametrize("name", FORMATS)
def test_a_pose_by_frames_is_the_pose_of_the_tracks(scene, frames, direct, name):
    found = assembled((time_s, FORMATS[name](time_s, seen)) for time_s, seen in frames.items())
    # Six digits of pixels are the coarsest of them.
    check_same(direct, tracks_of(scene, found), 0.02 if "six digits" in name else 0.01)


def check_same(direct, ours, within_deg=0.01):
    tracks, site, pose, by_people = direct
    assert len(ours) == len(tracks)
    # By these people alone, whatever the prior pose: what is served leans on that.
    off_deg = np.degrees(calibrated(site, ours) - by_people)
    assert np.abs(off_deg[:2]).max() < within_deg
    found = surefoot.estimate(site, ours[LEARNED:]).pose
    assert apart_deg(found, pose) < 0.01
    assert found.height_m == pytest.approx(pose.height_m, abs=0.01)


def calibrated(site, tracks):
    seen = [Trajectory(time_s=t.time_s, uv=t.uv, top_v=t.top_v) for t in tracks]
    return self_calibrate(seen, site.camera.intrinsics, WalkConfig(), {}).values


def pixels(box, size=(960, 540)):
    """A box of shares in pixels of a picture, which count from the first's centre."""
    return (box * (*size, *size) - 0.5).tolist()


def rows_of(frames, rate_hz):
    """Rows as supervision's sinks write them, with the frame beside them."""
    for time_s, seen in frames.items():
        for name, box in seen.items():
            edges = dict(zip(("x_min", "y_min", "x_max", "y_max"), pixels(box), strict=True))
            frame = {"frame_number": round((time_s - T0) * rate_hz)}
            yield {**edges, "class_id": 0, "confidence": 0.9, "tracker_id": int(name), **frame}


def supervision_csv(frames, rate_hz):
    file = StringIO()
    found = list(rows_of(frames, rate_hz))
    writer = csv.DictWriter(file, list(found[0]))
    writer.writeheader()
    writer.writerows(found)
    clock = rows.Clock("frame_number", rate_hz, T0)
    return rows.read_supervision_csv(file.getvalue().encode(), "yard", clock, (960.0, 540.0))


def supervision_json(frames, rate_hz):
    file = json.dumps(list(rows_of(frames, rate_hz))).encode()
    clock = rows.Clock("frame_number", rate_hz, T0)
    return rows.read_supervision_json(file, "yard", clock, (960.0, 540.0))


def ultralytics_text(frames, _):
    """`save_txt`, with six digits as that writes them."""
    for time_s, seen in frames.items():
        lines = [
            f"0 {(x1 + x2) / 2:g} {(y1 + y2) / 2:g} {x2 - x1:g} {y2 - y1:g} 0.9 {name}"
            for name, (x1, y1, x2, y2) in seen.items()
        ]
        yield from rows.read_ultralytics_text("\n".join(lines).encode(), "yard", time_s)


def ultralytics_summary(frames, _):
    """`to_json`, with five decimals as that writes them."""
    for time_s, seen in frames.items():
        found = [
            {
                "name": "person",
                "track_id": int(name),
                "box": dict(zip(("x1", "y1", "x2", "y2"), np.round(pixels(box), 5), strict=True)),
            }
            for name, box in seen.items()
        ]
        message = json.dumps(found).encode()
        yield from rows.read_ultralytics_summary(message, "yard", time_s, (960.0, 540.0))


@pytest.mark.parametrize(
    "read", [supervision_csv, supervision_json, ultralytics_text, ultralytics_summary]
)
def test_a_pose_by_rows_is_the_pose_of_the_tracks(scene, frames, direct, read):
    assembler = Assembler()
    for each in read(frames, scene.frame_rate_hz):
        assembler.add(each, each.time_s)
    assembler.finish_all()
    check_same(direct, tracks_of(scene, assembler.take()))


def test_a_pose_by_mot_rows_is_the_pose_of_the_tracks(scene, frames, direct):
    """With two decimals, as trackers write them; frames and pixels count from 1."""
    lens, rate_hz = scene.intrinsics, scene.frame_rate_hz
    lines = []
    for time_s, seen in frames.items():
        for name, box in seen.items():
            left, top, right, bottom = pixels(box, (lens.width, lens.height))
            frame, size = round((time_s - T0) * rate_hz) + 1, (right - left, bottom - top)
            numbers = ",".join(f"{each:.2f}" for each in (left + 1, top + 1, *size))
            lines.append(f"{frame},{name},{numbers},0.9,-1,-1,-1")

    def read(body, clock, limits):
        return read_text(body, "x", clock, limits)

    clock = Clock(frame_rate_hz=rate_hz, started_at_s=T0)
    check_same(direct, tracks_in(scene, "\n".join(lines).encode(), read, clock))


def test_a_pose_by_the_client_is_the_pose_of_the_tracks(scene, frames, direct, monkeypatch):
    """A loop over Ultralytics' boxes, whose bodies are what a service is posted."""
    monkeypatch.setattr(client, "_TICK_S", 0.02)
    with Stub(OK) as service:
        with client.Client(service.url, "yard", size=(960, 540), silence_s=5.0) as posting:
            for time_s, seen in frames.items():
                for name, box in seen.items():
                    posting.add(int(name), pixels(box), time_s)
        bodies = [body for _, body in service.seen]
    tracks = [each for body in bodies for each in body["tracks"]]
    check_same(direct, tracks_in(scene, json.dumps({**bodies[0], "tracks": tracks}).encode()))


def test_a_pose_by_frigates_thinned_paths_is_near(scene, frames, direct):
    _, site, pose, _ = direct
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
