"""Loops over rows as machine code, by numba: numpy takes ten small arrays for what is one pass.

The code is kept in a folder of NUMBA_CACHE_DIR, of the virtual environment, or of the user's cache,
one for each state of these sources: a process that finds it there does not wait for the compiler.
Where nothing can be written, or anybody may write, each process compiles for itself. Beside its
source, where numba would put it, it would outlive an uninstallation, and the folders that are left
of a package are a package to Python.
"""

import hashlib
import os
import shutil
import stat
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache, update_wrapper
from pathlib import Path
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

from models.code_files import CodeFiles
from models.effort import check_effort

P = ParamSpec("P")
R = TypeVar("R")

_NAME = "surefoot-"
_KEPT_S = 30 * 86_400.0  # code of other sources, beside new code
_one_at_a_time = threading.RLock()


class _Compiled:
    """A function that is compiled when it is first called, and so are those that it calls.

    Many processes name these functions and never call one: they are spared the compiler, which is
    70 MB of memory and a third of a second to import.
    """

    def __init__(self, function: FunctionType) -> None:
        update_wrapper(self, function)
        self._function = function
        self._made: Any = None

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        check_effort()  # all that takes long comes by here, again and again
        return (self._made or self.made())(*args, **kwargs)

    @property
    def signatures(self) -> list[Any]:
        """The kinds of arguments that it is compiled for in this process."""
        return list(self.made().signatures)

    def made(self) -> Any:
        """The machine code."""
        with _one_at_a_time:
            if self._made is None:
                self._made = _machine_code(self._among_made())
        return self._made

    def _among_made(self) -> FunctionType:
        """The function, with machine code in the places of the compiled ones that it names."""
        function = self._function
        names = dict(function.__globals__)
        for name in function.__code__.co_names:
            if isinstance(names.get(name), _Compiled):
                names[name] = names[name].made()
        again = FunctionType(
            function.__code__, names, function.__name__, function.__defaults__, function.__closure__
        )
        again.__qualname__, again.__kwdefaults__ = function.__qualname__, function.__kwdefaults__
        return again


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """A function of floats and arrays as machine code, which runs on one thread.

    Arrays are C-contiguous and writable, of float64, int64 or bool: of any other kind it would be
    compiled again. It may call others like it by their names in its module. Those that are called
    by hot loops of Python alone are not worth it: a call costs some microseconds by itself.
    """
    assert isinstance(function, FunctionType)
    return _Compiled(function)


def _machine_code(function: FunctionType) -> Any:
    """A function as numba compiles it, for each kind of arguments when they first come."""
    import numba  # see above

    folder = _folder()
    if folder is not None:
        setattr(numba.config, "CACHE_DIR", str(folder))  # noqa: B010 - it has no type
    made: Any = numba.njit(cache=folder is not None, error_model="numpy", nogil=True)(function)
    if folder is not None:
        kept = made._cache  # private; pinned, and tests/models/test_compiled.py cuts files off
        name = f"{function.__module__}.{kept._impl.filename_base}"
        stamp: tuple[object, ...] = (numba.__version__,)
        if not name.startswith("models."):  # of what is not, the folder's name says nothing
            stamp += (function.__code__.co_filename, kept._impl.locator.get_source_stamp())
        kept._cache_file = CodeFiles(folder, name, stamp)
    return made


@cache
def _folder() -> Path | None:
    """The first folder for code of these sources that can be written; None where none can.

    Code holds what it calls, and constants, of other files, too: a change of any source makes
    another folder, where numba looks at the function's own file alone. Copies of the same sources
    share one: where they lie makes no difference to it.
    """
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.rglob("*.py")):
        digest.update(path.read_bytes())
    for root in _roots():
        folder = root / f"{_NAME}{digest.hexdigest()[:16]}"
        try:
            if not folder.is_dir():
                root.mkdir(parents=True, exist_ok=True)
                folder.mkdir(mode=0o700, exist_ok=True)
                _remove_old(root)
            if not _is_ours(folder):
                continue
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        return folder
    return None


def _roots() -> Iterator[Path]:
    if given := os.environ.get("NUMBA_CACHE_DIR"):
        yield Path(given)
    if sys.prefix != sys.base_prefix:
        yield Path(sys.prefix, "var", "cache", "surefoot")
    users = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    yield Path(users, "surefoot")


def _is_ours(folder: Path) -> bool:
    """True where nobody else may put code into a folder, in a shared one such as /tmp, say."""
    about = folder.stat()
    return not about.st_mode & stat.S_IWOTH and about.st_uid in (0, os.geteuid())


def _remove_old(root: Path) -> None:
    for folder in root.glob(f"{_NAME}*"):
        if time.time() - folder.stat().st_mtime > _KEPT_S:
            shutil.rmtree(folder, ignore_errors=True)
