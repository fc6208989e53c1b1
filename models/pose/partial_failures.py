"""Partial failures: what may fail beside an estimate is a value, and stops nobody."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

_Made = TypeVar("_Made")


@dataclass(frozen=True, slots=True, kw_only=True)
class PartialFailure:
    """A part that is not needed and could not be made, and the error that it failed with."""

    part: str
    error: Exception


def unless_failed(
    failures: list[PartialFailure], part: str, make: Callable[[], _Made]
) -> _Made | None:
    """The part that is made; None if it failed, and then there is one failure more."""
    try:
        return make()
    except Exception as error:
        failures.append(PartialFailure(part=part, error=error))
        return None
