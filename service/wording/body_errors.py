"""Errors of a body in plain words: the field, its limit and the value received."""

import re
import reprlib
from collections.abc import Iterable
from datetime import date
from typing import Any

from pydantic_core import ErrorDetails

from service.errors import FieldError
from service.wording.language import N_, _

_TIME = N_("must be an RFC 3339 time with a zone, for example 2026-11-20T08:00:00Z (got {got})")
# By pydantic's type of error; `got` is the value received.
_REASONS = {
    "missing": N_("is required"),
    "int_from_float": N_("must be a whole number (got {got})"),
    "int_parsing": N_("must be a whole number (got {got})"),
    "int_type": N_("must be a whole number (got {got})"),
    "float_parsing": N_("must be a number (got {got})"),
    "float_type": N_("must be a number (got {got})"),
    "finite_number": N_("must be a finite number (got {got})"),
    "greater_than": N_("must be more than {gt} (got {got})"),
    "greater_than_equal": N_("must be at least {ge} (got {got})"),
    "less_than": N_("must be less than {lt} (got {got})"),
    "less_than_equal": N_("must be at most {le} (got {got})"),
    "too_short": N_("must have at least {min_length} items (got {actual_length})"),
    "too_long": N_("must have at most {max_length} items (got {actual_length})"),
    "string_too_short": N_("must have at least {min_length} characters (got {got})"),
    "string_too_long": N_("must have at most {max_length} characters (got {got})"),
    "string_pattern_mismatch": N_(
        "may have only lower-case letters, digits and hyphens (got {got})"
    ),
    "string_type": N_("must be text (got {got})"),
    "bool_type": N_("must be true or false (got {got})"),
    "bool_parsing": N_("must be true or false (got {got})"),
    "list_type": N_("must be a list (got {got})"),
    "dict_type": N_("must be an object (got {got})"),
    "model_attributes_type": N_("must be an object (got {got})"),
    "model_type": N_("must be an object (got {got})"),
    "datetime_type": _TIME,
    "datetime_parsing": _TIME,
    "datetime_from_date_parsing": _TIME,
    "timezone_aware": _TIME,
    "int_parsing_size": N_("must be a smaller whole number (got {got})"),
    "json_invalid": N_("is not JSON: {error}"),
    "enum": N_("must be {expected} (got {got})"),
    "literal_error": N_("must be {expected} (got {got})"),
}
_SECRET = ("snapshot_credentials", "password", "token")  # fields that no answer repeats
_HIDDEN = "***"
_FOLLOWS = "default_factory_not_called"  # from the error of another field
_GOT = re.compile(r"\bgot\b")
_NAMED = re.compile(r"([a-z][a-z0-9_]*): (.*)", re.DOTALL)
_LIMITS = frozenset(("gt", "ge", "lt", "le"))  # numbers or dates
_MOST_CHARACTERS = 80
_BRIEF = reprlib.Repr()
_BRIEF.maxstring = _MOST_CHARACTERS


def field_errors(items: Iterable[ErrorDetails]) -> tuple[FieldError, ...]:
    """The errors of a body, each at its field."""
    return tuple(_field_error(item) for item in items if item["type"] != _FOLLOWS)


def _field_error(item: ErrorDetails) -> FieldError:
    pointer = "".join(f"/{part}" for part in item["loc"] if part != "body")
    context: dict[str, Any] = dict(item.get("ctx", {}))
    for name in _LIMITS & context.keys():
        context[name] = _brief(context[name])
    got = _HIDDEN if any(part in _SECRET for part in item["loc"]) else item.get("input")
    if item["type"] in _REASONS:
        words = _REASONS[item["type"]]
        limits = {name: _limit(value) for name, value in context.items()}
        reason = _(words, **{"got": _brief(got), **limits})
    else:
        reason = str(context.get("error", item["msg"]))  # one of our own has `said`: it is whole
        # The checks of an object name the field that they reject.
        if isinstance(got, dict) and (named := _NAMED.fullmatch(reason)):
            if not pointer.endswith(f"/{named[1]}"):
                pointer = f"{pointer}/{named[1]}"
            reason = named[2]
        elif "said" not in context and not _GOT.search(reason) and not isinstance(got, dict | list):
            reason = f"{reason} (got {_brief(got)})"
    return FieldError(pointer=pointer[:200], reason=reason)


def _limit(value: object) -> str:
    return f"{value:.15g}" if isinstance(value, float) else str(value)


def _brief(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.10g}"
    if isinstance(value, date):
        return value.isoformat()
    return f"{_BRIEF.repr(value):.{_MOST_CHARACTERS}}"
