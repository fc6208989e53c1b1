"""Machine code of functions of loops, by numba, and where it is kept.

It is kept beside its source, in the directory that NUMBA_CACHE_DIR names, or in the user's cache: a
process that finds it there does not wait for the compiler. Where nothing can be written, each
process compiles for itself.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator

_SETTINGS: dict[str, Any] = {"error_model": "numpy", "nogil": True}


@cache
def _sources() -> bytes:
    """A digest of all of models/: code holds what it calls, and constants, of other files, too."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.digest()


class _OfAllSources:
    """Code is outdated by a change of any source; numba looks at the function's own file alone."""

    def get_source_stamp(self) -> bytes:
        return _sources()


class Given(_OfAllSources, UserProvidedCacheLocator):
    """Where NUMBA_CACHE_DIR says."""


class Beside(_OfAllSources, InTreeCacheLocator):
    """In `__pycache__`, beside the source."""


class OfUser(_OfAllSources, UserWideCacheLocator):
    """In the user's cache."""


# As numba reads it out of NUMBA_CACHE_LOCATOR_CLASSES, too.
_CLASSES = ",".join(f"{each.__module__}.{each.__qualname__}" for each in (Given, Beside, OfUser))
setattr(numba.config, "CACHE_LOCATOR_CLASSES", _CLASSES)  # noqa: B010 - it has no type


def machine_code(function: Callable[..., Any]) -> Any:
    """A function as numba compiles it, for each kind of arguments when they first come."""
    try:
        return numba.njit(cache=True, **_SETTINGS)(function)
    except RuntimeError:  # no place to keep it in
        return numba.njit(**_SETTINGS)(function)
