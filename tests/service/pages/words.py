"""The words of a page that stand outside of brackets: those that came through no catalogue."""

import re
from gettext import NullTranslations
from html.parser import HTMLParser

_SAID = ("aria-label", "title", "placeholder", "alt", "data-word", "label")
_EMPTY = {"br", "hr", "img", "input", "link", "meta", "path", "circle", "rect", "use", "image"}
# Names, units, and what is the same in every language; codes with an underscore.
_NO_WORDS = re.compile(
    r"\b(surefoot|API|English|Deutsch|webhook|UTC|Z|m|px|s|h|x|y|t|R|JSON|CSV|ROS|COLMAP|GeoJSON"
    r"|NVIDIA|OpenCV|Frigate|Axis|NDJSON|alertmanager|https://\S+)\b|\b\w+_\w+\b|\+Y|sf_\w+"
)


class Bracketing(NullTranslations):
    """A language in which every text is itself, in brackets."""

    def gettext(self, message: str) -> str:
        return f"⟦{message}⟧"

    def ngettext(self, msgid1: str, msgid2: str, n: int) -> str:
        return f"⟦{msgid1 if n == 1 else msgid2}⟧"


class _Reader(HTMLParser):
    """Reads what a person sees or hears of a page; not code, times, and what is not translated."""

    def __init__(self, data: tuple[str, ...]) -> None:
        super().__init__()
        self._data = data
        self._open: list[tuple[str, bool]] = []
        self._depth = 0
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        silent = tag in ("script", "style", "code", "pre", "var", "time") or (
            given.get("translate") == "no"
        )
        if tag not in _EMPTY:
            self._open.append((tag, silent))
        for name in _SAID:
            depth, self._depth = self._depth, 0
            self._look(given.get(name) or "")
            self._depth = depth

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in _EMPTY:
            self._open.pop()

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop()[0] != tag:
            pass

    def handle_data(self, data: str) -> None:
        if any(silent for _, silent in self._open):
            return
        self._look(data)

    def _look(self, text: str) -> None:
        outside = ""
        for sign in text:
            self._depth += {"⟦": 1, "⟧": -1}.get(sign, 0)
            outside += sign if self._depth == 0 and sign != "⟧" else " "
        outside = _NO_WORDS.sub("", outside)
        for name in self._data:
            outside = outside.replace(name, "")
        if re.search(r"[^\W\d_]", outside):
            self.found.append(outside.strip())


def outside_brackets(page: str, data: tuple[str, ...] = ()) -> list[str]:
    """What stands outside of brackets in a page, but for `data`, such as names of cameras."""
    reader = _Reader(data)
    reader.feed(page)
    assert reader._depth == 0
    return reader.found
