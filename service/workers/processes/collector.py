"""Python's garbage collector, for a process that must not stop to look for garbage.

A full collection looks at every object that may be part of a cycle, and nobody is answered
meanwhile: 0.1 s for what a service imports, 10 ms for what it keeps after its first requests, and
several times as long where others want the processor.

Python looks at all again once what is new is a quarter of what it found the last time: of what a
service has imported that is late, and much to be looked at in one go; of nothing it comes as soon
as the counts below are full.
"""

import contextlib
import gc
from collections.abc import Iterator
from typing import Any

_MANY = 5_000
# New objects until they are looked at, and how often until all are: about as many as what a page of
# 2,000 cameras holds until it is sent. Python's own 700, 10, 10 took a tenth of its time.
_NEW = 50_000, 1, 1
_MOST_TIMES = 10


class _Survivors:
    """Has what survives full collections looked at no more, the first times that it is much.

    Not each time: a request that happens to be under way stays, too, if it is part of a cycle.
    """

    def __init__(self) -> None:
        self._left = _MOST_TIMES

    def __call__(self, phase: str, info: dict[str, Any]) -> None:
        if phase != "stop" or info["generation"] != 2 or len(gc.get_objects(2)) < _MANY:
            return
        gc.freeze()
        self._left -= 1
        if not self._left:
            gc.callbacks.remove(self)


@contextlib.contextmanager
def importing() -> Iterator[None]:
    """Look for no garbage as long as the block imports, nor ever at what was imported by its end.

    Looking takes a fifth of a start, and a few hundred of 300,000 objects are garbage.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def settle_collector() -> None:
    """Look no more at what is there by now, nor at what the first requests add for good."""
    gc.collect()
    gc.freeze()
    gc.collect()  # which finds next to nothing: the next ones come soon, and are short
    gc.callbacks.append(_Survivors())
    gc.set_threshold(*_NEW)
