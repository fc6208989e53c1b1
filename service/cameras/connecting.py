"""How a camera that learns is posted to: how many, how late, and when its reference is ready."""

import statistics
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from service.cameras.poses import PoseView, view_pose
from service.cameras.post_log import PostLog, Posts
from service.settings import Settings
from service.store import tracks

_LATELY = timedelta(minutes=10)
_LEAST_SPAN = timedelta(minutes=1)  # one post is no rate
_NEWEST = 50  # tracks, whose delays are compared


@dataclass(frozen=True, slots=True, kw_only=True)
class Connection:
    """What comes for a camera.

    `posts` are those that this process has seen since `since`. Of what is stored, `rate_hz` is how
    many tracks came a second in the last ten minutes, `delays_s` the least and the median time from
    a track's end by its own clock until it came, of the newest. `ready_in_s` is when the reference
    would be ready at that rate. None: nothing tells.
    """

    now: datetime
    pose: PoseView
    posts: Posts
    since: datetime
    last_at: datetime | None
    rate_hz: float | None
    delays_s: tuple[float, float] | None
    ready_in_s: float | None


def view_connection(
    session: Session, settings: Settings, log: PostLog, camera_id: str
) -> Connection:
    """What comes for a camera.

    Raises:
        NotFoundError: there is no such camera.
    """
    pose = view_pose(session, settings, camera_id)
    now, posts = datetime.now(UTC), log.of(camera_id)
    newest = tracks.newest_arrivals(session, camera_id, _NEWEST)
    delays = [received_at.timestamp() - ended_s for received_at, ended_s in newest]
    received_at = newest[0][0] if newest else None
    rate_hz = None
    count, first_at = tracks.arrived_since(session, camera_id, now - _LATELY)
    if count and first_at is not None:
        rate_hz = count / max(now - first_at, _LEAST_SPAN).total_seconds()
    return Connection(
        now=now,
        pose=pose,
        posts=posts,
        since=log.since,
        last_at=max((at for at in (posts.last_at, received_at) if at), default=None),
        rate_hz=rate_hz,
        delays_s=(min(delays), statistics.median(delays)) if delays else None,
        ready_in_s=_ready_in_s(pose, rate_hz),
    )


def _ready_in_s(pose: PoseView, rate_hz: float | None) -> float | None:
    learned = pose.reference
    if learned.ready or not learned.counted or not rate_hz:
        return None
    people_hz = rate_hz * learned.counted / learned.tracks
    return (learned.wanted - learned.counted) / people_hz
