"""Loops over the steps of tracks, compiled: numpy takes ten small arrays for what is one pass."""

import threading
from collections.abc import Callable
from functools import update_wrapper
from types import FunctionType
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
R = TypeVar("R")

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
        return (self._made or self.made())(*args, **kwargs)

    @property
    def signatures(self) -> list[Any]:
        """The kinds of arguments that it is compiled for in this process."""
        return list(self.made().signatures)

    def made(self) -> Any:
        """The machine code."""
        with _one_at_a_time:
            if self._made is None:
                from models.machine_code import machine_code  # see above

                self._made = machine_code(self._among_made())
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

    It may call others like it by their names in its module. Those that are called by hot loops of
    Python alone are not worth it: a call costs some microseconds by itself.
    """
    assert isinstance(function, FunctionType)
    return _Compiled(function)
