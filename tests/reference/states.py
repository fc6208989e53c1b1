"""The page of states and reasons, out of the service's vocabularies and codes."""

from enum import StrEnum
from inspect import cleandoc

from service import enums
from service.reasons import CODES
from tests.service.wording.test_reasons import SAID

_HEAD = """\
# States and reasons

The closed vocabularies of HTTP, webhooks and the store; [alerts](../guides/alerts.md) says what the
states and kinds mean. A `reason` is for people, and its wording may change; `reason_code` and
`reason_values` are for programs, and stay.

## Vocabularies

"""
_REASONS = """
## Reasons

The first of the reasons gives `reason_code` and `reason_values`, over HTTP with angles in degrees.
The sentence is an example.

| Code | Values | Sentence |
|---|---|---|
"""


def states_page() -> str:
    """Each vocabulary with its words, each code with its values and a sentence."""
    every = [
        each
        for each in vars(enums).values()
        if isinstance(each, type) and issubclass(each, StrEnum) and each is not StrEnum
    ]
    return _HEAD + "\n".join(map(_vocabulary, every)) + _REASONS + "".join(map(_reason, CODES))


def _vocabulary(words: type[StrEnum]) -> str:
    said = ", ".join(f"`{word}`" for word in words)
    return f"**{words.__name__}**. {cleandoc(words.__doc__ or '')} {said}.\n"


def _reason(code: str) -> str:
    cases = [(values, sentence) for each, values, sentence in SAID if str(each) == code]
    values = ", ".join(f"`{name}`" for name in _in_http(sorted({n for v, _ in cases for n in v})))
    return f"| `{code}` | {values} | {cases[0][1]} |\n"


def _in_http(names: list[str]) -> list[str]:
    return [f"{name.removesuffix('_rad')}_deg" if name.endswith("_rad") else name for name in names]
