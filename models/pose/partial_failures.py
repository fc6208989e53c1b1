"""What may fail beside an estimate: a failure is a value, and stops nobody."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

_Made = TypeVar("_Made")


@dataclass(frozen=True, slots=True, kw_only=True)
class Lack:
    """A part that is not needed and could not be made, and the error that it failed with."""

    part: str
    error: Exception


def unless_failed(lacks: list[Lack], part: str, make: Callable[[], _Made]) -> _Made | None:
    """What is made; None if it failed, and then there is one lack more."""
    try:
        return make()
    except Exception as error:
        lacks.append(Lack(part=part, error=error))
        return None
