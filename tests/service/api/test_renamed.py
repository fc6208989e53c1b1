"""Names that were replaced before the first release: no route, field or stored word has them."""

import re
from collections.abc import Iterator
from typing import Any

import pytest
from sqlalchemy import CheckConstraint

from service.enums import Activity
from service.reasons import CODES
from service.store.record import Record
from tests.service.alerts.test_states import knock
from tests.service.conftest import problem

_OLD = re.compile(
    r"act|agreed?|can_be_agreed|mended|mended_zones|would_notice|rivals?|off_sd|left_out|crept"
    r"|pose\.(agreed|mended)|tracks_left_out"
)


def names(part: Any) -> Iterator[str]:
    """Fields, parameters and enumerated words of an OpenAPI document."""
    if isinstance(part, list):
        for each in part:
            yield from names(each)
    if isinstance(part, dict):
        yield from part.get("properties", {})
        yield from (str(word) for word in part.get("enum", []))
        if "in" in part:
            yield part["name"]
        for each in part.values():
            yield from names(each)


@pytest.mark.parametrize("path", ["/acts", "/cameras/corner/pose/agree"])
def test_renamed_route_is_unknown(corner, path):
    answer = corner.post(path, json={"ids": ["corner"], "act": "reset"})
    assert answer.status_code == 404


def test_openapi_has_no_replaced_name(http):
    document = http.get("/openapi.json").json()
    found = set(names(document))
    assert {
        "action",
        "pose.confirmed",
        "fixed",
        "detectable",
        "alternatives",
        "residual_sd",
    } <= found
    assert {each for each in found if _OLD.fullmatch(each)} == set()
    assert "/actions" in document["paths"]
    assert "/cameras/{camera_id}/pose/confirm" in document["paths"]


def test_store_has_no_replaced_name():
    tables = Record.metadata.sorted_tables
    columns = {column.name for table in tables for column in table.columns}
    checks = [c for t in tables for c in t.constraints if isinstance(c, CheckConstraint)]
    words = {word for check in checks for word in re.findall(r"'([^']*)'", str(check.sqltext))}
    names_of_reasons = {str(code) for code in CODES}
    assert {"detectable", "alternatives", "confirmed", "fixed"} <= columns | words
    assert {"slow_drift", "tracks_skipped"} <= names_of_reasons
    found = columns | words | names_of_reasons | {str(kind) for kind in Activity}
    assert {each for each in found if _OLD.fullmatch(each)} == set()


def test_body_with_a_replaced_name_is_rejected(bench):
    knock(bench)
    (alert,) = bench.alerts(state="firing")
    old = {"ids": [alert["id"]], "act": "acknowledge"}
    problem(bench.http.post("/actions", json=old), 422, "malformed")
    resolve = f"/alerts/{alert['id']}/resolve"
    problem(bench.http.post(resolve, json={"outcome": "mended"}), 422, "malformed")


def test_answers_have_the_new_names_and_not_the_replaced_ones(bench):
    knock(bench)
    pose = bench.pose()
    assert {"detectable", "alternatives"} <= set(pose)
    (alert,) = bench.alerts(state="firing")
    done = {"ids": [alert["id"]], "action": "acknowledge", "by": "Ada"}
    bench.http.post("/actions", json=done).raise_for_status()
    detail = bench.http.get(f"/alerts/{alert['id']}").json()
    assert "corrected_zones" in detail
    assert [set(each) & {"act", "action"} for each in detail["acts"]] == [{"action"}]
    assert detail["acts"][0]["action"] == "acknowledged"
    evidence = bench.http.get(f"/alerts/{alert['id']}/evidence").json()
    assert "alternatives" in evidence
    assert not {"would_notice", "rivals"} & {*pose, *evidence}
