"""What `/openapi.json` says of errors."""

from importlib.metadata import version

from service.enums import AlertKind, PoseState
from service.reasons import CODES


def answers(http, path, method):
    operation = http.get("/openapi.json").json()["paths"][path][method]
    return {
        int(status): list(answer.get("content", {}))
        for status, answer in operation["responses"].items()
    }


def test_errors_are_described_as_problem_documents(http):
    described = answers(http, "/cameras/{camera_id}", "patch")
    problem = ["application/problem+json"]
    assert described[200] == ["application/json"]
    for status in (404, 409, 412, 413, 422, 428, 429, 503):
        assert described[status] == problem
    schemas = http.get("/openapi.json").json()["components"]["schemas"]
    assert "HTTPValidationError" not in schemas
    body = http.patch("/cameras/nowhere", json={}).json()
    assert set(schemas["Problem"]["required"]) <= set(body) <= set(schemas["Problem"]["properties"])


def test_a_change_is_described_with_the_version_that_it_needs(http):
    paths = http.get("/openapi.json").json()["paths"]
    one = paths["/cameras/{camera_id}"]
    for method in ("patch", "delete"):
        for status in ("412", "428"):
            assert "ETag" in one[method]["responses"][status]["headers"]
    for method in ("get", "patch"):
        assert "ETag" in one[method]["responses"]["200"]["headers"]
    assert "ETag" in paths["/cameras"]["post"]["responses"]["201"]["headers"]


def test_it_says_which_scope_a_route_needs(http):
    document = http.get("/openapi.json").json()
    assert document["components"]["securitySchemes"]["token"]["scheme"] == "bearer"
    paths = document["paths"]
    assert paths["/cameras/{camera_id}/tracks"]["post"]["security"] == [{"token": ["ingest"]}]
    assert paths["/cameras/{camera_id}"]["patch"]["security"] == [{"token": ["admin"]}]
    assert paths["/healthz"]["get"]["security"] == []


def test_only_what_a_route_takes_can_be_wrong_about_it(http):
    assert set(answers(http, "/healthz", "get")) == {200}
    assert 404 not in answers(http, "/alerts", "get")
    assert 415 in answers(http, "/cameras/{camera_id}/tracks", "post")
    assert answers(http, "/readyz", "get")[503] == ["application/json"]
    assert answers(http, "/cameras/{camera_id}/pose.yaml", "get")[200] == ["application/yaml"]
    assert answers(http, "/cameras/{camera_id}/pose", "get")[304] == []


def test_a_code_stands_beside_every_reason(http):
    schemas = http.get("/openapi.json").json()["components"]["schemas"]
    for name in ("ServedPoseOut", "AlertOut", "AlertDetail"):
        fields = schemas[name]["properties"]
        assert {"reason", "reason_code", "reason_values"} <= set(schemas[name]["required"])
        code, nothing = fields["reason_code"]["anyOf"]
        assert (code["enum"], nothing) == (list(CODES), {"type": "null"})
    for name, words in (("PoseState", PoseState), ("AlertKind", AlertKind)):
        assert schemas[name]["enum"] == list(words)


def test_no_body_but_a_tokens_is_closed_to_fields_of_a_newer_version(http):
    schemas = http.get("/openapi.json").json()["components"]["schemas"]
    closed = [name for name, each in schemas.items() if each.get("additionalProperties") is False]
    assert closed == ["TokenBody"]


def test_the_api_has_the_version_of_its_release(http):
    assert http.get("/openapi.json").json()["info"]["version"] == version("surefoot")


def test_each_route_has_a_name_and_a_summary_of_its_own(http):
    paths = http.get("/openapi.json").json()["paths"]
    operations = [each for methods in paths.values() for each in methods.values()]
    ids = [each["operationId"] for each in operations]
    summaries = [each["summary"] for each in operations]
    assert len(set(ids)) == len(ids)
    assert len(set(summaries)) == len(summaries)
    for operation_id, summary in zip(ids, summaries, strict=True):
        assert "_" in operation_id, operation_id  # a verb and an object, not "show"
        assert 2 <= len(summary.split()) <= 12, summary
        assert summary[0].isupper(), summary
        assert not summary.endswith("."), summary
    named = paths["/cameras/{camera_id}/sources/{source}/use"]["post"]
    assert (named["operationId"], named["summary"]) == (
        "activate_source",
        "Activate a source of tracks",
    )
