"""The examples of `/openapi.json`: every request and answer has one, and each is of its schema.

That requests are taken and answered so, `tests/reference/examples.py` makes sure by doing it, and
`tests/test_reference.py` by doing it again.
"""

import jsonschema_rs
import pytest

# What is no text, and a file of Python.
WITHOUT = {"image/png", "image/jpeg", "application/zip", "text/x-python"}


@pytest.fixture
def document(http):
    return http.get("/openapi.json").json()


def contents(document):
    """Each content of a request or an answer, with where it is."""
    for path, operations in document["paths"].items():
        for method, operation in operations.items():
            parts = {"request": operation.get("requestBody", {}), **operation["responses"]}
            for name, part in parts.items():
                for kind, content in part.get("content", {}).items():
                    yield f"{method.upper()} {path} {name} {kind}", kind, content


def example_of(document, content):
    if "examples" in content:
        (named,) = content["examples"].values()
        name = named["$ref"].removeprefix("#/components/examples/")
        return document["components"]["examples"][name]["value"]
    return content.get("example")


def test_every_request_and_answer_has_an_example(document):
    all_ = list(contents(document))
    lacking = [
        where
        for where, kind, content in all_
        if kind not in WITHOUT and not example_of(document, content)
    ]
    assert lacking == []
    assert len(all_) > 400


def test_each_example_is_of_its_schema(document):
    components = document["components"]
    checked = 0
    for where, kind, content in contents(document):
        example = example_of(document, content)
        if example is None or "schema" not in content:
            continue
        schema = {**content["schema"], "components": components}
        wrong = list(jsonschema_rs.Draft202012Validator(schema).iter_errors(example))
        assert not wrong, (where, wrong[0].message)
        checked += kind == "application/json"
    assert checked > 50


def test_no_example_stays_of_what_is_gone(document):
    used = {
        named["$ref"].rpartition("/")[2]
        for _, _, content in contents(document)
        for named in content.get("examples", {}).values()
    }
    assert used == set(document["components"]["examples"])
