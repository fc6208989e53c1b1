"""`python -m studies paper`: what is there is not run again, and the manifest says by what."""

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from studies.__main__ import app
from studies.pages import markers
from studies.paper.kept import results_of
from studies.paper.parts import PARTS
from tests.conftest import SCENES

ROOT = Path(__file__).parents[3]
KEPT, PAGE = ROOT / "studies" / "kept" / "paper", ROOT / "docs" / "results" / "paper.md"
SCENE = SCENES / "pets2009_s1l2_1_v001"
needs_scenes = pytest.mark.skipif(not SCENE.exists(), reason=f"no recorded scenes in {SCENES}")


def paper(*arguments):
    return CliRunner().invoke(app, ["paper", *map(str, arguments)])


@needs_scenes
@pytest.mark.slow
def test_a_part_goes_on_where_it_was_ended(tmp_path):
    part = "vanishing-points"
    first = paper(SCENE, "--out", tmp_path, "--parts", part, "--seeds", 1, "--processes", 1)
    assert first.exit_code == 0, first.output
    lines = (tmp_path / f"{part}.jsonl").read_text().splitlines()
    assert len(lines) == 1 + 2  # the heading; tops of boxes, and ideal heads with the first seed

    # Killed while it wrote the last one: that one alone is run again.
    (tmp_path / f"{part}.jsonl").write_text("\n".join(lines)[:-30])
    again = paper(SCENE, "--out", tmp_path, "--parts", part, "--seeds", 1, "--processes", 1)
    assert again.exit_code == 0, again.output
    figures = [json.loads(line)["figures"] for line in lines[1:]]
    kept = (tmp_path / f"{part}.jsonl").read_text().splitlines()
    assert kept[:2] == lines[:2]
    assert [json.loads(line)["figures"] for line in kept[1:]] == figures

    told = json.loads((tmp_path / "manifest.json").read_text())
    assert told["parts"][part]["cases"] == 2
    assert told["machine"]["torch"]
    table = (tmp_path / f"{part}.md").read_text()
    assert "ideal heads, 3 % jitter" in table
    assert "tops of boxes" in table

    (tmp_path / f"{part}.md").unlink()
    page = tmp_path / "page.md"
    begin, end = markers(part, "python -m studies paper --write")
    page.write_text(f"{begin}old\n{end}")
    tables = paper(SCENE, "--out", tmp_path, "--parts", part, "--tables", "--write", page)
    assert tables.exit_code == 0, tables.output
    assert (tmp_path / f"{part}.md").read_text() == table  # and the other seeds were not run
    assert page.read_text() == f"{begin}\n{table}\n{end}"
    assert len((tmp_path / f"{part}.jsonl").read_text().splitlines()) == len(lines)

    # What other code made is told and left out.
    first, second = (json.loads(line) for line in kept[1:])
    old = [kept[0], json.dumps(first | {"code": "0" * 12}), json.dumps(second)]
    (tmp_path / f"{part}.jsonl").write_text("\n".join([*old, ""]))
    tables = paper(SCENE, "--out", tmp_path, "--parts", part, "--tables")
    assert "1 results of other code" in tables.output
    table = (tmp_path / f"{part}.md").read_text()
    assert first["case"]["variant"] not in table
    assert second["case"]["variant"] in table


@needs_scenes
@pytest.mark.slow
def test_some_cases_alone_are_run(tmp_path):
    asked = ("--only", "tops of boxes on *")
    only = paper(SCENE, "--out", tmp_path, "--parts", "vanishing-points", *asked)
    assert only.exit_code == 0, only.output
    (line,) = (tmp_path / "vanishing-points.jsonl").read_text().splitlines()[1:]
    assert json.loads(line)["case"]["variant"] == "tops of boxes"


def test_a_part_that_is_none_is_named(tmp_path):
    refused = paper(tmp_path, "--out", tmp_path, "--parts", "tables")
    assert refused.exit_code == 1
    assert "'tables'" in refused.output


@needs_scenes
def test_a_pattern_that_matches_no_case_is_named(tmp_path):
    """Else a night's run ends at once, and says that all is well."""
    asked = ("--only", "paper at 1.0 m/s on *", "--only", "paper at 2.4 m/s on *")
    refused = paper(SCENE, "--out", tmp_path / "out", "--parts", "speed-sweep", *asked)
    assert refused.exit_code == 1
    said = " ".join(refused.output.split())
    assert "no case matches 'paper at 1.0 m/s on *'" in said
    assert "near it: paper at 1" in said
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("name", list(PARTS))
def test_the_page_says_what_is_kept(name):
    """The tables of docs/results/paper.md are those of the results in studies/kept/paper."""
    _, *rows = map(json.loads, (KEPT / f"{name}.jsonl").read_text().splitlines())
    newest = {each.case: each for each in results_of(rows)}
    part = PARTS[name]
    text = f"{part.says}\n\n{part.table(list(newest.values()))}"
    begin, end = markers(name, "python -m studies paper --write")
    assert f"{begin}\n{text}\n{end}" in PAGE.read_text()
