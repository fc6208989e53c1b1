"""What the values of a table's columns have in common, for the rules of the layouts."""

from dataclasses import dataclass

import numpy as np

from models.geometry.rotation import Array, Index, Mask

_MOST = 0.98  # of the values of a column: a few wrong cells do not change its meaning
_LARGEST_CLASS = 1_000
_LARGEST_COCO = 90
_MOST_NAMED = 12
_SAMPLE = 20_000  # lines in which ids and frames are compared
_FAR = 0.3  # of a box's height: nobody walks so far from one frame to the next


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """Values (N, columns) of a table of `count` columns; NaN where a cell is no number.

    Columns are indices from 0, in the usual order: frame, id, left, top, width, height. `tracks`
    (N,) is the number of each line's track.
    """

    values: Array
    count: int
    tracks: Index

    def _share(self, at: int, fits: Mask) -> float:
        known = np.isfinite(self.values[:, at])
        return float(fits[known].mean()) if known.any() else 0.0

    def _whole(self, at: int) -> Mask:
        column = self.values[:, at]
        return np.asarray(column == np.round(column))

    def all(self, at: int, value: float) -> bool:
        """True if a column is this value in every line."""
        return self._share(at, self.values[:, at] == value) == 1.0

    def zero(self, at: int) -> bool:
        """True if a column is 0 in every line."""
        return self.all(at, 0)

    def has(self, at: int, value: float) -> bool:
        """True if a column has this value in any line."""
        return bool((self.values[:, at] == value).any())

    def flags(self, at: int) -> bool:
        """True if a column is 0 or 1."""
        return self.whole_within(at, 0, 1)

    def within(self, at: int, low: float, high: float, above: float = -1.0) -> bool:
        """True if a column is between two numbers, and above a third."""
        column = self.values[:, at]
        return self._share(at, (column >= low) & (column <= high) & (column > above)) >= _MOST

    def whole_within(self, at: int, low: float, high: float) -> bool:
        """True if a column is whole numbers between two."""
        column = self.values[:, at]
        return self._share(at, self._whole(at) & (column >= low) & (column <= high)) >= _MOST

    def classes(self, at: int) -> bool:
        """True if a column can be class numbers; a column of nothing but -1 is none."""
        return self.whole_within(at, -1, _LARGEST_CLASS) and not self.all(at, -1)

    def seldom_whole(self, at: int) -> bool:
        """True if most values of a column have a fraction."""
        return self._share(at, self._whole(at)) < 0.5

    def constant(self, at: int) -> bool:
        """True if a column of several lines has one value."""
        return len(self.values) > 1 and self.all(at, self.values[0, at])

    def whole_and_varies(self, at: int) -> bool:
        """True if a column is whole numbers, and not all the same."""
        return self._share(at, self._whole(at)) == 1.0 and not self.constant(at)

    @property
    def corners(self) -> float:
        """Share of lines in which columns 5 and 6 are larger than columns 3 and 4."""
        values = self.values
        return float(((values[:, 4] > values[:, 2]) & (values[:, 5] > values[:, 3])).mean())

    @property
    def sides_again(self) -> bool:
        """True if columns 7 and 8 are the sides of a box from columns 3, 4 to columns 5, 6."""
        left, top, right, bottom, wide, tall = self.values[:, 2:8].T
        same = (np.abs(right - left - wide) <= 1.5) & (np.abs(bottom - top - tall) <= 1.5)
        return bool(same.mean() >= _MOST)

    @property
    def class_in_seventh(self) -> bool:
        """True if column 7 is whole numbers, not only -1, 0, 1, and one value for each track."""
        if not self.whole_within(6, -1, _LARGEST_COCO) or self.whole_within(6, -1, 1):
            return False
        return self.constant_by_track(6) >= _MOST

    def constant_by_track(self, at: int) -> float:
        """Share of tracks in which a column has one value, as a class has."""
        column = self.values[:, at]
        known = np.isfinite(column)
        tracks, values = self.tracks[known], column[known]
        if not tracks.size:
            return 0.0
        low = np.full(int(tracks.max()) + 1, np.inf)
        high = -low
        np.minimum.at(low, tracks, values)
        np.maximum.at(high, tracks, values)
        return float((low == high)[np.unique(tracks)].mean())

    @property
    def swapped(self) -> bool:
        """True if boxes move like people only with column 1 as the id and column 2 as the frame."""
        values = self.values[:_SAMPLE]
        if len(values) < 10 or not self.whole_and_varies(1):
            return False
        tall = float(np.nanmedian(values[:, 5]))
        as_read, other = _step(values, 1, 0), _step(values, 0, 1)
        return as_read > _FAR * tall and other < _FAR * tall and other < as_read / 4

    def seen(self, at: int) -> str:
        """Return the values of a column, the first dozen of them."""
        column = self.values[:, at]
        found = np.unique(column[np.isfinite(column)]).tolist()
        more = ", ..." if len(found) > _MOST_NAMED else ""
        return ", ".join(f"{value:g}" for value in found[:_MOST_NAMED]) + more


def _step(values: Array, track_at: int, frame_at: int) -> float:
    """Median way of the foot from one line of a track to the next; infinite without such lines."""
    ordered = values[np.lexsort((values[:, frame_at], values[:, track_at]))]
    same = np.diff(ordered[:, track_at]) == 0
    if same.sum() < len(values) / 2:
        return np.inf
    u, v = ordered[:, 2] + ordered[:, 4] / 2, ordered[:, 3] + ordered[:, 5]
    return float(np.nanmedian(np.hypot(np.diff(u), np.diff(v))[same]))
