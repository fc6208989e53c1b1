"""Whose turn it is, where there are too many for one round."""

from bisect import bisect_right
from collections.abc import Sequence


class Rota:
    """Goes round and round; who was added meanwhile has its turn like all others."""

    def __init__(self) -> None:
        self._last = ""

    def take(self, ids: Sequence[str], most: int) -> list[str]:
        """Up to so many of ids, which are in order, from where the last round ended."""
        first = bisect_right(ids, self._last)
        taken = [*ids[first:], *ids[:first]][:most]
        if taken:
            self._last = taken[-1]
        return taken
