"""ONVIF's scene description, as XML (RTP, Milestone) and as JSON (MQTT, `onvif-mj`).

What the numbers of a box are, devices do not agree on: a profile is declared for each camera.
"""

from collections.abc import Callable
from enum import StrEnum
from functools import partial
from typing import Any, TypeAlias
from xml.sax import SAXException
from xml.sax.handler import ContentHandler
from xml.sax.xmlreader import AttributesImpl

from defusedxml import DefusedXmlException
from defusedxml.sax import parseString

from surefoot.bridge.values import (
    NORMALISED,
    Box,
    Detection,
    Ended,
    MessageError,
    SkippedRow,
    box_of,
    check_size,
    each_row,
    moment,
    number,
    parsed_json,
    table,
    text,
)
from surefoot.nesting import MAX_LEVELS

_Found: TypeAlias = Detection | Ended | SkippedRow
_Node: TypeAlias = dict[str, Any]
_Place: TypeAlias = Callable[[float, float], tuple[float, float]]
_TEXT = "#text"
_BEFORE_XML = b"\xef\xbb\xbf \t\r\n"  # XML with a declaration has to begin with it
# A metadata stream without frames: events and positions come by themselves.
_STREAM_PARTS = frozenset({"Frame", "VideoAnalytics", "Event", "NotificationMessage", "PTZ"})
_GRID = 8192.0


class Profile(StrEnum):
    """The numbers of a camera's boxes."""

    NORMALISED = "normalised"  # -1 to 1, y up, whatever Transformation stands beside them
    TRANSFORMED = "transformed"  # the frame's Transformation makes them so, as the standard says
    NORMALISED_DOWN = "normalised-down"  # -1 to 1, y down
    SHARES = "shares"  # 0 to 1, y down
    GRID = "grid"  # 0 to 8192, y down, without a Transformation: Dahua


def is_xml(message: bytes) -> bool:
    """Return whether a message is XML rather than JSON."""
    return message.lstrip(_BEFORE_XML)[:1] == b"<"


def read_xml(message: bytes, camera: str, profile: Profile) -> list[_Found]:
    """Read the frames of XML: of a `Frame`, a `MetadataStream`, or an envelope around one.

    Prefixes of names are ignored, declared or not.

    Raises:
        MessageError: the XML has no scene description, or boxes that are not those of the profile.
    """
    check_size(message)
    builder = _Builder()
    try:
        parseString(message.lstrip(_BEFORE_XML), builder, forbid_dtd=True)
    except DefusedXmlException as error:
        raise MessageError("unsupported", f"XML with a DTD is not allowed: {error}") from error
    except (SAXException, ValueError, LookupError) as error:
        raise MessageError("malformed", f"no XML: {error}") from error
    return _read(builder.root, camera, profile)


def read_json(message: bytes, camera: str, profile: Profile) -> list[_Found]:
    """Read the frames of JSON: `{"Frame": [...]}`, or an envelope around it.

    Attributes begin with @, and repeated elements are in lists.

    Raises:
        MessageError: the JSON has no scene description, or boxes that are not those of the profile.
    """
    return _read(_without_prefixes(table(parsed_json(message), "message")), camera, profile)


def _read(root: _Node, camera: str, profile: Profile) -> list[_Found]:
    found: list[_Found] = []
    for frame in _frames_in(root):
        time_s = moment(_attribute(frame, "UtcTime"), "Frame/@UtcTime")
        place = _place_of(frame, profile)
        person = partial(_detection, camera=camera, time_s=time_s, place=place, profile=profile)
        found += each_row(_all(frame, "Object"), "Object", person)
        for tree in _all(frame, "ObjectTree"):
            gone = _all(tree, "Delete") + [_first(each, "from") for each in _all(tree, "Rename")]
            found += each_row(gone, "ObjectTree", partial(_ended, camera=camera))
    return found


def _frames_in(root: _Node) -> list[_Node]:
    """The frames of a message, however they are wrapped, in order.

    Raises:
        MessageError: there is none, nor anything else that a metadata stream consists of.
    """
    found: list[_Node] = []
    names: set[str] = set()
    waiting: list[Any] = [root]
    while waiting:
        node = waiting.pop()
        if isinstance(node, list):
            waiting += reversed(node)
        elif isinstance(node, dict):
            names |= node.keys()
            found += _all(node, "Frame")
            waiting += reversed([value for name, value in node.items() if name != "Frame"])
    if found or names & _STREAM_PARTS:
        return found
    got = ", ".join(sorted(names))
    raise MessageError("malformed", f"ONVIF: a Frame is needed, got {got:.120}")


def _detection(
    each: _Node, where: str, *, camera: str, time_s: float, place: _Place, profile: Profile
) -> Detection | None:
    # A head or a face of a person that is in the frame itself.
    if _attribute(each, "Parent") is not None:
        return None
    look = _first(each, "Appearance")
    edges = _first(_first(look, "Shape"), "BoundingBox")
    if not edges:
        return None
    if profile is Profile.TRANSFORMED and _first(look, "Transformation"):
        words = "Appearance/Transformation: only the frame's own is supported"
        raise MessageError("unsupported", f"{where}/{words}")
    track_id = text(_attribute(each, "ObjectId"), f"{where}/@ObjectId")
    return Detection(camera, time_s, track_id, _label(look), _box(edges, place, where), NORMALISED)


def _ended(each: _Node, where: str, *, camera: str) -> Ended:
    return Ended(camera, text(_attribute(each, "ObjectId"), f"{where}/@ObjectId"))


def _place_of(frame: _Node, profile: Profile) -> _Place:
    """How a point of a frame's boxes becomes shares of the picture, y down."""
    if profile is Profile.GRID:
        return lambda x, y: (x / _GRID, y / _GRID)
    if profile is Profile.SHARES:
        return lambda x, y: (x, y)
    if profile is Profile.NORMALISED_DOWN:
        return lambda x, y: ((x + 1) / 2, (y + 1) / 2)
    scale_x = scale_y = 1.0
    shift_x = shift_y = 0.0
    if profile is Profile.TRANSFORMED:
        given = _first(frame, "Transformation")
        if not given:
            raise MessageError(
                "malformed", "Transformation: one is needed by this camera's profile, got none"
            )
        scale, shift = _first(given, "Scale"), _first(given, "Translate")
        if scale:
            scale_x, scale_y = _pair(scale, "Scale")
        if shift:
            shift_x, shift_y = _pair(shift, "Translate")
    return lambda x, y: (
        (x * scale_x + shift_x + 1) / 2,
        (1 - y * scale_y - shift_y) / 2,
    )


def _box(edges: _Node, place: _Place, where: str) -> Box:
    left, top, right, bottom = (
        number(_attribute(edges, name), f"{where}/BoundingBox/@{name}")
        for name in ("left", "top", "right", "bottom")
    )
    # As it is placed, the top lies above the bottom: otherwise this is another profile's box, whose
    # feet would be taken for a head.
    return box_of((*place(left, top), *place(right, bottom)), f"{where}/BoundingBox")


def _pair(node: _Node, what: str) -> tuple[float, float]:
    x, y = _attribute(node, "x"), _attribute(node, "y")
    return number(x, f"{what}/@x"), number(y, f"{what}/@y")


def _label(look: _Node) -> str | None:
    """The likeliest class: `Class/Type` with its likelihood, `Class/ClassCandidate` before 2.4."""
    kinds = _first(look, "Class")
    named = [
        (_attribute(each, "Likelihood", 0), each.get(_TEXT, each.get("$")))
        for each in _all(kinds, "Type")
    ]
    for each in _all(kinds, "ClassCandidate"):
        likelihood = _first(each, "Likelihood").get(_TEXT, 0)
        named.append((likelihood, _first(each, "Type").get(_TEXT)))
    if not named:
        return None
    likeliest = max(named, key=lambda each: number(each[0], "Class/@Likelihood"))
    return text(likeliest[1], "Class/Type")


def _all(node: _Node, name: str) -> list[_Node]:
    """The elements of that name; JSON has one alone, or a bare text, without a list, too."""
    found = node.get(name)
    several = found if isinstance(found, list) else [] if found is None else [found]
    return [each if isinstance(each, dict) else {_TEXT: each} for each in several]


def _attribute(node: _Node, name: str, default: Any = None) -> Any:
    """An attribute of an element; some converters to JSON leave out its @."""
    return node.get(f"@{name}", node.get(name, default))


def _first(node: _Node, name: str) -> _Node:
    return next(iter(_all(node, name)), {})


def _without_prefixes(value: Any) -> Any:
    """JSON with the names of its fields as XML has them without their prefixes.

    `parsed_json` has limited how deeply the value is nested.
    """
    if isinstance(value, list):
        return [_without_prefixes(each) for each in value]
    if not isinstance(value, dict):
        return value
    return {_local(name): _without_prefixes(each) for name, each in value.items()}


def _local(name: str) -> str:
    """A name without its prefix; attributes keep their @."""
    return ("@" if name[:1] == "@" else "") + name.lstrip("@").rpartition(":")[2]


class _Builder(ContentHandler):
    """Builds the nodes of an XML document as the standard writes them in JSON."""

    def __init__(self) -> None:
        super().__init__()
        self.root: _Node = {}
        self._open: list[_Node] = [self.root]

    def startElement(self, name: str, attrs: AttributesImpl) -> None:
        if len(self._open) > MAX_LEVELS:
            raise MessageError("too_deep", f"at most {MAX_LEVELS} nested levels")
        node: _Node = {f"@{_local(each)}": value for each, value in attrs.items()}
        self._open[-1].setdefault(_local(name), []).append(node)
        self._open.append(node)

    def endElement(self, name: str) -> None:
        node = self._open.pop()
        words = "".join(node.pop(_TEXT, ())).strip()
        if words:
            node[_TEXT] = words

    def characters(self, content: str) -> None:
        # Joined at the end: text that many comments split would be copied once for each.
        self._open[-1].setdefault(_TEXT, []).append(content)
