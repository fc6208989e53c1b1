"""The closed vocabularies: each word stands where it is defined, and the store knows them all."""

import ast
import sqlite3
from enum import StrEnum
from pathlib import Path

import pytest
from sqlalchemy import CheckConstraint, Enum
from sqlalchemy.dialects import sqlite
from sqlalchemy.schema import AddConstraint

from service import enums
from service.store.record import Record
from tests.stores.databases import only_sqlite
from tests.test_architecture import ROOT, sources

VOCABULARIES = [
    each
    for each in vars(enums).values()
    if isinstance(each, type) and issubclass(each, StrEnum) and each is not StrEnum
]
WORDS = {str(word) for words in VOCABULARIES for word in words}
# Names of fields in JSON bodies, too: as a key, or to look one up, such a word is no member of a
# vocabulary. (`"alert"` is a field of a log line, `"drift"` one of an alert's body.)
FIELDS = {
    "accepted", "alert", "drift", "firing", "pending", "pose", "reference", "registered", "rhythm",
    "source", "tracks",
}  # fmt: skip
# Values that are spelled like a word of a vocabulary, and mean something else.
OTHERS = {
    ("operations/check.py", "ok"): "a verdict, defined there",
    ("formats/batch.py", "source"): "the name of a field",
    ("formats/batch.py", "tracks"): "the name of a field",
    ("estimation/estimates.py", "picture"): "the key of an estimator's answer",
    ("estimation/picture_estimates.py", "picture"): "the key of an estimator's answer",
    ("estimation/seen_picture.py", "picture"): "the key of an estimator's answer",
    ("cameras/poses.py", "picture"): "the key of an estimator's answer",
    ("pages/drawings/ground_plan.py", "picture"): "a class of a drawing",
    ("pages/drawings/picture.py", "picture"): "a class of a drawing",
    ("workers/estimate.py", "picture"): "the part of an estimate that failed",
    ("formats/json_body.py", "source"): "the name of a field",
    ("formats/json_body.py", "tracks"): "the name of a field",
    ("job_queue.py", "estimate"): "the engine's name of a queue and of a job",
    ("workers/processes/process.py", "estimate"): "what a worker may be for alone, defined there",
    ("workers/upkeep/reconciliation.py", "stale"): "the name of a log line",
    ("workers/context.py", "upkeep"): "the engine's name of a job",
    ("workers/upkeep/periodic.py", "clock"): "the name of a round",
    ("pages/registration.py", "lens"): "a word for people",
    ("reasons.py", "maintenance"): "the code of a reason, defined there",
    ("alerts/alerts.py", "drift"): "the name of a field",
    ("estimation/growth.py", "registered"): "the key of an estimator's answer",
    ("pages/alerts_page.py", "acknowledged"): "the name of a flag",
    ("api/alerts.py", "accept"): "the name of a header",
    ("api/middleware/authentication.py", "accept"): "the name of a header",
    ("api/middleware/pages.py", "accept"): "the name of a header",
    ("notifications/outbox.py", "acknowledged"): "the name of a flag",
    ("notifications/outbox.py", "drift"): "the name of a field",
    ("notifications/outbox.py", "silenced"): "the name of a flag",
    ("workers/upkeep/retention.py", "tracks"): "the name of a limit, for the log",
    ("api/middleware/connections.py", "full"): "why a connection is refused, for a count",
    ("api/ground.py", "pose"): "a tag of the API's description",
    ("api/maintenance.py", "maintenance"): "a tag of the API's description",
    ("api/aim.py", "pose"): "a tag of the API's description",
    ("api/poses.py", "pose"): "a tag of the API's description",
    ("api/hints.py", "pose"): "a tag of the API's description",
    ("api/sources.py", "tracks"): "a tag of the API's description",
    ("api/tracks.py", "tracks"): "a tag and a field of the API's description",
    ("api/operation.py", "firing"): "part of a metric's name",
    ("api/operation.py", "pending"): "the name of a field",
    ("api/operation.py", "silenced"): "part of a metric's name",
    ("commands/remote.py", "acknowledged"): "the name of a flag",
    ("commands/remote.py", "silenced"): "the name of a flag",
    ("commands/remote.py", "tracks"): "the name of a field",
    ("commands/serve.py", "warning"): "uvicorn's log level",
    ("store/engines/files.py", "ok"): "what SQLite's quick_check answers",
    ("store/record.py", "source"): "the name of a column",
    ("store/tracks.py", "source"): "the name of a column",
    ("store/tracks.py", "tracks"): "the name of a table",
    ("wording/alerts.py", "fixed"): "the text of the outcome",
    ("wording/typed_pose.py", "critical"): "a tone, defined there",
    ("wording/typed_pose.py", "warning"): "a tone, defined there",
}


def found_words(path: Path) -> list[tuple[str, int]]:
    """The words of a vocabulary that stand as strings in a module, with their lines."""
    tree = ast.parse(path.read_text())
    keys = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Dict):
            keys |= {id(key) for key in node.keys}
        elif isinstance(node, ast.Subscript):
            keys.add(id(node.slice))
    return [
        (node.value, node.lineno)
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant)
        and node.value in WORDS
        and not (id(node) in keys and node.value in FIELDS)
    ]


def test_no_word_of_a_vocabulary_stands_outside_its_definition():
    service = ROOT / "service"
    found = {
        (str(path.relative_to(service)), word, line)
        for path in sources("service")
        if path.name != "enums.py"
        for word, line in found_words(path)
    }
    assert not [each for each in found if each[:2] not in OTHERS]
    # What is let through is still there.
    assert {each[:2] for each in found} == set(OTHERS)


def test_a_stray_word_is_found(tmp_path):
    path = tmp_path / "stray.py"
    path.write_text(
        'def f(a):\n    return a == "firing" or {"drift": 1} or {"no_data": a["pose"]}\n'
    )
    assert found_words(path) == [("firing", 2), ("no_data", 2)]


@only_sqlite("reads the file")
def test_every_column_of_a_vocabulary_is_checked_in_the_store(settings):
    with sqlite3.connect(settings.database_path) as connection:
        rows = connection.execute("SELECT name, sql FROM sqlite_master WHERE type = 'table'")
        made = dict(rows.fetchall())
    columns = [
        (table, column)
        for table in Record.metadata.sorted_tables
        for column in table.columns
        if isinstance(column.type, Enum)
    ]
    assert len(columns) >= 17
    for table, column in columns:
        name = f"ck_{table.name}_{column.name}"
        (check,) = [
            each
            for each in table.constraints
            if isinstance(each, CheckConstraint) and each.name == name
        ]
        declared = str(AddConstraint(check).compile(dialect=sqlite.dialect()))
        assert declared.partition(" ADD ")[2] in made[table.name]


@only_sqlite("reads the file")
def test_the_store_refuses_a_word_that_is_none(settings):
    insert = "INSERT INTO events (type, payload, created_at) VALUES (?, '{}', '2026-11-20')"
    with sqlite3.connect(settings.database_path) as connection:
        connection.execute(insert, ("alert",))
        with pytest.raises(sqlite3.IntegrityError, match="ck_events_type"):
            connection.execute(insert, ("gossip",))
