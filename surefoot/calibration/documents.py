"""Bytes of a calibration file to plain values: YAML, JSON, XML, or named texts of an archive.

Scalars of YAML and XML stay text; `fields.numbers` reads them. Nothing is constructed by a tag.
"""

import io
import json
import re
import zipfile
from collections.abc import Iterator
from typing import Any, Never
from xml.etree.ElementTree import Element, ParseError

import numpy as np
import yaml
from defusedxml import DefusedXmlException
from defusedxml.ElementTree import fromstring

from surefoot.calibration.value import CalibrationFileError

MAX_BYTES = 4 * 1024 * 1024
MAX_DEPTH = 32  # lists or tags in each other; OpenCV itself writes 4
_MOST_SCALARS = 500_000
_OPENING = re.compile(rb"(?P<open>[\[{]|<[A-Za-z_])|(?P<close>[\]}]|</|/>)")
_DIRECTIVE = re.compile(r"\A\s*%YAML[^\n]*\n")
_PARSER = getattr(yaml, "CBaseLoader", yaml.BaseLoader)  # libyaml's, where it is there

Document = dict[str, Any]


def check_size(body: bytes) -> None:
    """Reject a body that is too large, empty, or nested so deep that a parser overflows.

    Raises:
        CalibrationFileError: naming the limit.
    """
    if len(body) > MAX_BYTES:
        raise CalibrationFileError(f"file: must have at most {MAX_BYTES} bytes (got {len(body)})")
    if not body.strip():
        raise CalibrationFileError("file: is empty")
    if body.startswith(b"PK\x03\x04"):
        return
    if b"\0" in body:
        raise CalibrationFileError("file: must be text or a ZIP archive (got binary data)")
    depth = 0
    for found in _OPENING.finditer(body):
        depth = max(depth + (1 if found.lastgroup == "open" else -1), 0)
        if depth > MAX_DEPTH:
            _too_deep()


def archive_entries(body: bytes) -> dict[str, bytes]:
    """The files of a ZIP by their names without folders.

    Raises:
        CalibrationFileError: it is damaged, or larger than a calibration unpacked.
    """
    entries: dict[str, bytes] = {}
    left = MAX_BYTES
    try:
        with zipfile.ZipFile(io.BytesIO(body)) as archive:
            for info in archive.infolist():
                with archive.open(info) as packed:
                    content = packed.read(left + 1)
                left -= len(content)
                if left < 0:
                    raise CalibrationFileError(
                        f"file: must have at most {MAX_BYTES} bytes unpacked (got more)"
                    )
                entries[info.filename.rpartition("/")[2]] = content
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, OSError) as error:
        raise CalibrationFileError(f"file: damaged ZIP archive ({error})") from error
    return entries


def array_document(entries: dict[str, bytes]) -> Document:
    """The arrays of NumPy's `.npz` as lists; pickled ones are rejected.

    Raises:
        CalibrationFileError: naming the array.
    """
    found: Document = {}
    for name, content in entries.items():
        try:
            array = np.lib.format.read_array(io.BytesIO(content), allow_pickle=False)
        except ValueError as error:
            raise CalibrationFileError(f"{name}: must be an array of numbers ({error})") from error
        found[name.removesuffix(".npy")] = array.tolist()
    return found


def documents(text: str) -> tuple[str, list[Document]]:
    """The notation of a text (YAML, JSON or XML), and its documents with an object at the top.

    Raises:
        CalibrationFileError: it is none of the three, or nested too deep.
    """
    start = text.lstrip("\ufeff \t\r\n")
    if start.startswith("{") or start.startswith("[["):
        return "JSON", [_json(start)]
    if start.startswith("<"):
        return "XML", [_xml(start)]
    return "YAML", [each for each in _yaml(text.lstrip("\ufeff")) if isinstance(each, dict)]


def _json(text: str) -> Document:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise CalibrationFileError(f"file: damaged JSON ({error})") from error
    if not isinstance(value, dict):
        raise CalibrationFileError("file: must have a JSON object at the top (got a list)")
    return value


def _xml(text: str) -> Document:
    try:
        root = fromstring(text)
        value = _of_element(root)
    except (ParseError, DefusedXmlException, ValueError, LookupError, RecursionError) as error:
        raise CalibrationFileError(f"file: damaged XML ({error})") from error
    return value if isinstance(value, dict) else {root.tag: value}


def _of_element(element: Element) -> Any:
    """Text of a leaf; of others their attributes and children by name."""
    children = {child.tag: _of_element(child) for child in element}
    if children or element.attrib.keys() - {"type_id"}:
        return {**element.attrib, **children}
    return (element.text or "").strip()


def _yaml(text: str) -> list[Any]:
    """Values of all documents, by the parser's events: no tag, anchor or type is followed."""
    found: list[Any] = []
    stack: list[list[Any]] = []
    scalars = 0
    try:
        for event in _events(_DIRECTIVE.sub("", text)):
            if isinstance(event, yaml.AliasEvent):
                raise CalibrationFileError("file: YAML aliases are not taken")
            if isinstance(event, yaml.ScalarEvent):
                scalars += 1
                if scalars > _MOST_SCALARS:
                    raise CalibrationFileError(
                        f"file: must have at most {_MOST_SCALARS} values (got more)"
                    )
                (stack[-1] if stack else found).append(event.value)
            elif isinstance(event, yaml.SequenceStartEvent | yaml.MappingStartEvent):
                stack.append([])
                if len(stack) > MAX_DEPTH:
                    _too_deep()
            elif isinstance(event, yaml.SequenceEndEvent | yaml.MappingEndEvent):
                made: Any = stack.pop()
                if isinstance(event, yaml.MappingEndEvent):
                    made = {str(made[n]): made[n + 1] for n in range(0, len(made), 2)}
                (stack[-1] if stack else found).append(made)
    except yaml.YAMLError as error:
        problem = " ".join(str(error).split())[:200]
        raise CalibrationFileError(
            f"file: damaged YAML, and no other format ({problem})"
        ) from error
    return found


def _events(text: str) -> Iterator[Any]:
    yield from yaml.parse(text, Loader=_PARSER)


def _too_deep() -> Never:
    raise CalibrationFileError(f"file: lists or tags must be at most {MAX_DEPTH} in each other")
