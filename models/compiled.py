"""Loops over the steps of tracks, compiled: numpy takes ten small arrays for what is one pass.

What is compiled is kept beside its source, or in the user's cache; a process finds it there and
does not wait for the compiler. Where neither can be written to, each process compiles for itself.
"""

from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import numba

P = ParamSpec("P")
R = TypeVar("R")

_SETTINGS: dict[str, Any] = {"error_model": "numpy", "nogil": True}


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """A function of floats and arrays as machine code. It runs on one thread."""
    try:
        made: Callable[P, R] = numba.njit(cache=True, **_SETTINGS)(function)
    except RuntimeError:  # no place to keep it in
        made = numba.njit(**_SETTINGS)(function)
    return made
