"""What the requests of `test_contract.py` are made against, and what makes them reach deep.

A request out of a description alone mostly ends at 404: what names a camera, an alert or a version
here is replaced by one that exists, more often than not, and what requests use up is put back.
"""

import json
import random
import traceback
from collections import Counter
from collections.abc import Iterator
from copy import deepcopy
from datetime import UTC, datetime, timedelta
from io import BytesIO
from typing import Any
from zlib import crc32

from fastapi import FastAPI
from fastapi.testclient import TestClient
from PIL import Image
from sqlalchemy import delete, select

from service.cameras import cameras
from service.enums import MessageType
from service.formats.still import read_still
from service.notifications import webhooks
from service.notifications.outbox import add_delivery
from service.notifications.webhooks import WebhookSpec
from service.settings import Settings
from service.store import cameras as stored_cameras
from service.store.alerts import AlertRecord
from service.store.cameras import CameraRecord, SnapshotRecord
from service.store.references import MaintenanceRecord
from service.store.trainings import TrainingRecord
from service.store.webhooks import DeliveryRecord, WebhookRecord
from service.training.trainings import queue_training
from service.workers.processes.workers import register_worker
from tests.conftest import CAMERA, track
from tests.service.fleet_bench import Fleet

URL = "http://127.0.0.1:9/hook"
_LATER = (datetime.now(UTC) + timedelta(hours=2)).isoformat()
# Fields that are taken, by the end of the path that takes them.
_GOOD: dict[str, dict[str, Any]] = {
    "cameras": CAMERA,
    "{camera_id}": {name: CAMERA[name] for name in ("name", "intrinsics", "prior_pose")},
    "webhooks": {"url": URL},
    "{webhook_id}": {"url": URL},
    "maintenance": {"to": _LATER},
    "{window_id}": {"to": _LATER},
    "silence": {"until": _LATER, "reason": "known"},
    "resolve": {"outcome": "false_alarm"},
    "trainings": {"recipe": "default", "seed": 1},
    "tokens": {"name": "gate", "scopes": ["ingest"], "cameras": ["ok"], "expires_at": _LATER},
}
# What JSON can say and a store or a clock cannot hold.
NASTY_WORDS = ("\x00", "", "9" * 30, "0001-01-01T00:00:00+14:00", "9999-12-31T23:59:59-14:00", "é")
NASTY: tuple[Any, ...] = (
    *NASTY_WORDS,
    "\ud800", "a\udfffb", "9" * 400, 10**400, 1e308, -1, None,
    [], {}, True, "\u202e", "x" * 5000,
)  # fmt: skip
# What of a request stays as it was made up, in a hundred.
_WILD = 40


class Watched:
    """The application, with its answers counted by route and status, and its crashes kept."""

    def __init__(self, app: FastAPI) -> None:
        self.app = app
        self.counts: Counter[tuple[str, str, int]] = Counter()
        self.crashes: Counter[str] = Counter()

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return

        async def noting(message: Any) -> None:
            if message["type"] == "http.response.start":
                route = getattr(scope.get("route"), "path", "unmatched")
                self.counts[route, scope["method"], message["status"]] += 1
            await send(message)

        try:
            await self.app(scope, receive, noting)
        except Exception as error:
            # It was answered with 500 already; a server would log it and go on.
            self.crashes["".join(traceback.format_exception(error)[-3:])] += 1

    @property
    def total(self) -> int:
        return sum(self.counts.values())


class Ground:
    """Cameras of all states with alerts, activity, maintenance, trainings, webhooks and a still."""

    def __init__(self, app: FastAPI, settings: Settings) -> None:
        self.fleet = Fleet(settings)
        self.store = self.fleet.store
        self.ids: dict[str, list[str]] = {}
        self.calls = 0
        self.still = BytesIO()
        Image.new("RGB", (320, 180)).save(self.still, "PNG")
        with TestClient(app) as http:
            self.refill()
            answers = [
                http.put(
                    "/cameras/ok/snapshot",
                    content=self.still.getvalue(),
                    headers={"content-type": "image/png"},
                ),
                http.post("/cameras/ok/tracks", json={"tracks": [track("1")]}),
                http.post(f"/alerts/{self.ids['alert_id'][0]}/acknowledge", json={"by": "Ada"}),
            ]
            assert [a.status_code for a in answers] == [200, 202, 200], [a.text for a in answers]

    def close(self) -> None:
        self.fleet.close()

    def refill(self) -> None:
        """Put back what requests have used up, and learn what there is now."""
        with self.store.read() as session:
            there = set(stored_cameras.ids(session))
        for name, state in (("new", "learning"), ("ok", "ok"), ("moved", "ok"), ("busy", "ok")):
            if name not in there:
                self.fleet.add(name, state=state, estimates=20, wanted=20)
        now = datetime.now(UTC)
        with self.store.write() as session:
            at_work = MaintenanceRecord.camera_id == "moved"  # then it opens no alert
            session.execute(delete(MaintenanceRecord).where(at_work))
        for kind in ("drift", "no_data", "clock"):
            self.fleet.knock("moved", kind=kind)
        with self.store.write() as session:
            register_worker(session, "made-up", 1)
            window = session.get(MaintenanceRecord, "window-busy")
            if window is None:
                window = MaintenanceRecord(
                    id="window-busy", camera_id="busy", from_at=now, reason="lens",
                    requested_by=None, created_at=now, updated_at=now, to_at=now,
                )  # fmt: skip
                session.add(window)
            window.to_at = now + timedelta(hours=1)
            still = read_still(self.still.getvalue(), "image/png")
            facts = {"width": still.width, "height": still.height, "sha256": "0" * 64}
            kept = SnapshotRecord(
                camera_id="ok", jpeg=still.jpeg, taken_at=now, stored_at=now, **facts
            )
            session.merge(kept)
            settings, queue = self.fleet.settings, self.fleet.queue
            queue_training(session, queue, settings, "ok")
            if session.scalar(select(WebhookRecord).limit(1)) is None:
                spec = WebhookSpec(url=URL, name="a", kinds=None, format="webhook", enabled=True)
                made = webhooks.create_webhook(session, settings, spec).record
                add_delivery(session, made, MessageType.TEST, {}, now)
            for name, column, order in (
                ("alert_id", AlertRecord.id, AlertRecord.opened_at),
                ("training_id", TrainingRecord.id, TrainingRecord.queued_at),
                ("webhook_id", WebhookRecord.id, WebhookRecord.created_at),
                ("delivery_id", DeliveryRecord.id, DeliveryRecord.created_at),
            ):
                found = session.scalars(select(column).order_by(order.desc()).limit(4))
                self.ids[name] = list(found)
        self.ids["camera_id"] = ["new", "ok", "moved", "busy"]
        self.ids["window_id"] = ["window-busy"]

    def aim(self, case: Any) -> None:
        """Point a request at what there is; the same request always at the same."""
        self.calls += 1
        if self.calls % 50 == 0:
            self.refill()
        chance = crc32(repr((case.method, case.path, case.path_parameters, case.body)).encode())
        if chance % 100 < _WILD:
            return
        chance //= 100
        for name in case.path_parameters or {}:
            if self.ids.get(name):
                case.path_parameters[name] = self.ids[name][chance % len(self.ids[name])]
        if "window_id" in (case.path_parameters or {}):
            case.path_parameters["camera_id"] = "busy"
        if case.path == "/cameras/{camera_id}" and case.method in ("PATCH", "DELETE"):
            case.headers["if-match"] = self._etag(case.path_parameters["camera_id"])
        if case.path.endswith("/zones") and case.method == "PUT":
            case.headers["if-match"] = "*"
        self._fill(case, chance)
        random_ = random.Random(chance)
        if case.query and random_.random() < 0.2:
            case.query[random_.choice(list(case.query))] = random_.choice(NASTY_WORDS)
        share = 0.6 if case.path.endswith("/tracks") else 0.2
        if isinstance(case.body, dict) and case.body and random_.random() < share:
            # The case's own is validated again where it has changed, by what takes no surrogates.
            body = deepcopy(case.body)
            _spoil(body, random_)
            # As clients write it that escape what is not ASCII: half a surrogate pair gets by.
            case.body = json.dumps(body, default=str).encode()

    def _etag(self, camera_id: str) -> str:
        with self.store.read() as session:
            record = session.get(CameraRecord, camera_id)
            return '"gone"' if record is None else cameras.etag_of(record)

    def _fill(self, case: Any, chance: int) -> None:
        if case.path.endswith("/tracks") and case.method == "POST":
            start_s = datetime.now(UTC).timestamp() - 3600 + chance % 3000
            if isinstance(case.body, dict):
                good = track(str(chance), start_s=start_s)
                if chance % 3 or not isinstance(case.body.get("tracks"), list):
                    case.body = {"source": "a", "started_at": _LATER, "tracks": []}
                case.body["tracks"].append(good)
                if chance % 4:
                    case.query = {}  # a wrong one there is refused before the body is read
        elif case.path.endswith(("/snapshot", "/plan")) and case.method == "PUT" and chance % 2:
            case.body = self.still.getvalue()
        elif isinstance(case.body, dict):
            good = _GOOD.get(case.path.rsplit("/", 1)[1], {})
            if case.path == "/cameras":
                good = {**good, "id": f"made-{chance % 50}"}
            # Each field by its own bit: all as they were made up, some, or none.
            for bit, (name, value) in enumerate(good.items()):
                if chance >> bit & 1 or chance % 3:
                    case.body[name] = deepcopy(value)  # it may be spoilt
            if chance % 3 == 1:
                for name in set(case.body) - set(good):
                    del case.body[name]


def _spoil(place: Any, random_: random.Random) -> None:
    """Put one value, somewhere in a body, that is hard to take."""
    while True:
        key = random_.choice(list(place) if isinstance(place, dict) else range(len(place)))
        inner = place[key]
        if not isinstance(inner, (dict, list)) or not inner or random_.random() < 0.2:
            place[key] = random_.choice(NASTY)
            return
        place = inner


def spoilt(body: Any) -> Iterator[Any]:
    """A good body with each value that is hard to take in each place; of lists, the first."""
    if isinstance(body, dict):
        for key in body:
            yield from ({**body, key: value} for value in spoilt(body[key]))
    elif isinstance(body, list) and body:
        yield from ([value, *body[1:]] for value in spoilt(body[0]))
    yield from NASTY
