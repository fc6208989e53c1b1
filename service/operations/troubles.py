"""What is wrong with the service, for people: each trouble in a sentence, and since when."""

from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from sqlalchemy.orm import Session

from service.alerts.bridges import problem_of
from service.settings import Settings
from service.store import bridges, cameras, reports, tracks, webhooks, workers
from service.store.engines.dialects import now_in
from service.wording.language import _
from service.wording.reasons import in_words

LONGEST_LAG = timedelta(seconds=60)
_NAMED = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Trouble:
    """A trouble of the service as a whole, or of what it sends to."""

    words: str
    since: datetime | None


def find_troubles(session: Session, settings: Settings) -> list[Trouble]:
    """What keeps cameras from being looked at, or people from being told; by reading alone."""
    return [
        *_of_workers(session, settings),
        *_of_the_queue(session),
        *_of_bridges(session),
        *_of_webhooks(session),
        *_of_reports(session, settings),
    ]


def _of_workers(session: Session, settings: Settings) -> list[Trouble]:
    known = workers.every(session)
    heard = workers.last_heard(known)
    found = [
        Trouble(
            words=_("The worker {name} {trouble}", name=each.name, trouble=each.trouble),
            since=each.heartbeat_at,
        )
        for each in known
        if each.trouble is not None
    ]
    if heard is None:
        return [Trouble(words=_("No worker runs: no camera is looked at"), since=None), *found]
    # By the database's clock, as heartbeats are; one of the future is no sign of life either.
    if abs((now_in(session) - heard).total_seconds()) >= settings.worker_lost_s:
        silent = Trouble(words=_("No worker is heard of: no camera is looked at"), since=heard)
        return [silent, *found]
    return found


def _of_the_queue(session: Session) -> list[Trouble]:
    failing = cameras.failing(session)
    names = {camera.id for camera in failing}
    came = [at for i, (_s, at) in tracks.unseen_since(session).items() if i not in names]
    oldest = min(came, default=None)
    found = []
    if oldest is not None and datetime.now(UTC) - oldest > LONGEST_LAG:
        found.append(Trouble(words=_("Tracks wait to be looked at"), since=oldest))
    if failing:
        some = ", ".join(camera.id for camera in failing[:_NAMED])
        if len(failing) > _NAMED:
            some += " " + _("and {n} more", n=len(failing) - _NAMED)
        since = failing[0].estimate_failing_since
        found.append(Trouble(words=_("Looks at {cameras} fail", cameras=some), since=since))
    return found


def _of_bridges(session: Session) -> list[Trouble]:
    now, found = now_in(session), []
    for record in bridges.every(session):
        problem = problem_of(record, now)
        if problem is not None:
            words = in_words((problem,))
            found.append(Trouble(words=words[0].upper() + words[1:], since=record.heartbeat_at))
        elif not record.stopped and not record.report.get("connected"):
            words = _("The MQTT bridge {name} is not connected to its broker", name=record.name)
            found.append(Trouble(words=words, since=None))
    return found


def _of_webhooks(session: Session) -> list[Trouble]:
    # By their names alone: an address often holds a secret.
    return [
        Trouble(
            words=_("The webhook “{name}” takes nothing", name=record.name or record.id)
            if record.enabled
            else _(
                "The webhook “{name}” is switched off, as it failed for long",
                name=record.name or record.id,
            ),
            since=record.failing_since,
        )
        for record in webhooks.every(session)
        if record.failing_since is not None
    ]


def _of_reports(session: Session, settings: Settings) -> list[Trouble]:
    last = reports.newest(session, datetime.now(UTC)) if settings.smtp_host else None
    if last is None or last.error is None:
        return []
    words = _("The mail server did not take the weekly report: {error}", error=last.error)
    return [Trouble(words=words, since=last.made_at)]
