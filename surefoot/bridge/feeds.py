"""Which topics are of which format and camera, as settings say it, and their messages read."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from paho.mqtt.client import topic_matches_sub

from surefoot.bridge import axis, deepstream, frames, frigate, onvif
from surefoot.bridge.camera_names import camera_id_of
from surefoot.bridge.values import Found, MessageError, check_size

_CAMERA = re.compile(r"[a-z0-9][a-z0-9-]{0,62}")
_SIZE = re.compile(r"([1-9][0-9]{0,5})x([1-9][0-9]{0,5})")
_FORMATS = ", ".join(
    ["axis", *(f"onvif-{profile}" for profile in onvif.Profile), "deepstream-1920x1080"]
)
_CHANNELS = range(2, 9)  # of a device with several sensors
_MOST_KNOWN = 10_000  # topics whose feed is remembered

_BODIES = ""

# What a message holds, by the name of the camera that its topic has and what that is called here.
_Read = Callable[[bytes, str, Callable[[str], str]], list[Found]]


@dataclass(frozen=True)
class Feed:
    """A topic to ask for; a camera's name is `name`, or stands at the topic's first `+`."""

    source: str
    topic: str
    read: _Read
    name: str | None = None

    def name_in(self, topic: str) -> str:
        """The camera's name by a topic that came."""
        if self.name is not None:
            return self.name
        parts = self.topic.split("/")
        return topic.split("/")[parts.index("+")] if "+" in parts else ""


@dataclass(frozen=True)
class Body:
    """A body of tracks that is posted as it is."""

    camera: str
    content: bytes


@dataclass(frozen=True, kw_only=True)
class Topics:
    """Where tracks come in; `cameras` maps sources' names of cameras to ours."""

    prefix: str
    frigate: str | None
    cameras: Mapping[str, str]
    feeds: tuple[Feed, ...] = ()
    _known: dict[str, Feed | None] = field(default_factory=dict)

    @property
    def asked_for(self) -> list[str]:
        """Topics to subscribe to."""
        return [feed.topic for feed in self._all]

    @cached_property
    def _all(self) -> list[Feed]:
        bodies = Feed(_BODIES, f"{self.prefix}/+/tracks", _nothing)
        plain = Feed("frames", f"{self.prefix}/+/frames", _read_frames)
        events = [] if self.frigate is None else [Feed("frigate", f"{self.frigate}/events", _event)]
        return [bodies, plain, *events, *self.feeds]

    def read(self, topic: str, message: bytes) -> tuple[str, list[Found]] | Body:
        """The source of a message and what it holds, or the body that it is.

        Raises:
            MessageError: it is not what its topic is for.
        """
        feed = self._feed_of(topic)
        if feed is None:
            return "", []
        name = feed.name_in(topic)
        if feed.source == _BODIES:
            check_size(message)
            return Body(_checked(name), message)
        return feed.source, feed.read(message, name, self.camera_of)

    def _feed_of(self, topic: str) -> Feed | None:
        if topic not in self._known:
            if len(self._known) >= _MOST_KNOWN:
                self._known.clear()
            found = (each for each in self._all if topic_matches_sub(each.topic, topic))
            self._known[topic] = next(found, None)
        return self._known[topic]

    def camera_of(self, name: str) -> str:
        """The camera id for a source's name of a camera."""
        return _checked(camera_id_of(name, self.cameras))


def read_feeds(setting: str) -> tuple[Feed, ...]:
    """Feeds of `format:topic[=name]`, with commas.

    Raises:
        ValueError: a part is none.
    """
    return tuple(_feed(part.strip()) for part in setting.split(",") if part.strip())


def _feed(part: str) -> Feed:
    kind, colon, rest = part.partition(":")
    topic, _, name = rest.partition("=")
    source, _, how = kind.partition("-")
    read: _Read | None = None
    if kind == "axis":
        read = _read_axis
    elif source == "onvif" and how in list(onvif.Profile):
        read = _onvif_reader(onvif.Profile(how))
    elif source == "deepstream" and (size := _SIZE.fullmatch(how)):
        read = _deepstream_reader((float(size[1]), float(size[2])))
    if read is None or not colon or not topic:
        raise ValueError(f"format:topic with a format of {_FORMATS} is needed, got {part!r:.80}")
    if source != "deepstream" and not name and "+" not in topic.split("/"):
        raise ValueError(f"a camera, by + in the topic or =name, is needed, got {part!r:.80}")
    return Feed(source, topic, read, name or None)


def _read_axis(message: bytes, name: str, camera_of: Callable[[str], str]) -> list[Found]:
    channels = {1: camera_of(name)}
    for number in _CHANNELS:
        channels[number] = f"{channels[1][:60]}-{number}"
    return list(axis.read_message(message, channels))


def _onvif_reader(profile: onvif.Profile) -> _Read:
    def read(message: bytes, name: str, camera_of: Callable[[str], str]) -> list[Found]:
        reader = onvif.read_xml if onvif.is_xml(message) else onvif.read_json
        return list(reader(message, camera_of(name), profile))

    return read


def _deepstream_reader(size: tuple[float, float]) -> _Read:
    def read(message: bytes, _: str, camera_of: Callable[[str], str]) -> list[Found]:
        return list(deepstream.read_message(message, camera_of, size))

    return read


def _read_frames(message: bytes, name: str, camera_of: Callable[[str], str]) -> list[Found]:
    return list(frames.read_frame(message, camera_of(name)))


def _event(message: bytes, _: str, camera_of: Callable[[str], str]) -> list[Found]:
    track = frigate.read_event(message, camera_of)
    return [] if track is None else [track]


def _nothing(_: bytes, __: str, ___: Callable[[str], str]) -> list[Found]:
    return []


def _checked(camera: str) -> str:
    if not _CAMERA.fullmatch(camera):
        needed = "lower case letters, digits and hyphens are needed"
        raise MessageError("malformed", f"camera: {needed}, got {camera!r:.80}")
    return camera
