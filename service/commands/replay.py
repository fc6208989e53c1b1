"""Replay a recorded scene against a running service, as its tracker would have posted it."""

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import httpx

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.simulation.poses import PoseOffset, offset_trajectory
from models.tracks.scenes import Scene, SceneTrack, load_scene
from service.degrees import in_degrees

_SOURCE = "surefoot-replay"
_BATCH_TRACKS = 10
_TRIES, _LONGEST_WAIT_S = 30, 30.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplayProgress:
    """Progress of a replay."""

    posted: int
    tracks: int
    accepted: int
    duplicates: int
    rejected: int


def replay_scene(
    folder: Path,
    url: str,
    *,
    knock: PoseOffset,
    speed: float,
    on_progress: Callable[[ReplayProgress], None],
    token: str | None = None,
) -> tuple[Scene, ReplayProgress]:
    """Register the scene's camera with its true pose as prior, and post its tracks in time order.

    A camera that is registered already stays. The recording ends now; at `speed` 0 it is posted as
    fast as it goes, else so many times as fast as it was recorded. With a knock, people are seen as
    the moved camera would have.

    Raises:
        httpx.HTTPError: the service cannot be reached or refuses.
    """
    scene = load_scene(folder)
    with client_of(url, token) as http:
        body = camera_body(scene.scene_id, scene.intrinsics, scene.true_pose)
        answer = http.post("/cameras", json={**body, "frame_rate_hz": scene.frame_rate_hz})
        if answer.status_code != 409:
            answer.raise_for_status()
        tracks = list(_seen(scene, knock))
        ends = [float(track.trajectory.time_s[-1]) for track in tracks]
        shift_s = math.floor(time.time() - max(ends, default=0.0))
        order = sorted(range(len(tracks)), key=ends.__getitem__)
        counts = {"accepted": 0, "duplicates": 0, "rejected": 0}
        started = time.monotonic()
        for at in range(0, len(order), _BATCH_TRACKS):
            rows = order[at : at + _BATCH_TRACKS]
            if speed > 0:
                due_s = (ends[rows[-1]] - ends[order[0]]) / speed
                time.sleep(max(0.0, started + due_s - time.monotonic()))
            receipt = post_tracks(http, scene.scene_id, [tracks[row] for row in rows], shift_s)
            counts["accepted"] += receipt["accepted"]
            counts["duplicates"] += receipt["duplicates"]
            counts["rejected"] += len(receipt["rejected"])
            progress = ReplayProgress(posted=at + len(rows), tracks=len(tracks), **counts)
            on_progress(progress)
    return scene, progress


def client_of(url: str, token: str | None) -> httpx.Client:
    """A client of a service, with a token where it wants one: of the scopes admin and ingest."""
    headers = {} if token is None else {"Authorization": f"Bearer {token}"}
    return httpx.Client(base_url=url, timeout=60, headers=headers)


def post_tracks(
    http: httpx.Client, camera_id: str, tracks: Sequence[SceneTrack], shift_s: float
) -> dict[str, Any]:
    """Post the foot points of some tracks with their times shifted; returns the receipt.

    Comes back when a busy service says so; a post that is repeated changes nothing.
    """
    body = {
        "source": _SOURCE,
        "tracks": [
            {
                "id": track.track_id,
                "points": [
                    [t + shift_s, u, v]
                    for t, (u, v) in zip(
                        track.trajectory.time_s.tolist(),
                        track.trajectory.uv.tolist(),
                        strict=True,
                    )
                ],
            }
            for track in tracks
        ],
    }
    for _ in range(_TRIES):
        answer = http.post(f"/cameras/{camera_id}/tracks", json=body)
        asked = answer.headers.get("retry-after", "")
        wait_s = float(asked) if asked.isdigit() else math.inf
        if answer.status_code not in (429, 503) or wait_s > _LONGEST_WAIT_S:
            break
        time.sleep(wait_s)
    if answer.status_code != 422:
        answer.raise_for_status()  # a proxy's answer need be no JSON
    document: dict[str, Any] = answer.json()
    if document.get("code") == "nothing_taken":  # too short, all of them: the next may be longer
        return {"accepted": 0, "duplicates": 0, "rejected": document["errors"]}
    answer.raise_for_status()
    return document


def camera_body(camera_id: str, lens: Intrinsics, pose: CameraPose) -> dict[str, Any]:
    """The body that registers a camera."""
    return {
        "id": camera_id,
        "intrinsics": asdict(lens),
        "prior_pose": in_degrees(asdict(pose)),
    }


def _seen(scene: Scene, knock: PoseOffset) -> Iterator[SceneTrack]:
    """Tracks as the knocked camera would have them, of those long enough to be taken."""
    if knock == PoseOffset():
        yield from scene.tracks
        return
    knocked = knock.apply(scene.true_pose)
    for track in scene.tracks:
        seen = offset_trajectory(track.trajectory, scene.intrinsics, scene.true_pose, knocked)
        if seen is not None and seen.long_enough:
            yield SceneTrack(track_id=track.track_id, trajectory=seen)
