"""The examples of `/openapi.json`: requests that a real application takes, and what it answers.

Told by name of their schema, so that each stands once. Times are as if the run had begun at `_DAY`,
ids and secrets are made up, numbers are rounded: so that each run makes the same file.
"""

import hashlib
import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime, timedelta
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from fastapi.sse import format_sse_event
from fastapi.testclient import TestClient
from PIL import Image
from starlette.requests import Request

from service.api.documented import schema_name
from service.api.middleware.problems import problem
from service.app import create_app
from service.commands.migrate import migrate
from service.errors import OverloadedError, ServiceError, StorageFullError
from service.settings import Settings
from service.store import cameras, journal
from service.store.cameras import ProposedPoseRecord
from service.store.engines.store import Store
from service.workers.processes.workers import register_worker
from tests.conftest import CAMERA, track
from tests.service.bench import Bench, moved

EXAMPLES = Path(__file__).parents[2] / "service" / "api" / "examples.json"
_CALIBRATION = {
    "mtx": [[1100.0, 0.0, 639.5], [0.0, 1100.0, 359.5], [0.0, 0.0, 1.0]],
    "dist": [[-0.1, 0.02, 0.0, 0.0, 0.0]],
    "image_size": [1280, 720],
}
_DAY = datetime(2026, 11, 25, 8, tzinfo=UTC)
_TIME_STEP = timedelta(minutes=10)
_TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?:\.\d+)?(?:Z|\+00:00)")
_SECRET = re.compile(
    r"\bsf_[\w-]+|\bwhsec_[\w+/=-]+|\b[0-9a-f]{12}(?:[0-9a-f]{20}){0,1}(?:[0-9a-f]{32})?\b"
    r"|\b[0-9a-f]{13}\b"
)
_EXACT = re.compile(r"-?\d+\.\d{6,}(?:e[+-]\d+)?")
_LONGEST_TEXT = 40  # lines
# What depends on how fast this machine is.
_MEASURED = {
    **{
        "worker_silent_s": 1.2,
        "queue_lag_s": 0.4,
        "bridge_silent_s": 2.5,
        "taken_up_after_s": 660.0,
    },
    "done": "acknowledged by Ada after 11 minutes, open for 2 hours",
}

Examples = dict[str, Any]


def examples_file() -> str:
    """The content of the file of examples."""
    return json.dumps(made_examples(), ensure_ascii=False, indent=1) + "\n"


def made_examples() -> Examples:
    """Each schema's example, those of what has no schema by path, and problems by status."""
    with _run() as run:
        _cameras(run)
        _ground(run)
        _alerts(run)
        _acts(run)
        _others(run)
        problems = _problems(run)
    return {"schemas": run.schemas, "others": run.others, "problems": problems}


class _Run:
    """An application, with a camera that was knocked, and what it was asked and answered."""

    def __init__(self, http: TestClient, settings: Settings) -> None:
        self.http, self.settings = http, settings
        self.begun = datetime.now(UTC)
        self.schemas: Examples = {}
        self.others: Examples = {}
        self._names: dict[str, str] = {}
        self._paths = http.get("/openapi.json").json()["paths"]

    def ask(
        self,
        method: str,
        path: str,
        body: Any = None,
        headers: dict[str, str] | None = None,
        **ids: str,
    ) -> Any:
        """The answer to a request that is taken; both become examples."""
        operation = self._paths[path][method.lower()]
        answer = self.http.request(method, path.format(**ids), json=body, headers=headers)
        assert answer.is_success, answer.text
        if body is not None:
            self._keep(operation["requestBody"]["content"], "application/json", body, method, path)
        if answer.content:
            contents = operation["responses"][str(answer.status_code)]["content"]
            self._keep(contents, "application/json", answer.json(), method, path)
        return answer.json() if answer.content else None

    def ask_for(self, kind: str, path: str, query: Any = None, **ids: str) -> None:
        """A text of a type that is no JSON of ours; it becomes an example."""
        answer = self.http.get(path.format(**ids), params=query, headers={"Accept": kind})
        assert answer.is_success, answer.text
        self._keep({kind: {}}, kind, answer.text, "GET", path)

    def keep(self, method: str, path: str, kind: str, value: Any) -> None:
        """Keep an example of what has no schema with a name."""
        self.others.setdefault(f"{method} {path}", {})[kind] = self.settled(value)

    def _keep(self, contents: Any, kind: str, value: Any, method: str, path: str) -> None:
        name = schema_name(contents[kind].get("schema", {}))
        if name is None:
            self.keep(method, path, kind, value)
        else:
            self.schemas.setdefault(name, self.settled(value))

    def settled(self, value: Any) -> Any:
        """A value without what another run would make otherwise."""
        if isinstance(value, dict):
            return {k: _MEASURED.get(k, self.settled(v)) for k, v in value.items()}
        if isinstance(value, list):
            return [self.settled(each) for each in value]
        if isinstance(value, float):
            return round(value, 4) + 0.0  # no -0.0
        return self._settled_text(value) if isinstance(value, str) else value

    def _settled_text(self, text: str) -> str:
        lines = text.splitlines(keepends=True)
        text = "".join(lines[:_LONGEST_TEXT])
        text = _TIME.sub(lambda match: self._time(match[0]), text)
        text = _SECRET.sub(lambda match: self._name(match[0]), text)
        return _EXACT.sub(lambda match: f"{float(match[0]):.6g}", text)

    def _time(self, text: str) -> str:
        at = datetime.fromisoformat(text)
        if not timedelta(days=-3) < at - self.begun < timedelta(days=400):
            return text  # made up already
        # Whole ten minutes: a slow machine takes seconds longer from `begun` to a time.
        after = (at - self.begun) // _TIME_STEP * _TIME_STEP
        return f"{_DAY + after:%Y-%m-%dT%H:%M:00Z}"

    def _name(self, text: str) -> str:
        if text not in self._names:
            made = hashlib.sha256(str(len(self._names)).encode()).hexdigest()
            prefix, secret, _ = text.partition("_")
            self._names[text] = f"{prefix}_{made[:32]}" if secret else made[: len(text)]
        return self._names[text]


@contextmanager
def _run() -> Iterator[_Run]:
    with TemporaryDirectory() as folder:
        settings = Settings(
            data_dir=Path(folder) / "data",
            workers=0,
            snapshots="pictures",
            webhook_allow="203.0.113.0/24",
            allowed_hosts="testserver",
            worker_lost_s=1e6,
        )
        migrate(settings)
        with TestClient(create_app(settings)) as http:
            yield _Run(http, settings)


def _cameras(run: _Run) -> None:
    labels = {"site": "campus/north", "tags": ["nvr-east", "outdoor"]}
    run.ask("POST", "/cameras", CAMERA | labels | {"reference_tracks": 200})
    run.ask("POST", "/calibrations", _CALIBRATION)
    bench = Bench(run.http, run.settings.model_copy(update={"window_tracks": 20}))
    with bench.store.write() as session:
        register_worker(session, "local-1", 1)
    bench.see(moved())
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0, roll_deg=-2.0), paths=True)
    one = {"camera_id": "corner"}
    run.ask("GET", "/cameras")
    run.ask("GET", "/cameras/{camera_id}", **one)
    path = "/cameras/{camera_id}/pose"
    run.ask("GET", path, **one)
    for kind, query in (
        ("application/yaml", {"format": "opencv"}),
        ("application/geo+json", {"format": "geojson"}),
        ("application/vnd.surefoot.calibration+json", {"format": "nvidia"}),
    ):
        run.ask_for(kind, path, query, **one)
    run.ask_for("application/yaml", f"{path}.yaml", **one)
    run.ask("GET", f"{path}/history", **one)
    run.schemas["History"]["items"] = run.schemas["History"]["items"][-1:]
    with bench.store.read() as session:
        newest = {e.type: e for e in journal.events_after(session, 0, 1000)}
    lines = [
        format_sse_event(id=str(e.id), event=kind, data_str=json.dumps(run.settled(e.payload)))
        for kind, e in sorted(newest.items(), key=lambda item: item[1].id)
    ]
    run.keep("GET", "/events", "text/event-stream", b"".join(lines).decode())
    bench.store.close()
    bench.queue.close()


def _ground(run: _Run) -> None:
    one = {"camera_id": "corner"}
    run.ask("POST", "/cameras/{camera_id}/ground", {"points": [[640.0, 500.0], [900, 40]]}, **one)
    run.ask("POST", "/cameras/{camera_id}/image", {"points": [[12.0, 14.5]]}, **one)
    path = "/cameras/{camera_id}/zones"
    door = {"id": "door", "on": "ground", "points": [[300, 400], [500, 410], [480, 600]]}
    any_version = {"If-Match": "*"}
    run.ask("PUT", path, {"zones": [door]}, headers=any_version, **one)
    run.ask("GET", path, **one)
    for form in ("geojson", "axis", "frigate"):
        answer = run.http.get(path.format(**one), params={"format": form})
        assert answer.is_success, answer.text
        kind = answer.headers["content-type"].partition(";")[0]
        value = answer.text if "yaml" in kind else answer.json()
        run.keep("GET", path, kind, value)
        run.keep("PUT", path, kind, value)


def _alerts(run: _Run) -> None:
    (found,) = run.ask("GET", "/alerts")["items"]
    one = {"alert_id": found["id"]}
    run.ask("GET", "/alerts/{alert_id}/evidence", **one)
    run.ask("POST", "/alerts/{alert_id}/acknowledge", {"by": "Ada"}, **one)
    until = (run.begun + timedelta(hours=4)).isoformat()
    silence = {"until": until, "reason": "a van stands before it", "by": "Ada"}
    run.ask("POST", "/alerts/{alert_id}/silence", silence, **one)
    run.ask("GET", "/alerts/{alert_id}", **one)
    to = run.begun + timedelta(hours=1)
    report = run.http.get("/reports/weekly", params={"to": to.isoformat()}).json()
    begin = "2026-11-18T09:00:00Z"
    counts = {"alerts": 1, "moved": 1, "false_alarms": 0}
    report |= {"from": begin, "weeks": [{"begins_at": begin, **counts}]}
    run.schemas["Report"] = run.settled(report)
    file = run.http.get("/alerts", params={"format": "csv", "limit": 1}).text
    run.keep("GET", "/alerts", "text/csv", file)
    run.ask("POST", "/actions", {"ids": [found["id"]], "action": "acknowledge", "by": "Ada"})
    given = {"outcome": "put_back", "note": "a ladder had leant on it", "by": "Ada"}
    run.ask("POST", "/alerts/{alert_id}/resolve", given, **one)


def _acts(run: _Run) -> None:
    one = {"camera_id": "corner"}
    tracks = "/cameras/{camera_id}/tracks"
    given = {
        "source": "bytetrack-1.2",
        "size": [1280, 720],
        "tracks": [_walk("17"), {"id": "18", "points": _walk("18")["points"][:2]}],
    }
    run.ask("POST", tracks, given, **one)
    texts = {
        "application/x-ndjson": "".join(f"{json.dumps(_walk(name))}\n" for name in ("19", "20")),
        "text/csv": "".join(
            f"{1 + 12 * n},21,{300 + 12 * n},{250 + 5 * n},60,150,0.9,-1,-1,-1\n" for n in range(6)
        ),
    }
    for kind, text in texts.items():
        query = {"started_at": "2026-11-20T08:00:00Z", "frame_rate_hz": 25}
        headers = {"Content-Type": kind}
        path = tracks.format(**one)
        answer = run.http.post(path, content=text, params=query, headers=headers)
        assert answer.json()["accepted"] > 0, answer.text
        run.keep("POST", tracks, kind, text)
    run.ask("GET", "/cameras/{camera_id}/sources", **one)
    beat = {
        "started_at": run.begun.isoformat(),
        "connected": True,
        "waiting": 0,
        "counts": {"messages": 412, "tracks_posted": 31},
        "cameras": [one["camera_id"]],
    }
    run.ask("PUT", "/bridges/{bridge}", beat, bridge="surefoot-bridge")
    said = {"by": "Ada", "note": "looked at it on site"}
    use = {"by": "Ada"}
    run.ask("POST", "/cameras/{camera_id}/pose/put-back", said, **one)
    run.ask("POST", "/cameras/{camera_id}/sources/{source}/use", use, **one, source="bytetrack-1.2")
    run.ask("POST", "/cameras/{camera_id}/reference/reset", said, **one)
    _accept(run, said)
    _confirm(run, said)
    window = {"to": (run.begun + timedelta(hours=2)).isoformat(), "reason": "a lens", "by": "Ada"}
    made = run.ask("POST", "/cameras/{camera_id}/maintenance", window, **one)
    run.ask("GET", "/cameras/{camera_id}/maintenance", **one)
    later = {"to": (run.begun + timedelta(hours=3)).isoformat()}
    path = "/cameras/{camera_id}/maintenance/{window_id}"
    run.ask("PATCH", path, later, **one, window_id=made["id"])
    run.ask("DELETE", path, **one, window_id=made["id"])
    training = run.ask("POST", "/cameras/{camera_id}/trainings", {"recipe": "default"}, **one)
    run.ask("GET", "/cameras/{camera_id}/trainings", **one)
    run.schemas["TrainingList"]["items"] = run.schemas["TrainingList"]["items"][:1]
    run.ask("DELETE", "/trainings/{training_id}", training_id=training["id"])


def _accept(run: _Run, said: Any) -> None:
    """A camera of its own, with a pose to accept."""
    run.http.delete("/cameras/corner", headers={"If-Match": "*"}).raise_for_status()
    run.http.post("/cameras", json=CAMERA).raise_for_status()
    bench = Bench(run.http, run.settings.model_copy(update={"window_tracks": 20}))
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    for path in ("accept", "undo"):
        run.ask("POST", f"/cameras/{{camera_id}}/pose/{path}", said, camera_id="corner")
    bench.store.close()
    bench.queue.close()


def _confirm(run: _Run, said: Any) -> None:
    """A camera without a prior pose, whose people have told one."""
    bare = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    run.http.post("/cameras", json=bare | {"id": "gate"}).raise_for_status()
    store = Store(run.settings)
    with store.write() as session:
        session.add(
            ProposedPoseRecord(
                prior_pose_id=cameras.prior_pose(session, "gate").id,
                **{"height_m": 5.8, "tilt_rad": 0.4, "roll_rad": 0.0},
                covariance=[[1e-4, 0.0, 0.0], [0.0, 1e-4, 0.0], [0.0, 0.0, 1e-3]],
                identifiable=["tilt", "roll", "height"],
                **{"tracks": 80, "walking_groups": 61},
                created_at=run.begun,
            )
        )
    store.close()
    door = {"kind": "vertical", "points": [[400, 500], [401, 310]], "length_m": 2.1}
    kerb = {"kind": "length", "points": [[300, 560], [900, 575]], "length_m": 6.0}
    run.ask("PUT", "/cameras/{camera_id}/hints", [door, kerb], camera_id="gate")
    run.ask("GET", "/cameras/{camera_id}/hints", camera_id="gate")
    run.ask("POST", "/cameras/{camera_id}/pose/confirm", said, camera_id="gate")


def _others(run: _Run) -> None:
    run.http.headers["If-Match"] = "*"
    change = {"name": "The corner, north", "reference_tracks": 300}
    run.ask("PATCH", "/cameras/{camera_id}", change, camera_id="corner")
    del run.http.headers["If-Match"]
    still = BytesIO()
    Image.fromarray(np.zeros((180, 320, 3), np.uint8)).save(still, "PNG")
    snapshot = "/cameras/corner/snapshot"
    headers = {"Content-Type": "image/png"}
    kept = run.http.put(snapshot, content=still.getvalue(), headers=headers)
    run.schemas["SnapshotOut"] = run.settled(kept.json())
    scale = {"metres_per_pixel": 0.1, "north_deg": 12}
    kept = run.http.put(
        "/cameras/corner/plan", content=still.getvalue(), headers=headers, params=scale
    )
    run.schemas["PlanOut"] = run.settled(kept.json())
    run.ask("POST", "/cameras/{camera_id}/aim", camera_id="corner")
    hook = {"url": "https://203.0.113.7/surefoot", "name": "on call", "kinds": ["drift"]}
    made = run.ask("POST", "/webhooks", hook)
    one = {"webhook_id": made["id"]}
    run.ask("GET", "/webhooks")
    run.ask("PATCH", "/webhooks/{webhook_id}", {"name": "on call, day"}, **one)
    run.ask("POST", "/webhooks/{webhook_id}/secret", **one)
    run.ask("POST", "/webhooks/{webhook_id}/test", **one)
    run.ask("GET", "/webhooks/{webhook_id}/deliveries", **one)
    year = (run.begun + timedelta(days=365)).isoformat()
    run.ask(
        "POST",
        "/tokens",
        {"name": "gate tracker", "scopes": ["ingest"], "cameras": ["corner"], "expires_at": year},
    )
    run.ask("GET", "/tokens")
    shift = {"since": (run.begun - timedelta(hours=8)).isoformat(), "note": "gate 3 is repaired"}
    given = run.ask("POST", "/handovers", shift | {"by": "Ada"})
    path = "/handovers/{handover_id}/take"
    run.ask("POST", path, {"by": "Bo"}, handover_id=given["id"])
    run.ask("GET", "/handovers")
    run.ask("GET", "/activity")
    run.schemas["ActivityPage"]["items"] = run.schemas["ActivityPage"]["items"][:2]
    run.ask_for("application/x-ndjson", "/activity", {"limit": 2})
    run.keep("GET", "/activity", "text/csv", run.http.get("/activity?format=csv&limit=2").text)
    run.ask("GET", "/healthz")
    run.ask("GET", "/readyz")
    for kind in ("text/plain", "application/openmetrics-text"):
        text = run.http.get("/metrics", headers={"Accept": kind}).text
        shown = [line for line in text.splitlines() if re.search(r"surefoot_cameras\b", line)]
        run.keep("GET", "/metrics", kind, "\n".join([*shown, ""]))


def _problems(run: _Run) -> Examples:
    """The problem document of each status, all but two as they are answered."""
    text, as_json = {"Content-Type": "text/plain"}, {"Content-Type": "application/json"}
    http, made = run.http, "/cameras/corner"
    answers = [
        http.post("/cameras", content=b"\xff", headers=as_json),
        http.get("/cameras/nowhere"),
        http.post("/cameras", json=CAMERA),
        http.patch(made, json={"name": "a"}, headers={"If-Match": '"corner-1"'}),
        http.post("/cameras", content=b" " * 2_000_000, headers=as_json),
        http.post(f"{made}/tracks", content=b"a", headers=text),
        http.get("/cameras", headers={"Host": "other.example"}),
        http.post("/cameras", json={**CAMERA, "id": "b", "frame_rate_hz": 0}),
        http.delete(made),
    ]
    token = http.post("/tokens", json={"name": "gate", "scopes": ["ingest"]}).json()["token"]
    closed = run.settings.model_copy(update={"auth": "on", "caller_rate": 0.1})
    with TestClient(create_app(closed)) as strict:
        bearer = {"Authorization": f"Bearer {token}"}
        answers += [strict.get("/cameras"), strict.get("/cameras", headers=bearer)]
        posts = [strict.post(f"{made}/tracks", content=b"", headers=bearer) for _ in range(3)]
        answers.append(posts[-1])
    assert not any(answer.is_success for answer in answers)
    found = {str(answer.status_code): answer.json() for answer in answers}
    found |= {
        str(error.status): _of(error)
        for error in (
            OverloadedError("store: another process was writing all the time", retry_after_s=2),
            StorageFullError("store: the disk is full; nothing was stored", retry_after_s=60),
        )
    }
    return {status: run.settled(found[status]) for status in sorted(found)}


def _of(error: ServiceError) -> Any:
    scope = {"type": "http", "method": "GET", "path": "/", "headers": []}
    return json.loads(bytes(problem(Request(scope), error).body))


def _walk(name: str) -> dict[str, Any]:
    return track(name, start_s=1_764_057_600.0, count=6)
