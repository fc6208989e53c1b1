"""Frames of cameras and detectors by a real mosquitto, the bridge killed, the service away."""

import json
from datetime import UTC, datetime
from pathlib import Path

import pytest
from sqlalchemy import select

from service.store.engines.store import Store
from service.store.tracks import TrackRecord
from tests.conftest import CAMERA
from tests.running import wait_for
from tests.surefoot.bridge.stand import Client5, bridged, broker, needs_mosquitto

pytestmark = [pytest.mark.slow, needs_mosquitto]
FEEDS = "axis:cams/+/scene,onvif-grid:north/onvif-mj/#=north,deepstream-1280x720:vms/frames"
T0, FRAMES, HZ = 1_795_161_600.0, 60, 5.0


def boxes(at):
    """Two people's boxes in shares of the picture."""
    left = {"1": 0.1 + 0.002 * at, "2": 0.5 + 0.002 * at}
    return {name: (x, 0.3, x + 0.05, 0.7) for name, x in left.items()}


def messages(at):
    """The topic and the message of each format of one frame."""
    time_s = T0 + at / HZ
    moment = datetime.fromtimestamp(time_s, UTC).isoformat()
    seen = boxes(at)
    edges = ("left", "top", "right", "bottom")
    yield (
        "cams/axis_1/scene",
        {
            "channel_id": 1,
            "timestamp": moment,
            "detections": [
                {"object_track_id": name, "bounding_box": dict(zip(edges, box, strict=True))}
                for name, box in seen.items()
            ],
        },
    )
    grid = {
        name: {f"@{edge}": 8192 * x for edge, x in zip(edges, box, strict=True)}
        for name, box in seen.items()
    }
    yield (
        "north/onvif-mj/VideoAnalytics/p/m",
        {
            "Frame": [
                {
                    "@UtcTime": moment,
                    "Object": [
                        {"@ObjectId": name, "Appearance": {"Shape": {"BoundingBox": box}}}
                        for name, box in grid.items()
                    ],
                }
            ]
        },
    )
    yield (
        "vms/frames",
        {
            "version": "4.0",
            "@timestamp": moment,
            "sensorId": "gpu",
            "objects": [
                f"{name}|{1280 * x1:.6f}|{720 * y1:.6f}|{1280 * x2:.6f}|{720 * y2:.6f}|Person"
                for name, (x1, y1, x2, y2) in seen.items()
            ],
        },
    )
    yield (
        "surefoot/plain/frames",
        {
            "time_s": time_s,
            "normalised": True,
            "detections": [{"id": name, "box": box} for name, box in seen.items()],
        },
    )


def test_frames_of_each_format_become_tracks_though_all_of_it_dies(tmp_path: Path, service):
    cameras = {"axis-1": "axis", "north": "onvif", "gpu": "deepstream", "plain": "frames"}
    for camera_id in cameras:
        body = {**CAMERA, "id": camera_id}
        assert service.http.post("/cameras", json=body).status_code == 201

    def stored():
        found = {}
        for camera_id in cameras:
            answer = service.http.get(f"/cameras/{camera_id}/sources")
            for each in answer.json()["items"]:
                found[camera_id, each["name"]] = each["tracks"]
        return found

    with broker(tmp_path) as port:
        client = Client5(port)
        with bridged(tmp_path, port, service.url, feeds=FEEDS) as bridge:
            for at in range(FRAMES):
                if at == 20:
                    bridge.kill()  # with people in the middle of the picture
                    bridge.start()
                if at == 40:
                    bridge.wait_connected(2)
                    service.kill()
                    bridge.kill()
                    bridge.start()
                for topic, message in messages(at):
                    client.publish(topic, json.dumps(message).encode())
            bridge.wait_connected(3)
            wait_for(lambda: "tracks_wait" in bridge.log.read_text())
            service.start()
            wanted = {(camera_id, source): 2 for camera_id, source in cameras.items()}
            wait_for(lambda: stored() == wanted)
            assert bridge.stop() == 0
            assert "_refused" not in bridge.log.read_text()
        client.close()
    assert stored_points(service) == [FRAMES] * 8


def stored_points(service):
    """How many points each stored track has."""
    store = Store(service.settings)
    with store.read() as session:
        found = [len(points) // 24 for points in session.scalars(select(TrackRecord.points))]
    store.close()
    return found
