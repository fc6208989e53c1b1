"""Alerts as Alertmanager's v2 API takes them: `POST /api/v2/alerts`, a list of postableAlert.

Labels are an alert's identity there. They are the same for its whole life but for `severity`, by
which sites route: when that changes, the alert of the other severity is ended in the same request.
Times and numbers are annotations.
"""

from typing import Any

from service.enums import Severity
from service.wording.alerts import TEST_ENDS, alert_summary


def postable_alerts(
    body: dict[str, Any], public_url: str | None, *, changed: bool, at: str = ""
) -> list[dict[str, Any]]:
    """An alert, and those to end that have its name.

    Args:
        body: as of `GET /alerts/{id}`.
        public_url: where people reach the service; makes `generatorURL`.
        changed: whether its severity may have changed, so that the other one must be ended.
        at: now, when the other one ends.
    """
    alert = _postable(body, body["severity"], public_url)
    if not changed:
        return [alert]
    others = [severity for severity in Severity if severity != body["severity"]]
    return [alert, *(_postable(ended(body, at), severity, public_url) for severity in others)]


def ended(body: dict[str, Any], at: str) -> dict[str, Any]:
    """The same alert, ended at a time if it has not before."""
    return {**body, "resolved_at": body["resolved_at"] or at}


def postable_test(payload: dict[str, Any], now: str) -> dict[str, Any]:
    """A test alert that has ended as it comes: Alertmanager takes it and pages nobody."""
    return {
        "labels": {"alertname": "SurefootTest", "severity": "none"},
        "annotations": {"summary": str(payload["data"]["text"]), "description": TEST_ENDS},
        "startsAt": payload["timestamp"],
        "endsAt": now,
    }


def alert_name(kind: str) -> str:
    """`SurefootCameraNoData` of `no_data`."""
    return "SurefootCamera" + "".join(part.capitalize() for part in kind.split("_"))


def _postable(body: dict[str, Any], severity: str, public_url: str | None) -> dict[str, Any]:
    kind, camera_id = body["kind"], body["camera_id"]
    labels = {"alertname": alert_name(kind), "kind": kind, "severity": severity}
    if camera_id is not None:
        labels["camera_id"] = camera_id
    elif body.get("track_source"):  # of many cameras; another tracker's is another alert
        labels["track_source"] = body["track_source"]
    annotations = {
        "summary": alert_summary(kind, camera_id, body.get("camera_ids"), body.get("track_source")),
        "description": body["reason"],
        "alert_id": body["id"],
        **{f"drift_{name}": f"{value:g}" for name, value in _numbers(body["drift"]).items()},
    }
    for name in ("acknowledged_by", "outcome"):
        if body[name]:
            annotations[name] = body[name]
    # The change is told by the camera's clock. An alert that ended before it began is refused.
    started = min(body["changed_at"] or body["opened_at"], body["opened_at"])
    alert = {"labels": labels, "annotations": annotations, "startsAt": started}
    if body["resolved_at"]:
        alert["endsAt"] = body["resolved_at"]
    if public_url:
        alert["generatorURL"] = f"{public_url.rstrip('/')}/alerts/{body['id']}"
    return alert


def _numbers(drift: dict[str, Any] | None) -> dict[str, float]:
    values = (drift or {}).items()
    return {
        name: value
        for name, value in values
        if isinstance(value, int | float) and not isinstance(value, bool)
    }
