"""Reasons why a field of a body or a query is not valid: the limit and the value received."""

import reprlib
from collections.abc import Mapping, Sequence
from typing import Any

from service.errors import FieldError

_TIME = "must be an RFC 3339 time with a zone, for example 2026-11-20T08:00:00Z"
# By pydantic's type of error. Other types have its own message: they carry ours (`value_error`),
# or name what is expected.
_REASONS = {
    "missing": "is required",
    "greater_than": "must be greater than {gt:.15g}",
    "greater_than_equal": "must be at least {ge:.15g}",
    "less_than": "must be less than {lt:.15g}",
    "less_than_equal": "must be at most {le:.15g}",
    "finite_number": "must be a finite number",
    "float_type": "must be a number",
    "float_parsing": "must be a number",
    "int_type": "must be a whole number",
    "int_parsing": "must be a whole number",
    "int_from_float": "must be a whole number",
    "int_parsing_size": "must be a smaller whole number",
    "bool_type": "must be true or false",
    "bool_parsing": "must be true or false",
    "string_type": "must be text",
    "string_too_short": "must have at least {min_length} characters",
    "string_too_long": "must have at most {max_length} characters",
    "string_pattern_mismatch": "must match {pattern}",
    "list_type": "must be a list",
    "too_short": "must have at least {min_length} items",
    "too_long": "must have at most {max_length} items",
    "dict_type": "must be an object",
    "model_type": "must be an object",
    "model_attributes_type": "must be an object",
    "datetime_type": _TIME,
    "datetime_parsing": _TIME,
    "datetime_from_date_parsing": _TIME,
    "timezone_aware": _TIME,
    "enum": "must be {expected}",
    "literal_error": "must be {expected}",
    "json_invalid": "is not JSON: {error}",
}
_CONSEQUENCE = "default_factory_not_called"  # of another field's error, and no error of its own
_SECRET = ("snapshot_credentials", "password", "token")  # fields that no answer repeats
_BRIEF = reprlib.Repr()
_BRIEF.maxstring = 80


def field_errors(errors: Sequence[Mapping[str, Any]]) -> tuple[FieldError, ...]:
    """Return the errors of pydantic in our words."""
    return tuple(
        FieldError(pointer=_pointer_of(error), reason=_reason_of(error))
        for error in errors
        if error["type"] != _CONSEQUENCE
    )


def _pointer_of(error: Mapping[str, Any]) -> str:
    return "".join(f"/{part}" for part in error["loc"] if part != "body")[:200]


def _reason_of(error: Mapping[str, Any]) -> str:
    context = error.get("ctx", {})
    words = _REASONS.get(error["type"])
    if error["type"] == "value_error":
        reason = str(context.get("error", error["msg"]))
    else:
        reason = str(error["msg"]) if words is None else words.format(**context)
    if error["type"] == "missing" or any(part in _SECRET for part in error["loc"]):
        return reason
    return f"{reason}, got {_BRIEF.repr(error.get('input')):.80}"
