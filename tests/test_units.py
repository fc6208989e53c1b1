"""Radians inside; degrees where people read, and nowhere else: read from the code."""

import ast

from tests.conftest import ROOT

# Who may turn radians into degrees by themselves.
EDGES = (
    "service/api/",
    "service/commands/demo",  # a terminal
    "service/degrees.py",
    "service/formats/",  # of others, who read degrees
    "service/pages/",
    "service/wording/",
)
# Who tells people otherwise than by schemas and pages: by requests, events and webhooks. They take
# the words of `service/degrees.py`.
TELLING = {
    "service/commands/replay.py",
    "service/estimation/estimates.py",
    "service/notifications/outbox.py",
    "service/reasons.py",
    "service/reports/weekly.py",
}


def sources():
    for path in sorted((ROOT / "service").rglob("*.py")):
        place = str(path.relative_to(ROOT))
        if not place.startswith(EDGES):
            yield place, ast.parse(path.read_text())


def names(tree):
    """All that a module names, of its own or of others."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            yield node.attr
        elif isinstance(node, ast.alias):
            yield node.name.split(".")[-1]


def test_degrees_are_made_at_the_edges_alone():
    makers = {"rad2deg", "degrees"}
    assert {place for place, tree in sources() if makers & set(names(tree))} <= TELLING
    for place, tree in sources():
        calls = {ast.unparse(n.func) for n in ast.walk(tree) if isinstance(n, ast.Call)}
        assert not {"math.degrees", "np.degrees", "np.rad2deg"} & calls, place


def test_who_tells_people_is_listed():
    told = {
        place
        for place, tree in sources()
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and node.module == "service.degrees"
    }
    assert told == TELLING


def test_what_is_stored_has_no_degrees():
    for path in sorted((ROOT / "service" / "store").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                assert not node.value.endswith("_deg"), f"{path.name}: {node.value}"
            if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
                assert not node.target.id.endswith("_deg"), f"{path.name}: {node.target.id}"
