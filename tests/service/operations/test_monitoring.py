"""The example rules and dashboard name what `/metrics` has, and load."""

import json
import re
import subprocess
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import yaml
from prometheus_client.parser import text_string_to_metric_families as families

from service.alerts import alerts
from service.reasons import as_said
from service.workers.processes.workers import register_worker
from tests.service.bench import moved
from tests.service.operations.test_metrics import PROMTOOL, needs_promtool

FOLDER = Path(__file__).parents[3] / "deploy/monitoring"
RULES = yaml.safe_load((FOLDER / "rules.yml").read_text())
DASHBOARD = json.loads((FOLDER / "grafana.json").read_text())
SELECTOR = re.compile(r"(surefoot_[a-z0-9_]+)(?:\{([^}]*)\})?")
# Of Prometheus itself and of variables, not of our metrics.
FOREIGN_LABELS = {"instance"}


def rule_expressions():
    return [rule["expr"] for group in RULES["groups"] for rule in group["rules"]]


def dashboard_expressions():
    panels = [target["expr"] for panel in DASHBOARD["panels"] for target in panel["targets"]]
    variables = DASHBOARD["templating"]["list"]
    return panels + [v["definition"] for v in variables if v["type"] == "query"]


@pytest.fixture
def series(bench):
    """Label names of every sample of a service in which something of everything happens."""
    for _ in range(3):
        bench.see(moved(tilt_deg=14.0))
    bench.http.post("/webhooks", json={"url": "http://1.1.1.1/"}).raise_for_status()
    beat = {"started_at": "2026-11-20T08:00:00Z", "connected": True}
    bench.http.put("/bridges/one", json=beat).raise_for_status()
    with bench.store.write() as session:
        register_worker(session, "local-0", 1)
        record = alerts.show_alert(session, bench.alerts()[0]["id"])
        record.silenced_until = datetime.now(UTC) + timedelta(hours=1)
        words = as_said("another tracker")
        member = alerts.open_alert(
            session, bench.settings, "corner", "tracker", "warning", {}, None, reasons=words
        )
        member.group_id = record.id
    found = {}
    for family in families(bench.http.get("/metrics").text):
        for sample in family.samples:
            found.setdefault(sample.name, set()).update(sample.labels)
    return found


@pytest.mark.parametrize("expressions", [rule_expressions(), dashboard_expressions()])
def test_every_metric_and_label_that_is_named_exists(series, expressions):
    assert len(expressions) > 9
    for expression in expressions:
        selectors = SELECTOR.findall(expression)
        assert selectors, expression
        known = set(FOREIGN_LABELS)
        for name, matchers in selectors:
            assert name in series, f"{name} in {expression}"
            known |= series[name]
            for label in re.findall(r"([a-z_]+)\s*[=!]~?", matchers):
                assert label in series[name] | FOREIGN_LABELS, f"{label} of {name}"
        for grouped in re.findall(r"(?:by|on) \(([^)]*)\)", expression):
            assert set(re.split(r",\s*", grouped)) <= known, expression


def test_texts_of_rules_use_labels_that_their_expressions_keep(series):
    for group in RULES["groups"]:
        for rule in group["rules"]:
            names = {name for name, _ in SELECTOR.findall(rule["expr"])}
            known = FOREIGN_LABELS.union(*(series[name] for name in names))
            texts = " ".join(rule["annotations"].values())
            assert set(re.findall(r"\$labels\.(\w+)", texts)) <= known, rule["alert"]
            assert rule["labels"]["severity"] in ("warning", "critical")


def test_the_dashboard_is_one_that_grafana_loads():
    assert DASHBOARD["schemaVersion"] >= 36
    assert (DASHBOARD["id"], DASHBOARD["uid"]) == (None, None)  # Grafana gives its own
    assert DASHBOARD["title"]
    assert {"from", "to"} == set(DASHBOARD["time"])
    variables = {variable["name"]: variable for variable in DASHBOARD["templating"]["list"]}
    assert variables["datasource"]["type"] == "datasource"
    assert variables["datasource"]["query"] == "prometheus"
    source = {"type": "prometheus", "uid": "${datasource}"}
    assert all(v["datasource"] == source for v in variables.values() if v["type"] == "query")
    panels = DASHBOARD["panels"]
    assert len({panel["id"] for panel in panels}) == len(panels)
    taken = set()
    for panel in panels:
        assert panel["type"] in ("stat", "table", "timeseries")
        assert panel["title"]
        assert panel["datasource"] == source
        assert {"defaults", "overrides"} == set(panel["fieldConfig"])
        assert panel["targets"]
        for target in panel["targets"]:
            assert target["datasource"] == source
            assert target["refId"]
        place = panel["gridPos"]
        assert place["x"] + place["w"] <= 24
        cells = {
            (x, y)
            for x in range(place["x"], place["x"] + place["w"])
            for y in range(place["y"], place["y"] + place["h"])
        }
        assert not cells & taken, f"{panel['title']} lies upon another panel"
        taken |= cells
    used = set(re.findall(r"\$(\w+)", " ".join(dashboard_expressions())))
    assert used <= set(variables)


@needs_promtool
@pytest.mark.parametrize("command", [["check", "rules"], ["test", "rules"]])
def test_promtool_takes_the_rules(command):
    name = "rules.yml" if command[0] == "check" else "rules.test.yml"
    done = subprocess.run(
        [PROMTOOL, *command, name], cwd=FOLDER, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr


@needs_promtool
def test_promtool_parses_the_expressions_of_the_dashboard(tmp_path):
    """As recording rules; Grafana's variables are in strings, where anything may be."""
    rules = [
        {"record": f"panel:{number}", "expr": target["expr"]}
        for number, target in enumerate(
            target for panel in DASHBOARD["panels"] for target in panel["targets"]
        )
    ]
    path = tmp_path / "panels.yml"
    path.write_text(yaml.safe_dump({"groups": [{"name": "panels", "rules": rules}]}))
    done = subprocess.run(
        [PROMTOOL, "check", "rules", path], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
