"""What was read of the store and is given to the next who asks, as long as nothing has changed."""

from collections.abc import Callable
from dataclasses import dataclass
from datetime import datetime
from typing import Generic, TypeVar

from service.store.engines.store import Watcher

Value = TypeVar("Value")


@dataclass(frozen=True, slots=True, kw_only=True)
class KeptAnswer:
    """An answer, and whether it `holds` at another time than it was made at."""

    etag: str
    body: bytes
    holds: Callable[[datetime], bool]


class Kept(Generic[Value]):
    """Values by what was asked for; all are forgotten with the next commit of anybody.

    For one thread, the event loop's. What a value hangs on besides the store, the time above all,
    is for who asks to see to.
    """

    def __init__(self, changes: Watcher) -> None:
        self._changes = changes
        self._version: int | None = None
        self._values: dict[str, Value] = {}

    def version(self) -> int | None:
        """How the store is now, for `keep`: to be asked before anything is read of it."""
        version = self._changes.version()
        if version != self._version:
            self._values.clear()
            self._version = version
        return version

    def find(self, key: str) -> Value | None:
        """The value that was read of the store as it was at the last look at its `version`."""
        return self._values.get(key)

    def keep(self, key: str, value: Value, version: int | None) -> None:
        """Keep what was read after a look at the version, unless there has been another since."""
        if version is not None and version == self._version:
            self._values[key] = value
