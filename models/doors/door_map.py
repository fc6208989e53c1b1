"""The door map: how much oftener walks begin and end at a place than the picture makes them.

Ours: a gamma prior on a rate per place, its mean what is usual where people look as tall.
Source: Clayton and Kaldor 1987, observed over expected counts, shrunk; Stauffer 2003, sources and
sinks of tracks.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from models.geometry.rotation import Array, Mask
from models.tracks.exposure import Moments

_SIZES_APART = 0.02  # of the logs of people's sizes in the image: a metre, 45 m away
_RATE_PRIOR = 0.1  # events at the usual rate that each of them begins with
_SHRUNK = 0.5  # events at the usual rate that each place begins with
_KNOWN_S = 3.0  # of walking around a place: it is as much known as not


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorGrain:
    """How fine a door map is: the Gaussian over places; `alike` if people come in as they go.

    `weight` is how much what it says counts, against where people walk.
    """

    smooth_m: float
    alike: bool
    weight: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Nodes:
    """So many of them, `size` (X, Y), `cell_m` apart from `corner` (2,) on."""

    corner: Array
    cell_m: float
    size: tuple[int, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class DoorMap:
    """Ratios (X, Y, 2) of the rates of beginnings and of ends to what is usual, at nodes.

    Nodes stand `cell_m` apart from `corner` (2,) on, in metres from the camera's foot point.
    `known` (X, Y) is 0 to 1, how well the reference knows a place. What is usual, `rate` (2, K) in
    1/s, hangs on how tall people look: the log of that in pixels is `log_size` (K,), evenly apart.
    What a tracker loses far away is of the picture, and no door. `weight` is what a log likelihood
    is multiplied by.
    """

    corner: Array
    cell_m: float
    ratio: Array
    known: Array
    log_size: Array
    rate: Array
    weight: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """What there is at each of the nodes, or within the reach of a Gaussian around them.

    For either kind, `seen` (2, X, Y) are events, `wanted` (2, X, Y) those that are usual;
    `walked_s` (X, Y) is the time at risk of both. `log_size` (K,) and `rate` (2, K) are as of a
    door map.
    """

    seen: Array
    wanted: Array
    walked_s: Array
    log_size: Array
    rate: Array


def count_at(
    moments: Moments, place: Array, on_ground: Mask, weight: Array, nodes: Nodes
) -> Counts:
    """What there is at the nodes, of moments at a known pose.

    Args:
        moments: of people who walk, one at least.
        place: of each (M, 2), on the ground.
        on_ground: which have one (M,).
        weight: what each counts for (M,), its track's.
        nodes: of the map.
    """
    weight = weight * on_ground
    small, large = float(moments.log_size.min()), float(moments.log_size.max())
    log_size = np.linspace(small, large + _SIZES_APART, int((large - small) / _SIZES_APART) + 2)
    rate = np.stack([_rates(moments, weight, log_size, kind) for kind in (0, 1)])
    at = (place - nodes.corner) / nodes.cell_m
    usual = [np.interp(moments.log_size, log_size, rate[kind]) for kind in (0, 1)]
    counted = [
        *(moments.event == kind for kind in (0, 1)),
        *(usual[kind] * moments.seconds[:, kind] for kind in (0, 1)),
        moments.seconds.mean(axis=1),
    ]
    every = np.stack([_binned(at, weight * each, nodes.size) for each in counted])
    return Counts(
        seen=every[:2], wanted=every[2:4], walked_s=every[4], log_size=log_size, rate=rate
    )


def around(counts: Counts, nodes: Nodes, widths_m: Sequence[float]) -> Iterator[Counts]:
    """What there is within the reach of a Gaussian around the nodes, for each of its widths."""
    every = np.concatenate([counts.seen, counts.wanted, counts.walked_s[None]])
    size = (_fast(nodes.size[0]), _fast(nodes.size[1]))
    waves = np.fft.rfft2(every, s=size)
    rates = 2 * np.pi * np.fft.fftfreq(size[0])[:, None], 2 * np.pi * np.fft.rfftfreq(size[1])
    for smooth_m in widths_m:
        sd = smooth_m / nodes.cell_m
        kernel = 4 * np.pi * sd**2 * np.exp(-0.5 * sd**2 * (rates[0] ** 2 + rates[1] ** 2))
        smooth = np.fft.irfft2(waves * kernel, s=size)[:, : nodes.size[0], : nodes.size[1]]
        smooth = np.clip(smooth, 0.0, None)
        yield replace(counts, seen=smooth[:2], wanted=smooth[2:4], walked_s=smooth[4])


def door_map_of(counts: Counts, nodes: Nodes, grain: DoorGrain) -> DoorMap:
    """The door map of what there is around its nodes."""
    # Compiled loops read ratios that lie row by row.
    seen, wanted = (
        np.ascontiguousarray(np.moveaxis(each, 0, 2)) for each in (counts.seen, counts.wanted)
    )
    if grain.alike:
        seen, wanted = (np.repeat(n.sum(axis=2, keepdims=True), 2, axis=2) for n in (seen, wanted))
    return DoorMap(
        corner=np.asarray(nodes.corner, dtype=np.float64),
        cell_m=float(nodes.cell_m),
        ratio=rounded_ratio((seen + _SHRUNK) / (wanted + _SHRUNK)),
        known=np.rint(counts.walked_s / (counts.walked_s + _KNOWN_S) * 255) / 255,
        log_size=counts.log_size,
        rate=counts.rate,
        weight=grain.weight,
    )


def rounded_ratio(ratio: Array) -> Array:
    """Ratios as they come back from the store: their logs in whole numbers of 1/64."""
    return np.asarray(np.exp(np.rint(np.log(ratio) * 64) / 64))


def _rates(moments: Moments, weight: Array, log_size: Array, kind: int) -> Array:
    """Rates (K,) of events of a kind in 1/s, by how tall people look: the smaller, the oftener.

    Source: Ayer and others 1955, isotonic regression by pooling adjacent violators.
    """
    nearest = np.rint((moments.log_size - log_size[0]) / (log_size[1] - log_size[0]))
    nearest = np.clip(nearest, 0, log_size.size - 1).astype(np.int64)
    events = np.bincount(nearest, weight * (moments.event == kind), log_size.size)
    seconds = np.bincount(nearest, weight * moments.seconds[:, kind], log_size.size)
    usual = max(float(events.sum()), 1e-3) / max(float(seconds.sum()), 1.0)
    begun_s = _RATE_PRIOR / usual
    pools: list[tuple[float, float, int]] = []
    for number, long_s in zip(events.tolist(), seconds.tolist(), strict=True):
        pools.append((number + _RATE_PRIOR, long_s + begun_s, 1))
        while len(pools) > 1 and pools[-1][0] * pools[-2][1] > pools[-2][0] * pools[-1][1]:
            last, before = pools.pop(), pools.pop()
            pools.append((before[0] + last[0], before[1] + last[1], before[2] + last[2]))
    return np.repeat(
        [number / long_s for number, long_s, _ in pools], [size for _, _, size in pools]
    )


def _binned(at: Array, weight: Array, size: tuple[int, int]) -> Array:
    """Weights spread linearly over the nodes (X, Y) around places (M, 2), told in nodes."""
    inside = ((at >= 0) & (at < np.array(size) - 1.001)).all(axis=1) & (weight > 0)
    at, weight = at[inside], weight[inside]
    first: npt.NDArray[np.int64] = np.floor(at).astype(np.int64)
    part = at - first
    counts = np.zeros(size[0] * size[1])
    for corner in np.ndindex(2, 2):
        share = np.where(np.array(corner) == 1, part, 1 - part).prod(axis=1)
        node = (first[:, 0] + corner[0]) * size[1] + first[:, 1] + corner[1]
        counts += np.bincount(node, weight * share, counts.size)
    return counts.reshape(size)


def _fast(length: int) -> int:
    """The next length that Fourier transforms are fast for: of no prime factor beyond 5."""
    while True:
        left = length
        for factor in (2, 3, 5):
            while left % factor == 0:
                left //= factor
        if left == 1:
            return length
        length += 1
