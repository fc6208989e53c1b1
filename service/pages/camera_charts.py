"""The charts of a camera's page: pan, tilt, roll and height over time, drawn on the server."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime, timedelta

from markupsafe import Markup
from sqlalchemy.orm import Session

from models.geometry.pose import PoseParameters
from models.quantiles import Z90
from service.cameras.answers import ANSWERS
from service.pages.drawings.chart import Mark, Point, Span, TimeAxis, chart_svg
from service.store import estimates
from service.store.alerts import AlertRecord
from service.store.cameras import PriorPoseRecord
from service.store.estimates import EstimateRecord
from service.store.journal import ActivityRecord
from service.store.references import MaintenanceRecord
from service.wording import alerts as alert_words
from service.wording.camera import STATES
from service.wording.language import N_, _, number
from service.wording.moves import NAMES
from service.wording.times import Clock

POINTS = 160
RANGES = ((1, N_("24 hours")), (7, N_("7 days")), (30, N_("30 days")), (0, N_("All")))
_TABLE = 20
_LEAST_DEG, _LEAST_M = 1.0, 0.2  # of a value axis: less is noise writ large


@dataclass(frozen=True, slots=True, kw_only=True)
class History:
    """What the charts are of: estimates of some days, and what happened meanwhile."""

    items: Sequence[EstimateRecord]
    priors: Sequence[PriorPoseRecord]
    alerts: Sequence[AlertRecord]
    acts: Sequence[ActivityRecord]
    windows: Sequence[MaintenanceRecord]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chart:
    """A drawing, what is drawn, and its newest value."""

    name: str
    newest: str
    drawing: Markup


def load_history(
    session: Session, camera_id: str, days: int, now: datetime
) -> Sequence[EstimateRecord]:
    """The estimates of so many days, or all for 0, evenly thinned out."""
    since = now - timedelta(days=days) if days else None
    return estimates.thinned(session, camera_id, since, None, POINTS)


def draw_charts(history: History, clock: Clock) -> list[Chart]:
    """A chart of each number; none before there is an estimate."""
    if not history.items:
        return []
    marks = [
        Mark(
            at_s=(alert.changed_at or alert.opened_at).timestamp(),
            kind="alarm",
            words=f"{_(alert_words.KINDS[alert.kind])}, {clock.when(alert.opened_at)}",
        )
        for alert in history.alerts
    ]
    marks += [
        Mark(
            at_s=entry.at.timestamp(),
            kind="act",
            words=f"{alert_words.entry_words(entry, clock)} {clock.when(entry.at)}",
        )
        for entry in history.acts
        if entry.what in ANSWERS
    ]
    first_s, last_s = history.items[0].to_s, history.items[-1].to_s
    times = TimeAxis.of(first_s, max([last_s, *(mark.at_s for mark in marks)]), clock.zone)
    spans = [
        Span(from_s=w.from_at.timestamp(), to_s=w.until.timestamp(), words=_("maintained"))
        for w in history.windows
    ]
    charts = []
    for name, words in NAMES.items():
        points = [_point(item, name, clock) for item in history.items]
        told = [point for point in points if point.value is not None]
        prior = [
            (record.created_at.timestamp(), _shown(PoseParameters.of_pose(record.pose), name))
            for record in reversed(history.priors)
        ]
        label = _("{number} over time; its newest values are in the table below", number=_(words))
        charts.append(
            Chart(
                name=_(words).capitalize(),
                newest=value_words(history.items[-1], name) if told else _("not told"),
                drawing=chart_svg(
                    points,
                    prior,
                    marks,
                    spans,
                    times,
                    least=_LEAST_M if name == "height" else _LEAST_DEG,
                    label=label,
                ),
            )
        )
    return charts


def table_rows(items: Sequence[EstimateRecord], clock: Clock) -> list[list[str]]:
    """The newest values, newest first, for who cannot see the charts."""
    return [
        [
            clock.when(clock.of(item.to_s)),
            *(value_words(item, name) for name in NAMES),
            str(item.tracks),
            _(STATES[item.state]),
        ]
        for item in reversed(items[-_TABLE:])
    ]


def value_words(item: EstimateRecord, name: str) -> str:
    """A number with half its 90 % interval: "26.99° ±0.36"."""
    point = _value(item, name)
    if point is None:
        return _("not told")
    unit = " m" if name == "height" else "°"
    value, half = (number(each, ".2f") for each in point)
    return f"{value}{unit} ±{half}".replace("-", "\N{MINUS SIGN}")


def _point(item: EstimateRecord, name: str, clock: Clock) -> Point:
    found = _value(item, name)
    return Point(
        at_s=item.to_s,
        value=None if found is None else found[0],
        half=None if found is None else found[1],
        words=_(
            "{time}: {value}, {n} people",
            time=clock.when(clock.of(item.to_s)),
            value=value_words(item, name),
            n=item.tracks,
        ),
    )


def _value(item: EstimateRecord, name: str) -> tuple[float, float] | None:
    """A number and half its 90 % interval as they are shown; None where the tracks do not tell."""
    if name not in item.identifiable:
        return None
    return _shown(item.pose, name), Z90 * _shown(item.pose_sd, name)


def _shown(of: PoseParameters, name: str) -> float:
    value = of.of(name)
    return value if name == "height" else math.degrees(value)
