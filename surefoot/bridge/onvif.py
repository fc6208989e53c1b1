"""ONVIF's scene description, as XML (RTP, Milestone) and as JSON (MQTT, `onvif-mj`).

What the numbers of a box are, devices do not agree on: a profile is declared for each camera.
"""

import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import Any, TypeAlias

from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

from surefoot.bridge.values import (
    NORMALISED,
    Box,
    Detection,
    Ended,
    MessageError,
    check_size,
    moment,
    number,
    parsed_json,
    table,
    text,
)

_Node: TypeAlias = dict[str, Any]
_Place: TypeAlias = Callable[[float, float], tuple[float, float]]
_DEEPEST = 12  # of elements within one another; a type of an object is the eighth
_GRID = 8192.0


class Profile(StrEnum):
    """The numbers of a camera's boxes."""

    NORMALISED = "normalised"  # -1 to 1, y up, whatever Transformation stands beside them
    TRANSFORMED = "transformed"  # the frame's Transformation makes them so, as the standard says
    GRID = "grid"  # 0 to 8192, y down, without a Transformation: Dahua


def read_xml(message: bytes, camera: str, profile: Profile) -> list[Detection | Ended]:
    """The detections and ends of a `MetadataStream`, or of a `Frame` alone.

    Raises:
        MessageError: it is none, or its boxes are not those of the profile.
    """
    check_size(message)
    try:
        root = fromstring(message, forbid_dtd=True)
    except DefusedXmlException as error:
        raise MessageError("unsupported", f"XML with a DTD is not taken: {error}") from error
    except (ET.ParseError, ValueError, LookupError) as error:
        raise MessageError("malformed", f"no XML: {error}") from error
    # A frame alone, in VideoAnalytics, or in VideoAnalytics of a MetadataStream.
    within = [root, *(child for child in root if _name(child) == "VideoAnalytics")]
    elements = [root] if _name(root) == "Frame" else [each for outer in within for each in outer]
    frames = (_node(each) for each in elements if _name(each) == "Frame")
    return _read(frames, camera, profile)


def read_json(message: bytes, camera: str, profile: Profile) -> list[Detection | Ended]:
    """The detections and ends of `{"Frame": [...]}`: attributes with @, repeated elements in lists.

    Raises:
        MessageError: it is none, or its boxes are not those of the profile.
    """
    return _read(_all(table(parsed_json(message), "message"), "Frame"), camera, profile)


def _read(frames: Iterable[_Node], camera: str, profile: Profile) -> list[Detection | Ended]:
    found: list[Detection | Ended] = []
    for frame in frames:
        time_s = moment(frame.get("@UtcTime"), "Frame/@UtcTime")
        place = _place_of(frame, profile)
        for each in _all(frame, "Object"):
            # A head or a face of a person that is there itself.
            if "@Parent" in each:
                continue
            look = _first(each, "Appearance")
            edges = _first(_first(look, "Shape"), "BoundingBox")
            if not edges:
                continue
            if profile is Profile.TRANSFORMED and _first(look, "Transformation"):
                words = "Appearance/Transformation: one of the frame alone is taken"
                raise MessageError("unsupported", words)
            track_id = text(each.get("@ObjectId"), "Object/@ObjectId")
            box = _box(edges, place)
            found.append(Detection(camera, time_s, track_id, _label(look), box, NORMALISED))
        for tree in _all(frame, "ObjectTree"):
            gone = _all(tree, "Delete") + [_first(each, "from") for each in _all(tree, "Rename")]
            found += [
                Ended(camera, text(each.get("@ObjectId"), "ObjectTree/@ObjectId")) for each in gone
            ]
    return found


def _place_of(frame: _Node, profile: Profile) -> _Place:
    """How a point of a frame's boxes becomes shares of the picture, y down."""
    if profile is Profile.GRID:
        return lambda x, y: (x / _GRID, y / _GRID)
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


def _box(edges: _Node, place: _Place) -> Box:
    left, top, right, bottom = (
        number(edges.get(f"@{name}"), f"BoundingBox/@{name}")
        for name in ("left", "top", "right", "bottom")
    )
    (x1, y1), (x2, y2) = place(left, top), place(right, bottom)
    return min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)


def _pair(node: _Node, what: str) -> tuple[float, float]:
    return number(node.get("@x"), f"{what}/@x"), number(node.get("@y"), f"{what}/@y")


def _label(look: _Node) -> str | None:
    """The likeliest class: `Class/Type` with its likelihood, `Class/ClassCandidate` before 2.4."""
    kinds = _first(look, "Class")
    named = [(each.get("@Likelihood", 0), each.get("#text")) for each in _all(kinds, "Type")]
    for each in _all(kinds, "ClassCandidate"):
        likelihood = _first(each, "Likelihood").get("#text", 0)
        named.append((likelihood, _first(each, "Type").get("#text")))
    if not named:
        return None
    likeliest = max(named, key=lambda each: number(each[0], "Class/@Likelihood"))
    return text(likeliest[1], "Class/Type")


def _all(node: _Node, name: str) -> list[_Node]:
    """The elements of that name; JSON has one alone, or a bare text, without a list, too."""
    found = node.get(name)
    several = found if isinstance(found, list) else [] if found is None else [found]
    return [each if isinstance(each, dict) else {"#text": each} for each in several]


def _first(node: _Node, name: str) -> _Node:
    return next(iter(_all(node, name)), {})


def _node(element: ET.Element, depth: int = 1) -> _Node:
    """An element as the standard writes it in JSON."""
    node: _Node = {f"@{name}": value for name, value in element.attrib.items()}
    if element.text and element.text.strip():
        node["#text"] = element.text.strip()
    if depth < _DEEPEST:
        for child in element:
            node.setdefault(_name(child), []).append(_node(child, depth + 1))
    return node


def _name(element: ET.Element) -> str:
    return str(element.tag).rpartition("}")[2]
