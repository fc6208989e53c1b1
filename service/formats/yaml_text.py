"""YAML text with values replaced in place; every other character stays as it came.

The text is parsed into nodes, which know their position in it. Values are never constructed, so
that a scalar such as `007`, `1:30` or `!!int ""` keeps its spelling and cannot fail to convert.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import yaml

from surefoot.nesting import MAX_LEVELS, too_deep

MAX_BYTES = 64 * 1024  # PyYAML holds the interpreter lock for about 1 ms per KiB
_MERGE = "<<"
_KEY_MARK = re.compile(r"(?:^|[{,\s])(?P<mark>\?[ \t]+)$")


@dataclass(frozen=True, slots=True, kw_only=True)
class YamlText:
    """A document and its pending edits: replaced ranges of text, and removed keys of mappings."""

    text: str
    root: yaml.Node | None
    _edits: list[tuple[int, int, str]] = field(default_factory=list)
    _removed: list[tuple[yaml.MappingNode, yaml.Node]] = field(default_factory=list)

    @classmethod
    def of(cls, text: str) -> "YamlText":
        """Parse a text that `read_yaml_text` returned.

        Raises:
            yaml.YAMLError: the text is not one document of YAML.
        """
        return cls(text=text, root=yaml.compose(text, Loader=yaml.CSafeLoader))

    def source(self, node: yaml.Node) -> str:
        """The text of a node, with its quotes, anchor and tag."""
        return self.text[node.start_mark.index : node.end_mark.index]

    def replace_scalar(self, node: yaml.ScalarNode, value: str) -> None:
        """Replace the value of a scalar, and keep its quotes. `value` needs no escaping."""
        quote = node.style if node.style in ("'", '"') else ""
        self._replace(node, self._content_end(node), f"{quote}{value}{quote}")

    def replace_items(self, node: yaml.SequenceNode, values: Sequence[str]) -> None:
        """Replace the items of a sequence of scalars; comments stay if their number is the same."""
        if len(values) == len(node.value):
            for item, value in zip(node.value, values, strict=True):
                self.replace_scalar(item, value)
        elif node.flow_style:
            quoted = ", ".join(f'"{value}"' for value in values)
            self._replace(node, node.end_mark.index, f"[{quoted}]")
        else:
            indent = "\n" + " " * node.start_mark.column + "- "
            self._replace(node, self._content_end(node), "- " + indent.join(values))

    def remove(self, mapping: yaml.MappingNode, key: yaml.Node) -> None:
        """Remove a key and its value. A mapping that loses all keys becomes `{}`."""
        self._removed.append((mapping, key))

    def edited(self) -> str:
        """The text after all edits."""
        edits = sorted([*self._cuts(), *self._edits])
        parts, at = [], 0
        for start, end, replacement in edits:
            if start < at:
                continue  # within a part that is removed
            parts += [self.text[at:start], replacement]
            at = end
        return "".join(parts) + self.text[at:]

    def _replace(self, node: yaml.Node, end: int, text: str) -> None:
        self._edits.append((node.start_mark.index, end, text))

    def _cuts(self) -> Iterator[tuple[int, int, str]]:
        for mapping in {id(mapping): mapping for mapping, _ in self._removed}.values():
            removed = {id(key) for of, key in self._removed if of is mapping}
            if len(removed) == len(mapping.value):
                yield mapping.start_mark.index, self._content_end(mapping), "{}"
                continue
            kept = False  # whether an entry that stays comes before
            for number, (key, value) in enumerate(mapping.value):
                if id(key) not in removed:
                    kept = True
                elif not mapping.flow_style:
                    yield self._line_start(key), self._line_end(self._content_end(value)), ""
                elif kept:
                    before = mapping.value[number - 1][1]
                    yield self._content_end(before), self._content_end(value), ""
                else:
                    after = mapping.value[number + 1][0]
                    yield self._entry_start(key), self._entry_start(after), ""

    def _content_end(self, node: yaml.Node) -> int:
        """The end of what a node holds; the mark of a block is after the comments that follow."""
        while isinstance(node, yaml.CollectionNode) and not node.flow_style:
            last = node.value[-1]
            child = last[1] if isinstance(node, yaml.MappingNode) else last
            if not is_within(child, node):  # an alias: the mark of its target is elsewhere
                lines = self.text[: node.end_mark.index].splitlines(keepends=True)
                while not lines[-1].strip() or lines[-1].lstrip().startswith("#"):
                    lines.pop()
                return len("".join(lines).rstrip())
            node = child
        end = int(node.end_mark.index)
        if isinstance(node, yaml.ScalarNode) and node.style in ("|", ">"):
            return len(self.text[:end].rstrip())  # its mark is after its line breaks
        return end

    def _entry_start(self, key: yaml.Node) -> int:
        """The start of a key, or of the `?` before it on its line."""
        start = self.text.rfind("\n", 0, key.start_mark.index) + 1
        mark = _KEY_MARK.search(self.text[start : key.start_mark.index])
        return int(key.start_mark.index) if mark is None else start + mark.start("mark")

    def _line_start(self, key: yaml.Node) -> int:
        at = self._entry_start(key)
        start = self.text.rfind("\n", 0, at) + 1
        return at if self.text[start:at].strip() else start

    def _line_end(self, at: int) -> int:
        """The end of a line, after a comment and the line break."""
        end = self.text.find("\n", at)
        return len(self.text) if end < 0 else end + 1


def read_yaml_text(body: bytes) -> str:
    """Return the text of a body of YAML, after checks that bound the cost of parsing it.

    Nested brackets cost the square of their depth (64 KiB of them half an hour).

    Raises:
        ValueError: the body is not UTF-8 or not YAML, or nested too deep. `yaml.YAMLError` is not
            raised.
    """
    text = body.decode("utf-8-sig")
    depth = 0
    try:
        for event in yaml.parse(text, Loader=yaml.CSafeLoader):
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_LEVELS:
                raise too_deep()
        YamlText.of(text)  # one document, with no alias of an unknown anchor
    except yaml.YAMLError as error:
        raise ValueError(str(error)) from error
    return text


def value_of(mapping: yaml.Node | None, name: str) -> yaml.Node | None:
    """The value of a key, also of one that a merge (`<<`) adds; None if there is none.

    Raises:
        ValueError: the mapping has the key twice.
    """
    seen: set[int] = set()
    waiting = [mapping]
    while waiting:
        node = waiting.pop(0)
        if not isinstance(node, yaml.MappingNode) or id(node) in seen:
            continue
        seen.add(id(node))
        found = [value for key, value in node.value if key.value == name]
        if len(found) > 1:
            raise ValueError(f"{name} appears {len(found)} times, once is needed")
        if found:
            return found[0]
        for key, value in node.value:
            if key.value == _MERGE:
                waiting += value.value if isinstance(value, yaml.SequenceNode) else [value]
    return None


def is_within(node: yaml.Node, parent: yaml.Node) -> bool:
    """True of a node that is written within another; false of the target of an alias."""
    starts = bool(parent.start_mark.index <= node.start_mark.index)
    return starts and bool(node.end_mark.index <= parent.end_mark.index)


def has_anchor(text: str, node: yaml.Node) -> bool:
    """True if a node, or a node in it, has an anchor that an alias elsewhere may use."""
    start, end = node.start_mark.index, node.end_mark.index
    return "&" in text[start:end] and any(
        getattr(event, "anchor", None)
        and not isinstance(event, yaml.AliasEvent)
        and start <= event.start_mark.index < end
        for event in yaml.parse(text, Loader=yaml.CSafeLoader)
    )
