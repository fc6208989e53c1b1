"""Machine code of functions of loops, by numba, and where it is kept.

It is kept in the directory that NUMBA_CACHE_DIR names, in the virtual environment, or in the user's
cache: a process that finds it there does not wait for the compiler. Where nothing can be written,
each process compiles for itself. Beside its source, where numba would put it, it would outlive an
uninstallation, and the folders that are left of a package are a package to Python.
"""

# mypy: disable-error-code="no-untyped-call"

import hashlib
import os
import sys
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator

_ROOT = Path(__file__).parent.parent
_SETTINGS: dict[str, Any] = {"error_model": "numpy", "nogil": True}


@cache
def _sources() -> bytes:
    """A digest of all of models/: code holds what it calls, and constants, of other files, too."""
    digest = hashlib.sha256()
    for path in sorted((_ROOT / "models").rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.digest()


class _OfAllSources:
    """Code is outdated by a change of any source; numba looks at the function's own file alone."""

    def get_source_stamp(self) -> bytes:
        return _sources()


class Given(_OfAllSources, UserProvidedCacheLocator):
    """Where NUMBA_CACHE_DIR says."""


class OfEnvironment(_OfAllSources, InTreeCacheLocator):
    """In the virtual environment, if this is one: the same for a checkout and what is installed."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)
        folder = Path(file).parent.relative_to(_ROOT)
        self._cache_path = os.path.join(sys.prefix, "var", "cache", "surefoot", folder)

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "OfEnvironment | None":
        """Where a function's code is kept; None where that is another's to say."""
        if sys.prefix == sys.base_prefix or not Path(file).is_relative_to(_ROOT):
            return None
        found: OfEnvironment | None = super().from_function(function, file)
        return found


class OfUser(_OfAllSources, UserWideCacheLocator):
    """In the user's cache."""


# As numba reads it out of NUMBA_CACHE_LOCATOR_CLASSES, too.
_CLASSES = (Given, OfEnvironment, OfUser)
_NAMES = ",".join(f"{each.__module__}.{each.__qualname__}" for each in _CLASSES)
setattr(numba.config, "CACHE_LOCATOR_CLASSES", _NAMES)  # noqa: B010 - it has no type


def machine_code(function: Callable[..., Any]) -> Any:
    """A function as numba compiles it, for each kind of arguments when they first come."""
    try:
        return numba.njit(cache=True, **_SETTINGS)(function)
    except RuntimeError:  # no place to keep it in
        return numba.njit(**_SETTINGS)(function)
