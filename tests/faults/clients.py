"""Clients of the service under test: trackers that post, and a person who acts on alerts."""

import math
import random
import threading
import time
from typing import Any

import httpx

from service.alerts import alerts
from service.enums import AlertKind, Severity
from service.reasons import as_said
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.faults.ledger import Ledger
from tests.faults.stand import Stand

_PATIENCE_S = 5.0
SOURCE = "tracker-{}"


class Client(threading.Thread):
    """Something that asks until it is answered; `over` ends it after its last answer."""

    def __init__(self, stand: Stand, ledger: Ledger, over: threading.Event, seed: int) -> None:
        super().__init__(daemon=True)
        self.stand, self.ledger, self.over = stand, ledger, over
        self.random = random.Random(seed)
        self.http = self._connected()

    def _connected(self) -> httpx.Client:
        """To any machine, as a proxy before them would choose."""
        url = self.random.choice(self.stand.machines).url
        return httpx.Client(base_url=url, timeout=_PATIENCE_S)

    def ask(self, what: str, method: str, path: str, **more: Any) -> httpx.Response | None:
        """One request; None where nobody answered, which is no fault of a killed service."""
        try:
            answer = self.http.request(method, path, **more)
        except httpx.HTTPError:
            self.http.close()
            self.http = self._connected()
            return None
        self.ledger.answered(what, answer.status_code, answer.text)
        return answer

    def insist(self, what: str, method: str, path: str, **more: Any) -> httpx.Response | None:
        """Ask until an answer is final: anything but silence, 429 and 5xx."""
        wait_s = 0.1
        while not self.over.is_set():
            answer = self.ask(what, method, path, **more)
            if answer is not None and answer.status_code != 429 and answer.status_code < 500:
                return answer
            asked_s = answer.headers.get("retry-after", "") if answer is not None else ""
            time.sleep(min(float(asked_s), 5.0) if asked_s.isdigit() else wait_s)
            wait_s = min(2 * wait_s, 1.0)
        return None


class Tracker(Client):
    """Posts people of one camera, a few at a time, and notes what was acknowledged."""

    def __init__(self, camera_id: str, number: int, pause_s: float, *args: Any) -> None:
        super().__init__(*args)
        self.camera_id, self.pause_s = camera_id, pause_s
        self.source = SOURCE.format(number)
        self.count = 0

    def run(self) -> None:
        while not self.over.is_set():
            tracks = [self._person() for _ in range(self.random.randint(1, 4))]
            path = f"/cameras/{self.camera_id}/tracks"
            body = {"source": self.source, "tracks": tracks}
            answer = self.insist("POST tracks", "POST", path, json=body)
            if answer is None:
                return
            if answer.status_code == 202:
                refused = {item["index"] for item in answer.json()["rejected"]}
                self.ledger.oddities["tracks refused"] += len(refused)
                kept = [track for n, track in enumerate(tracks) if n not in refused]
                keys = {(self.camera_id, self.source, t["id"], t["points"][0][0]) for t in kept}
                self.ledger.acknowledge(keys)
            else:
                self.ledger.oddities[f"POST tracks {answer.status_code}: {answer.text[:80]}"] += 1
            time.sleep(self.random.uniform(0, 2 * self.pause_s))

    def _person(self) -> dict[str, Any]:
        self.count += 1
        start_s = round(self.stand.now_s() - 30 + self.random.random(), 3)
        u, v = self.random.uniform(150, 500), self.random.uniform(250, 450)
        du, dv = self.random.uniform(15, 28), self.random.uniform(1, 9)
        noise = self.random.gauss
        points = [
            [round(start_s + 0.4 * n, 3), u + du * n + noise(0, 1), v + dv * n + noise(0, 1)]
            for n in range(20)
        ]
        return {"id": str(self.count), "points": points}


class Operator(Client):
    """Alerts open at a camera; a person acts on each, and the acts that were answered are noted."""

    def __init__(self, camera_id: str, *args: Any) -> None:
        super().__init__(*args)
        self.camera_id = camera_id

    def run(self) -> None:
        while not self.over.is_set():
            time.sleep(self.random.uniform(0.3, 1.5))
            alert_id = self._open()
            if alert_id is None:
                continue
            self.ledger.act(alert_id, "alert.opened")
            until = time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime(self.stand.now_s() + 7200))
            for act, body, type_ in (
                ("acknowledge", {"by": "Ada"}, "alert.acknowledged"),
                ("silence", {"until": until, "reason": "known"}, "alert.silenced"),
                ("resolve", {"outcome": "false_alarm"}, "alert.resolved"),
            ):
                answer = self.insist(f"POST {act}", "POST", f"/alerts/{alert_id}/{act}", json=body)
                if answer is None:
                    break
                # 409: an attempt that nobody answered was carried out, or the clock went back.
                if answer.status_code == 200:
                    self.ledger.act(alert_id, type_)

    def _open(self) -> str | None:
        """As the estimate job does, in a transaction of another process."""
        store = Store(self.stand.settings)
        try:
            with store.write() as session:
                record = alerts.open_alert(
                    session,
                    self.stand.settings,
                    self.camera_id,
                    AlertKind.DRIFT,
                    Severity.WARNING,
                    {"tilt_rad": math.radians(5.0)},
                    None,
                    reasons=as_said("a fault run"),
                )
                found = None if record is None else record.id
        except Exception as error:
            # A full disk, a read-only one: the job would be run again.
            self.ledger.oddities[f"an alert could not be opened: {type(error).__name__}"] += 1
            return None
        finally:
            store.close()
        return found


def register(client: Client, camera_id: str, reference_tracks: int) -> None:
    """Register a camera, however often that has to be tried."""
    body = CAMERA | {"id": camera_id, "name": camera_id, "reference_tracks": reference_tracks}
    answer = client.insist("POST cameras", "POST", "/cameras", json=body)
    assert answer is not None
    assert answer.status_code in (201, 409), answer.text
