"""A number over time, drawn: its line and interval, the prior, marks. Values in, SVG out."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime, tzinfo
from typing import Literal

from markupsafe import Markup, escape

from service.pages.drawings.svg_paths import svg
from service.wording.language import number
from service.wording.times import day_and_month

_WIDTH, _HEIGHT = 400.0, 130.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 42.0, 4.0, 12.0, 18.0
_LEAST_S = 3600.0  # of an axis: a single estimate stands in its hour
_MINUTE, _HOUR, _DAY = 60.0, 3600.0, 86_400.0
_TIME_STEPS = (
    *(5 * _MINUTE, 15 * _MINUTE, 30 * _MINUTE, _HOUR, 2 * _HOUR, 6 * _HOUR, 12 * _HOUR),
    *(_DAY, 2 * _DAY, 7 * _DAY, 14 * _DAY, 30 * _DAY, 91 * _DAY, 365 * _DAY),
)
_DOTS = 60  # points more than that are a line alone


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A value at a time and half its 90 % interval; None where the tracks do not tell it."""

    at_s: float
    value: float | None
    half: float | None
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """Something that happened at a time."""

    at_s: float
    kind: Literal["alarm", "act"]
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Span:
    """A time that is shaded, such as of maintenance."""

    from_s: float
    to_s: float
    words: str


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeAxis:
    """The times that a chart is of, at least an hour, said by the clock of a zone."""

    from_s: float
    to_s: float
    zone: tzinfo

    @classmethod
    def of(cls, from_s: float, to_s: float, zone: tzinfo) -> "TimeAxis":
        """The axis between two times, widened about them to its least."""
        lacks = max(_LEAST_S - (to_s - from_s), 0.0) / 2
        return cls(from_s=from_s - lacks, to_s=to_s + lacks, zone=zone)

    def x(self, at_s: float) -> float:
        """The place of a time, kept to the axis."""
        share = (at_s - self.from_s) / (self.to_s - self.from_s)
        return _LEFT + min(max(share, 0.0), 1.0) * (_WIDTH - _LEFT - _RIGHT)

    def ticks(self) -> list[tuple[float, str]]:
        """Some round times of the zone's clock, and how they are said."""
        span = self.to_s - self.from_s
        step = next((each for each in _TIME_STEPS if span / each <= 5), _TIME_STEPS[-1])
        ahead_s = self._local(self.from_s).utcoffset()
        offset = 0.0 if ahead_s is None else ahead_s.total_seconds()
        first = math.ceil((self.from_s + offset) / step) * step - offset
        found = []
        for n in range(int((self.to_s - first) // step) + 1):
            local = self._local(first + n * step)
            midnight = (local.hour, local.minute) == (0, 0)
            words = day_and_month(local) if step >= _DAY or midnight else f"{local:%H:%M}"
            found.append((first + n * step, words))
        return found

    def _local(self, at_s: float) -> datetime:
        return datetime.fromtimestamp(at_s, UTC).astimezone(self.zone)


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueAxis:
    """The values that a chart is of."""

    low: float
    high: float

    @classmethod
    def of(cls, values: Sequence[float], least: float) -> "ValueAxis":
        """The axis of some values, with a little room, widened to its least."""
        low, high = min(values), max(values)
        room = max(0.08 * (high - low), (least - (high - low)) / 2)
        return cls(low=low - room, high=high + room)

    def y(self, value: float) -> float:
        """The place of a value."""
        share = (value - self.low) / (self.high - self.low)
        return _HEIGHT - _BOTTOM - share * (_HEIGHT - _TOP - _BOTTOM)

    def ticks(self) -> list[tuple[float, str]]:
        """Three to five round values, and how they are said."""
        rough = (self.high - self.low) / 4
        tenth = 10.0 ** math.floor(math.log10(rough))
        step = next(each * tenth for each in (1, 2, 5, 10) if each * tenth >= rough)
        digits = max(-math.floor(math.log10(step) + 1e-9), 0)
        first = math.ceil(self.low / step)
        return [
            (n * step, number(n * step, f".{digits}f").replace("-", "\N{MINUS SIGN}"))
            for n in range(first, math.floor(self.high / step) + 1)
        ]


def chart_svg(
    points: Sequence[Point],
    prior: Sequence[tuple[float, float]],
    marks: Sequence[Mark],
    spans: Sequence[Span],
    times: TimeAxis,
    *,
    least: float,
    label: str,
) -> Markup:
    """One number over time.

    Args:
        points: oldest first.
        prior: its value from a time on, oldest first; the first held before, too.
        marks: alerts and acts.
        spans: shaded.
        times: the axis, of all charts of a page.
        least: of the value axis.
        label: what a screen reader says of it.
    """
    told = [(p.value, p.half or 0.0) for p in points if p.value is not None]
    edges = [value + sign * half for value, half in told for sign in (-1, 1)]
    values = ValueAxis.of([*edges, *(value for _, value in prior)], least)
    bottom = _HEIGHT - _BOTTOM
    parts = [
        f'<rect class="span" x="{times.x(s.from_s):.1f}" y="{_TOP}" height="{bottom - _TOP}" '
        f'width="{times.x(s.to_s) - times.x(s.from_s):.1f}"><title>{escape(s.words)}</title></rect>'
        for s in spans
        if s.to_s > times.from_s and s.from_s < times.to_s
    ]
    for value, words in values.ticks():
        y = values.y(value)
        parts.append(f'<path class="tick" d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}"/>')
        parts.append(f'<text x="{_LEFT - 5}" y="{y + 3.5:.1f}" text-anchor="end">{words}</text>')
    for at_s, words in times.ticks():
        parts.append(
            f'<text x="{times.x(at_s):.1f}" y="{_HEIGHT - 4}" text-anchor="middle">{words}</text>'
        )
    for run in _runs(points):
        xs = [f"{times.x(p.at_s):.1f}" for p in run]
        low, high = (
            [f"{values.y(_known(p) + sign * (p.half or 0.0)):.1f}" for p in run] for sign in (-1, 1)
        )
        band = [*zip(xs, high, strict=True), *reversed([*zip(xs, low, strict=True)])]
        parts.append(f'<path class="band" d="M{"L".join(map(" ".join, band))}Z"/>')
        line = [(x, f"{values.y(_known(p)):.1f}") for x, p in zip(xs, run, strict=True)]
        parts.append(f'<path class="line" d="M{"L".join(map(" ".join, line))}"/>')
    parts.append(f'<path class="prior" d="{_steps(prior, times, values)}"/>')
    if len(told) <= _DOTS:
        parts += [
            f'<circle cx="{times.x(p.at_s):.1f}" cy="{values.y(p.value):.1f}" r="2.6">'
            f"<title>{escape(p.words)}</title></circle>"
            for p in points
            if p.value is not None
        ]
    for mark in marks:
        if times.from_s <= mark.at_s <= times.to_s:
            x, title = times.x(mark.at_s), escape(mark.words)
            parts.append(
                f'<g class="{mark.kind}"><title>{title}</title><path d="M{x:.1f} {_TOP}V{bottom}"/>'
                f'<path class="head" d="M{x - 4:.1f} 4h8l-4 7z"/></g>'
            )
    return svg("chart", f"0 0 {_WIDTH:g} {_HEIGHT:g}", label, parts)


def _known(point: Point) -> float:
    assert point.value is not None
    return point.value


def _runs(points: Sequence[Point]) -> list[list[Point]]:
    """The points that are told, one after the other without a gap."""
    runs: list[list[Point]] = [[]]
    for point in points:
        if point.value is None:
            runs.append([])
        else:
            runs[-1].append(point)
    return [run for run in runs if run]


def _steps(prior: Sequence[tuple[float, float]], times: TimeAxis, values: ValueAxis) -> str:
    """The prior's value over the whole axis, as steps."""
    before = [value for at_s, value in prior if at_s <= times.from_s]
    inside = [(at_s, value) for at_s, value in prior if times.from_s < at_s <= times.to_s]
    first = before[-1] if before else prior[0][1]
    drawn = f"M{_LEFT} {values.y(first):.1f}"
    for at_s, value in inside:
        drawn += f"H{times.x(at_s):.1f}V{values.y(value):.1f}"
    return f"{drawn}H{_WIDTH - _RIGHT}"
