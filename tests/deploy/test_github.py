"""Workflows and templates of GitHub are valid, and call the scripts of `.ci/`."""

import re

import pytest
import yaml

from tests.conftest import ROOT

GITHUB = ROOT / ".github"
WORKFLOWS = sorted((GITHUB / "workflows").glob("*.yml"))
FORMS = sorted(path for path in (GITHUB / "ISSUE_TEMPLATE").glob("*.yml") if path.stem != "config")


def test_gate_docs_and_release_have_a_workflow():
    assert [path.stem for path in WORKFLOWS] == ["docs", "gate", "release"]


@pytest.mark.parametrize("path", WORKFLOWS, ids=lambda path: path.stem)
def test_workflow_has_minimal_rights_and_calls_scripts_that_exist(path):
    workflow = yaml.safe_load(path.read_text())
    assert workflow["name"] == path.stem
    assert workflow[True]  # YAML 1.1 reads the key `on` as a boolean
    assert workflow["permissions"] == {"contents": "read"}
    for job in workflow["jobs"].values():
        assert job["runs-on"] == "ubuntu-24.04"
        assert job["timeout-minutes"] <= 90
        for step in job["steps"]:
            assert ("uses" in step) != ("run" in step)
            if "uses" in step:
                assert re.fullmatch(r"actions/[a-z-]+@v\d+", step["uses"])
    scripts = re.findall(r"run: (\.ci/[a-z]+)", path.read_text())
    assert scripts
    for script in scripts:
        assert (ROOT / script).exists()


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_issue_form_has_a_name_and_fields_with_unique_ids(path):
    form = yaml.safe_load(path.read_text())
    assert form["name"]
    assert form["description"]
    fields = [field for field in form["body"] if field["type"] != "markdown"]
    assert fields
    assert len({field["id"] for field in fields}) == len(fields)
    for field in fields:
        assert field["type"] in {"textarea", "input", "dropdown"}
        assert field["attributes"]["label"]


def test_pull_request_template_names_the_gate():
    assert "`.ci/run`" in (GITHUB / "pull_request_template.md").read_text()
