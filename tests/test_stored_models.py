"""What releases before `2026_11_26_stored_models` have learned is read as they stored it.

The files of `golden/stored_models` were written by the code of commit 1d1919f, of
`tracks_of(3, (PRIOR, 60), boxes=True)` (and `boxes=False`), from `tests.models.sites`, with
`learn_speed_reference`, `learn_flow` and `learn_chart`, all with seed 0.
"""

import io
import sqlite3
from pathlib import Path

import alembic.command
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from models.errors import CheckpointError
from models.monitoring.chart_serialization import chart_from_bytes, chart_to_bytes
from models.paths.serialization import flow_from_bytes, flow_to_bytes
from models.serialization import flattened
from models.walking.serialization import reference_from_bytes, reference_to_bytes
from service.commands.migrate import migrate
from service.settings import Settings
from service.store.database.revisions import alembic_config
from tests.test_migrations import put

BEFORE = "2026_11_26_radians_of_alerts"
GOLDEN = Path(__file__).parent / "golden" / "stored_models"
NAMES = ("site", "site_without_boxes", "flow", "chart")
SITE, BARE, FLOW, CHART = (
    (GOLDEN / f"{name}.npz").read_bytes()
    for name in ("site", "site_without_boxes", "flow", "chart")
)
DAMAGED = SITE[:-300]


def archive(data):
    with np.load(io.BytesIO(data), allow_pickle=False) as file:
        return {name: file[name] for name in file.files if name != "format"}


def undoubted(data):
    """A site of earlier releases; its doubt is told by its row alone."""
    found = archive(data)
    assert found.pop("doubt") == ""
    return found


def assert_same(found, expected):
    assert set(found) == set(expected)
    for name, part in expected.items():
        assert_array_equal(found[name], part)
        assert isinstance(found[name], np.ndarray) == (part.ndim > 0)


def as_archived(values):
    """A site's values by the names of earlier releases."""
    inner = {"field": "", "spread": ""}
    return {
        "_".join(inner.get(word, word) for word in name.split(".")).replace("__", "_"): part
        for name, part in values.items()
    }


@pytest.fixture
def settings(tmp_path):
    """A database of before with learned models of two cameras, damaged ones, and none."""
    settings = Settings(data_dir=tmp_path)
    alembic.command.upgrade(alembic_config(settings.store_url), BEFORE)
    stored = {1: (SITE, FLOW, CHART), 2: (BARE, FLOW, None), 3: (DAMAGED, b"", DAMAGED),
              4: (None, None, None)}  # fmt: skip
    with sqlite3.connect(settings.database_path) as connection:
        for n, (site, flow, chart) in stored.items():
            name = f"camera-{n}"
            put(connection, "cameras", id=name, distortion="[0, 0, 0, 0, 0]")
            put(connection, "prior_poses", id=n, camera_id=name)
            put(connection, "site_references", id=n, camera_id=name, prior_pose_id=n, data=site)
            put(connection, "flow_maps", reference_id=n, data=flow, chart=chart)
    return settings


def stored(settings):
    """Site, map and chart by camera."""
    with sqlite3.connect(settings.database_path) as connection:
        rows = connection.execute(
            "SELECT reference_id, r.data, m.data, chart FROM flow_maps AS m "
            "JOIN site_references AS r ON r.id = reference_id"
        )
        return {row[0]: row[1:] for row in rows}


def test_what_was_learned_is_read_to_the_bit(settings):
    migrate(settings)
    found = stored(settings)
    for n, data in ((1, SITE), (2, BARE)):
        site = reference_from_bytes(found[n][0])
        assert_same(as_archived(flattened(site)), undoubted(data))
        assert (site.statures is None) == (data is BARE)
        assert reference_to_bytes(site) == found[n][0]
    flow = flow_from_bytes(found[1][1])
    parts = {
        name: part for name, part in flattened(flow).items() if not name.startswith("coverage.")
    }
    expected = archive(FLOW)
    expected["flow.log_density"] = expected["flow.log_density"] / 64
    expected["flow.unseen"] = expected["flow.unseen"] / 255
    assert_same(parts, expected)
    assert flow_to_bytes(flow) == found[1][1] == found[2][1]
    chart = chart_from_bytes(found[1][2])
    expected = archive(CHART)
    speed_reference = undoubted(expected.pop("paces").tobytes())
    parts = {name: part for name, part in flattened(chart).items() if not name.startswith("paces.")}
    assert_same(parts, expected)
    assert_same(as_archived(flattened(chart.speed_reference)), speed_reference)
    assert chart_to_bytes(chart) == found[1][2]


def test_what_is_damaged_or_not_there_stays_so(settings):
    migrate(settings)
    found = stored(settings)
    assert found[3] == (DAMAGED, b"", DAMAGED)
    assert found[2][2] is None
    assert found[4] == (None, None, None)
    with pytest.raises(CheckpointError, match="site: not readable"):
        reference_from_bytes(found[3][0])


def test_the_release_before_reads_what_it_wrote_after_a_way_back(settings):
    migrate(settings)
    migrated = stored(settings)
    config = alembic_config(settings.store_url)
    alembic.command.downgrade(config, BEFORE)
    back = stored(settings)
    for n, index, data in ((1, 0, SITE), (2, 0, BARE), (1, 1, FLOW), (1, 2, CHART)):
        found, expected = archive(back[n][index]), archive(data)
        with np.load(io.BytesIO(back[n][index])) as file:
            assert int(file["format"]) == 1
        if index == 2:
            nested = archive(found.pop("paces").tobytes())
            for name, part in archive(expected.pop("paces").tobytes()).items():
                assert_array_equal(nested.pop(name), part, strict=True)
            assert not nested
        for name, part in expected.items():
            assert_array_equal(found.pop(name), part, strict=True)
        assert not found
    alembic.command.upgrade(config, "head")
    assert stored(settings) == migrated
