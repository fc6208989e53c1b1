"""Commands that ask a running service: status, cameras, alerts, ack, tail."""

import json
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from datetime import datetime
from itertools import islice
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

import typer

from service.commands.asking import (
    LOCAL_URL,
    End,
    Json,
    TokenFile,
    Url,
    account,
    asked,
    plain,
    table,
    tell,
)
from service.enums import AlertState, EventType, PoseState, Readiness, ReferenceState, Severity

if TYPE_CHECKING:
    from surefoot.bridge.service import Event, Service

_MOST_ENDED = 1000  # alerts of all times: the newest
_FIRST_S, _LONGEST_S = 1.0, 30.0


def status(url: Url = LOCAL_URL, token_file: TokenFile = None, as_json: Json = False) -> None:
    """Say how a running service and its cameras are; 1 where an alert fires or it is not ready."""
    with asked(url, token_file) as service:
        ready = service.readiness()
        states = Counter(camera["state"] for camera in service.items("/cameras"))
        alerts = list(service.items("/alerts", state=AlertState.FIRING.value))
    severities = Counter(alert["severity"] for alert in alerts)
    waiting = sum(_waits(alert) for alert in alerts)
    if as_json:
        tell(
            {
                "url": url,
                "readiness": ready,
                "cameras": {state: states[state] for state in PoseState},
                "alerts": {severity: severities[severity] for severity in Severity}
                | {"waiting": waiting},
            }
        )
    else:
        typer.echo(f"{plain(url)}: {ready['status'].replace('_', ' ')}")
        typer.echo(f"cameras: {_counted(states, PoseState)}")
        typer.echo(f"alerts that fire: {_counted(severities, Severity)}; {waiting} for a person")
        for problem in ready["problems"]:
            typer.echo(f"problem: {plain(problem)}")
    raise typer.Exit(End.FIRES if alerts or ready["status"] != Readiness.READY else End.FINE)


def cameras(
    state: Annotated[
        list[PoseState] | None, typer.Option(help="Those in this state; repeatedly.")
    ] = None,
    site: Annotated[str, typer.Option(help="Those of this site, and below it.")] = "",
    tag: Annotated[list[str] | None, typer.Option(help="Those with all of these.")] = None,
    url: Url = LOCAL_URL,
    token_file: TokenFile = None,
    as_json: Json = False,
) -> None:
    """List the cameras of a running service with their states."""
    with asked(url, token_file) as service:
        states = [each.value for each in state or ()]
        found = list(service.items("/cameras", state=states, site=site, tag=tag or []))
    if as_json:
        for camera in found:
            tell(camera)
        return
    rows = [
        (each["id"], each["state"], _learned(each["reference"]), each["tracks"], each["site"] or "",
         each["name"])
        for each in found
    ]  # fmt: skip
    table([("id", "state", "learned", "tracks", "site", "name"), *rows])


def alerts(
    camera: Annotated[str | None, typer.Option(help="Of this camera alone.")] = None,
    waiting: Annotated[
        bool, typer.Option("--waiting", help="Nobody has seen or silenced them.")
    ] = False,
    every: Annotated[bool, typer.Option("--all", help="Those that have ended, too.")] = False,
    url: Url = LOCAL_URL,
    token_file: TokenFile = None,
    as_json: Json = False,
) -> None:
    """List the alerts that fire, newest first; 1 where there is one."""
    query = {} if every else {"state": AlertState.FIRING.value}
    query |= {} if camera is None else {"camera_id": camera}
    with asked(url, token_file) as service:
        listed = islice(service.items("/alerts", **query), _MOST_ENDED if every else None)
        found = [alert for alert in listed if not waiting or _waits(alert)]
    if as_json:
        for alert in found:
            tell(alert)
    else:
        headings = ("id", "since", "camera", "kind", "severity", "state", "reason")
        table([headings, *map(_row_of, found)])
    fires = any(alert["state"] == AlertState.FIRING for alert in found)
    raise typer.Exit(End.FIRES if fires else End.FINE)


def ack(
    alert: Annotated[list[str], typer.Argument(help="An alert's id, or several.")],
    by: Annotated[
        str | None,
        typer.Option(help="Who has seen it, where no token says; this account if left out."),
    ] = None,
    url: Url = LOCAL_URL,
    token_file: TokenFile = None,
    as_json: Json = False,
) -> None:
    """Acknowledge alerts of a running service: somebody has seen them."""
    with asked(url, token_file) as service:
        for alert_id in alert:
            path = f"/alerts/{quote(alert_id, safe='')}/acknowledge"
            done = service.post(path, {"by": by or account()})
            if as_json:
                tell(done)
            else:
                words = f"{done['id']}: {done['kind']} of {_whose(done)}"
                typer.echo(plain(f"{words}, acknowledged by {done['acknowledged_by']}"))


def tail(
    url: Url = LOCAL_URL,
    token_file: TokenFile = None,
    as_json: Json = False,
) -> None:
    """Follow poses, alerts and trainings as they happen, across lost connections, until Ctrl-C."""
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: sys.exit(End.FINE))
    with asked(url, token_file) as service:
        service.get("/cameras", limit=1)  # a wrong address or token does not mend by waiting
        for event in _following(service):
            document = json.loads(event.data)
            if as_json:
                tell({"id": event.id, "event": event.kind, "data": document})
            else:
                typer.echo(plain(f"{datetime.now():%H:%M:%S}  {_told(event.kind, document)}"))


def _following(service: "Service") -> Iterator["Event"]:
    """Events without an end; each stream goes on where the last one was lost."""
    from surefoot.bridge.service import LaterError, RefusedError

    delay_s = _FIRST_S
    while True:
        try:
            for event in service.events(service.heard):
                delay_s = _FIRST_S
                if event is not None:
                    yield event
        except (LaterError, RefusedError) as error:
            words = f"surefoot: {error}; the next try is in {delay_s:.0f} s"
            typer.echo(plain(words), err=True)
            time.sleep(delay_s)
            delay_s = min(2 * delay_s, _LONGEST_S)


def _counted(counts: Counter[str], words: type[PoseState] | type[Severity]) -> str:
    """The counts of the words that there are any of, and how many that is."""
    said = [f"{counts[word]} {word.replace('_', ' ')}" for word in words if counts[word]]
    return f"{counts.total()} ({', '.join(said)})" if said else "none"


def _learned(reference: dict[str, Any]) -> str:
    people = f"{reference['counted']} of {reference['wanted']}"
    ready = reference["state"] == ReferenceState.READY
    return reference["state"] if ready else f"{reference['state']}, {people}"


def _waits(alert: dict[str, Any]) -> bool:
    """True where nobody has taken an alert up, and no group speaks for it."""
    return not (alert["acknowledged"] or alert["silenced"] or alert["group_id"])


def _row_of(alert: dict[str, Any]) -> tuple[str, ...]:
    state = (
        f"acknowledged by {alert['acknowledged_by']}" if alert["acknowledged"] else alert["state"]
    )
    opened = datetime.fromisoformat(alert["opened_at"]).astimezone()
    told = (f"{opened:%Y-%m-%d %H:%M}", _whose(alert), alert["kind"], alert["severity"])
    return alert["id"], *told, state, alert["reason"]


def _whose(alert: dict[str, Any]) -> str:
    """The camera of an alert; of a group's, how many."""
    return alert["camera_id"] or f"{len(alert['camera_ids'] or ())} cameras"


def _told(kind: str, event: dict[str, Any]) -> str:
    """An event in a line."""
    words = [kind, event.get("camera_id") or "-"]
    if kind == EventType.ALERT:
        words += [event["id"], event["kind"], event["severity"], event["state"], event["reason"]]
    elif kind == EventType.POSE:
        words += [event["state"], f"by {event['tracks']} tracks"]
    else:
        words += [event.get("state", "")]
    return "  ".join(words)


REMOTE_COMMANDS = (status, cameras, alerts, ack, tail)
