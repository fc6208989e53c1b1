"""The language that words are said in: English, but of pages the one that their reader wants.

Texts stand in English in the code, in `_`; a catalogue has them in other languages.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import cache
from gettext import GNUTranslations, NullTranslations
from io import BytesIO
from pathlib import Path
from string import Formatter
from typing import Any

from babel.messages.catalog import Catalog
from babel.messages.mofile import write_mo
from babel.messages.pofile import read_po

ENGLISH = "en"
LANGUAGES = {ENGLISH: "English", "de": "Deutsch"}  # as they call themselves
CATALOGUES = Path(__file__).parent / "locale"
_POINTS_AND_COMMAS = str.maketrans(".,", ",.")
_spoken = ContextVar("language", default=ENGLISH)


def spoken() -> str:
    """The language by its code."""
    return _spoken.get()


@contextmanager
def speaking(language: str) -> Iterator[None]:
    """Say all in a language meanwhile, in this task or thread and in those that it starts."""
    token = _spoken.set(language)
    try:
        yield
    finally:
        _spoken.reset(token)


def N_(text: str) -> str:
    """The text as it stands, which `_` will be asked for later."""
    return text


def gettext(text: str) -> str:
    """A text in the language, with its placeholders."""
    return _translations(spoken()).gettext(text) if text else ""


def ngettext(one: str, many: str, n: int) -> str:
    """A text of one or of many in the language, with its placeholders."""
    return _translations(spoken()).ngettext(one, many, n)


def _(text: str, /, **values: Any) -> str:
    """A text in the language, with values in their places."""
    said = gettext(text)
    return _FORMATS[spoken()](said, **values) if values else said


def _n(one: str, many: str, n: int, /, **values: Any) -> str:
    """A text of one or of many in the language, with `n` and other values in their places."""
    return _FORMATS[spoken()](ngettext(one, many, n), n=n, **values)


def inner(text: str) -> str:
    """A text within a sentence: small where the language has no capitals there."""
    return text.lower() if spoken() == ENGLISH else text


def number(value: float, spec: str) -> str:
    """A number as `format` has it, with the language's decimal sign."""
    return _FORMATS[spoken()](f"{{:{spec}}}", value)


def script_words() -> dict[str, str]:
    """The texts of the pages' scripts in the language, by what they are in English."""
    return {} if spoken() == ENGLISH else _script_words(spoken())


class _CommaFormatter(Formatter):
    """`str.format` with decimal commas in numbers."""

    def format_field(self, value: Any, format_spec: str) -> str:
        text: str = format(value, format_spec)
        return text.translate(_POINTS_AND_COMMAS) if isinstance(value, int | float) else text


_FORMATS: dict[str, Callable[..., str]] = {ENGLISH: str.format, "de": _CommaFormatter().format}


@cache
def _script_words(language: str) -> dict[str, str]:
    words: dict[str, str] = {}
    for message in _catalogue(language):
        if any(path.endswith(".js") for path, _line in message.locations):
            texts, said = (
                [each] if isinstance(each, str) else each or []
                for each in (message.id, message.string)
            )
            words |= zip(texts, said, strict=True)
    return words


@cache
def _catalogue(language: str) -> Catalog:
    path = CATALOGUES / language / "LC_MESSAGES" / "surefoot.po"
    with path.open("rb") as file:
        return read_po(file, language)


@cache
def _translations(language: str) -> NullTranslations:
    if language == ENGLISH:
        return NullTranslations()
    compiled = BytesIO()
    write_mo(compiled, _catalogue(language))
    compiled.seek(0)
    return GNUTranslations(compiled)
