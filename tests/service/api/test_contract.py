"""Thousands of requests out of the API's own description: no 5xx, and nothing undocumented.

In CI the corners of each schema and a little more, the same each time; `SUREFOOT_TEST_CASES=20000`
makes so many, of other seeds, too. `pytest -s` shows the counts by path and status.

Left out: `/events`, which has no end. The application runs in this process: what only a socket
shows (half a header, a body that never ends) is not tried here.
"""

import json
import os
import sys
import time
from collections import Counter
from traceback import format_exception

import pytest
import schemathesis
from fastapi.testclient import TestClient
from schemathesis.core.failures import ServerError
from schemathesis.core.media_types import YAML_MEDIA_TYPES
from schemathesis.engine import events, from_schema
from schemathesis.hooks import GLOBAL_HOOK_DISPATCHER

from service.app import create_app
from tests.conftest import CAMERA, track
from tests.service.api.contract import NASTY_WORDS, Ground, Watched, spoilt

pytestmark = [
    pytest.mark.slow,
    pytest.mark.timeout(3600),
    pytest.mark.filterwarnings("ignore:Generating overly large repr"),
]

CASES = int(os.environ.get("SUREFOOT_TEST_CASES", "0"))
_CHECKS = (
    "not_a_server_error",
    "status_code_conformance",
    "content_type_conformance",
    "response_schema_conformance",
    "response_headers_conformance",
)
_PHASES = ("coverage", "fuzzing", "stateful")


@schemathesis.deserializer(*YAML_MEDIA_TYPES)
def opencv_yaml(context, response):
    """OpenCV's first line, `%YAML:1.0`, is none for other readers of YAML."""
    return response.content.decode()


def configured(seed, phase, examples):
    """One phase at a time, so that each has its share of the cases."""
    generation = {"max-examples": examples, "no-shrink": True}
    return schemathesis.Config.from_dict(
        {
            "seed": seed,
            "suppress-health-check": ["all"],
            "cache": {"enabled": False},
            "generation": generation,
            "checks": {"enabled": False} | {name: {"enabled": True} for name in _CHECKS},
            "phases": {
                **{name: {"enabled": name == phase} for name in ("examples", *_PHASES)},
                # A method that no path knows and one that some do, of nine.
                "coverage": {
                    "enabled": phase == "coverage",
                    "unexpected-methods": ["QUERY", "DELETE"],
                },
            },
        }
    )


def failures_of(recorder):
    for case_id, checks in recorder.checks.items():
        for check in checks:
            if check.failure_info is not None:
                yield case_id, check.failure_info.failure


@pytest.fixture
def watched(settings):
    changed = settings.model_copy(
        update={
            "snapshots": "pictures",
            "webhook_allow": "127.0.0.0/8",
            "worker_lost_s": 1e6,
            "caller_rate": 0,
            "camera_rate": 0,
        }
    )
    app = create_app(changed)
    made = Ground(app, changed)

    def before_call(context, case, kwargs):
        made.aim(case)

    def filter_failure(context, failure, case, response):
        """503 may come where it says when to come back, and where it is what was asked for."""
        awaited = "retry-after" in response.headers or case.path == "/readyz"
        return not (isinstance(failure, ServerError) and response.status_code == 503 and awaited)

    for hook in (before_call, filter_failure):
        schemathesis.hook(hook)
    yield Watched(app)
    for hook in (before_call, filter_failure):
        GLOBAL_HOOK_DISPATCHER.unregister(hook)
    made.close()


def test_every_path_answers_as_it_is_documented(watched):
    found = {}
    go(watched, found, configured(0, "coverage", 1))  # the corners of each schema, always the same
    seed = 0
    while seed == 0 or watched.total < CASES:
        seed += 1
        go(watched, found, configured(seed, "fuzzing", 12 if CASES else 2))
        go(watched, found, configured(seed, "stateful", 60 if CASES else 10))
    tell(watched)
    lines = [f"{count} x {key}\n{example}" for key, (count, example) in found.items()]
    lines += [f"{count} x {crash}" for crash, count in watched.crashes.items()]
    assert not lines, "\n\n".join(lines)
    paths = {route.replace(":path}", "}") for route, _, _ in watched.counts}
    assert set(watched.app.openapi()["paths"]) - paths == {"/events"}


@pytest.mark.nightly
def test_no_value_in_a_good_body_or_query_is_too_hard_to_take(watched):
    people = {
        "source": "a",
        "started_at": "2026-11-21T00:00:00Z",
        "frame_rate_hz": 25,
        "tracks": [track("1", start_s=time.time() - 600)],
    }
    silence = {"until": "2026-11-21T00:00:00Z", "reason": "x", "by": "Ada"}
    bodies = {
        "/cameras": CAMERA,
        "/cameras/ok/tracks": people,
        "/cameras/ok/trainings": {"recipe": "default", "seed": 1},
        "/cameras/busy/maintenance": {"from": None, "to": silence["until"], "reason": "x"},
        "/alerts/x/silence": silence,
        "/alerts/x/resolve": {"outcome": "false_alarm", "note": "x"},
        "/webhooks": {"url": "http://127.0.0.1:9/"},
        "/tokens": {
            "name": "gate",
            "scopes": ["ingest"],
            "cameras": ["ok"],
            "expires_at": "2099-01-01T00:00:00Z",
        },
    }
    broken = set()
    with TestClient(watched.app, raise_server_exceptions=False) as http:
        for path, body in bodies.items():
            for spoiled in spoilt(body):
                content = json.dumps(spoiled).encode()
                answer = http.post(
                    path, content=content, headers={"Content-Type": "application/json"}
                )
                if answer.status_code >= 500:
                    broken.add((path, content[:300], answer.status_code))
        for path, operations in http.get("/openapi.json").json()["paths"].items():
            names = [p["name"] for p in operations.get("get", {}).get("parameters", ())]
            for name in names if path != "/events" else ():
                for word in NASTY_WORDS:
                    answer = http.get(path.replace("{camera_id}", "ok"), params={name: word})
                    if answer.status_code >= 500:
                        broken.add((path, name, word))
    assert not broken, "\n".join(map(str, sorted(broken, key=str)))


def go(watched, found, config):
    """Carry out a phase; what is wrong joins what was found."""
    schema = schemathesis.openapi.from_asgi("/openapi.json", watched, config=config)
    for event in from_schema(schema.exclude(path="/events")).execute():
        if isinstance(event, events.ScenarioFinished):
            note(found, event)
        elif isinstance(event, events.NonFatalError):
            key = ("no case could be made", event.label, str(event.value)[:300])
            example = "".join(format_exception(event.value)[-3:])
            found.setdefault(key, [0, example])[0] += 1
        elif isinstance(event, events.FatalError):
            raise event.exception


def note(found, event):
    for case_id, failure in failures_of(event.recorder):
        interaction = event.recorder.interactions[case_id]
        status = None if interaction.response is None else interaction.response.status_code
        case = event.recorder.cases[case_id].value
        key = (failure.title, case.method, case.operation.path, status)
        known = found.setdefault(key, [0, f"{failure.message}\n{case.as_curl_command()[:1500]}"])
        known[0] += 1


def tell(watched):
    """Print the counts by path and status."""
    table = Counter()
    for (route, method, status), count in watched.counts.items():
        table[f"{method} {route}", status] += count
    lines = []
    for name in sorted({name for name, _ in table}):
        row = {s: c for (n, s), c in sorted(table.items()) if n == name}
        lines.append(f"{name:55s} " + "  ".join(f"{s}: {c}" for s, c in row.items()))
    sys.stdout.write("\n".join([*lines, f"{watched.total} requests", ""]))
