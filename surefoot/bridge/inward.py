"""Tracks from topics to the service: a message is acknowledged once they are on its disk."""

import logging
import re
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import msgspec

from surefoot.bridge import frigate
from surefoot.bridge.inbox import Inbox, Message
from surefoot.bridge.service import LaterError, RefusedError, Service
from surefoot.bridge.values import MessageError, WholeTrack, check_size

log = logging.getLogger("surefoot.bridge")

_CAMERA = re.compile(r"[a-z0-9][a-z0-9-]{0,62}")
_MOST_TRACKS, _MOST_BYTES = 200, 1024 * 1024  # of a post, as they came
_WAIT_S = 1.0
_FIRST_S, _LONGEST_S = 0.5, 30.0  # between two attempts


@dataclass(slots=True, eq=False)
class _Post:
    """Tracks of a camera that go in one post, or the body that a client has made by itself."""

    camera: str
    body: bytes | None = None
    tracks: list[WholeTrack] = field(default_factory=list)
    messages: list[Message] = field(default_factory=list)


@dataclass(frozen=True, kw_only=True)
class Topics:
    """Where tracks come in; `cameras` maps Frigate's names to ours."""

    prefix: str
    frigate: str | None
    cameras: Mapping[str, str]

    @property
    def asked_for(self) -> list[str]:
        """Topics to subscribe to."""
        events = [] if self.frigate is None else [f"{self.frigate}/events"]
        return [f"{self.prefix}/+/tracks", *events]

    def read(self, topic: str, payload: bytes) -> WholeTrack | str | None:
        """The track of a message, the camera of a body that is posted as it is, or neither.

        Raises:
            MessageError: it is not what its topic is for.
        """
        found: WholeTrack | str | None
        if topic == f"{self.frigate}/events":
            found = frigate.read_event(payload, self.cameras)
        else:
            check_size(payload)
            found = topic.removeprefix(f"{self.prefix}/").removesuffix("/tracks")
        camera = found.camera if isinstance(found, WholeTrack) else found
        if camera is not None and not _CAMERA.fullmatch(camera):
            raise MessageError(
                "malformed",
                f"camera: lower case letters, digits and hyphens are needed, got {camera!r:.80}",
            )
        return found


def carry(inbox: Inbox, topics: Topics, service: Service, stopping: threading.Event) -> None:
    """Post what comes until the event is set; what waits then, the broker sends again."""
    waiting: list[_Post] = []
    delay_s = _FIRST_S
    while not stopping.is_set():
        waiting += _posts(inbox, topics, inbox.take(0.0 if waiting else _WAIT_S))
        for post in waiting:
            post.messages = [each for each in post.messages if inbox.counts(each)]
        waiting, wait_s = _post_all(inbox, [each for each in waiting if each.messages], service)
        if not waiting:
            delay_s = _FIRST_S
            continue
        stopping.wait(min(max(delay_s, wait_s), _LONGEST_S))
        delay_s = min(2 * delay_s, _LONGEST_S)


def _posts(inbox: Inbox, topics: Topics, messages: Iterable[Message]) -> Iterator[_Post]:
    """Posts of messages, those of one camera together; what holds no track is settled."""
    of_camera: dict[str, _Post] = {}
    idle: list[Message] = []
    for message in messages:
        try:
            found = topics.read(message.topic, message.payload)
        except MessageError as error:
            extra = {"topic": message.topic, "code": error.code, "detail": error.detail}
            log.warning("mqtt_message_refused", extra=extra)
            found = None
        if found is None:
            idle.append(message)
        elif isinstance(found, str):
            yield _Post(found, message.payload, messages=[message])
        else:
            post = of_camera.setdefault(found.camera, _Post(found.camera))
            post.tracks.append(found)
            post.messages.append(message)
            size = sum(len(each.payload) for each in post.messages)
            if len(post.tracks) == _MOST_TRACKS or size >= _MOST_BYTES:
                yield of_camera.pop(found.camera)
    inbox.settle(idle)
    yield from of_camera.values()


def _post_all(inbox: Inbox, posts: list[_Post], service: Service) -> tuple[list[_Post], float]:
    """The posts that are to be made again, and how long the service wants to be left alone."""
    again: list[_Post] = []
    wait_s = 0.0
    for at, post in enumerate(posts):
        try:
            receipt = service.post_tracks(post.camera, _body(post, service))
            _tell_rejected(post.camera, receipt["rejected"])
        except RefusedError as error:
            _tell_refused(post, error)
        except LaterError as error:
            extra = {"camera_id": post.camera, "reason": str(error)}
            log.warning("tracks_wait", extra=extra)
            again.append(post)
            wait_s = max(wait_s, error.wait_s or 0.0)
            if error.away:
                return again + posts[at + 1 :], wait_s
            continue
        inbox.settle(post.messages)
    return again, wait_s


def _body(post: _Post, service: Service) -> bytes:
    """The body of a post; shares of the picture become pixels, counted from the first's centre."""
    if post.body is not None:
        return post.body
    width, height = service.size_of(post.camera)
    tracks = []
    for track in post.tracks:
        rows = zip(*(track.rows[at::3] for at in range(3)), strict=True)
        points = [(time_s, x * width - 0.5, y * height - 0.5) for time_s, x, y in rows]
        tracks.append({"id": track.track_id, "class": track.label, "points": points})
    return msgspec.json.encode({"source": frigate.SOURCE, "tracks": tracks})


def _tell_rejected(camera: str, rejected: list[dict[str, str]]) -> None:
    if rejected:
        codes = dict(Counter(each["code"] for each in rejected))
        extra = {"camera_id": camera, "codes": codes, "first": rejected[0]["detail"]}
        log.info("tracks_rejected", extra=extra)


def _tell_refused(post: _Post, error: RefusedError) -> None:
    # People who passed too shortly are everyday's.
    level = logging.INFO if error.code == "nothing_taken" else logging.WARNING
    extra = {"status": error.status, "code": error.code, "detail": error.detail}
    count = len(post.messages)
    log.log(level, "tracks_refused", extra={"camera_id": post.camera, "messages": count, **extra})
