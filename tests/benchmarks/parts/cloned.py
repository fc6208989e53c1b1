"""Hundreds of cameras with their references learned and their windows full, within a minute.

A few at simulated streets learn as any; the others are copies of them in the store.
"""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from sqlalchemy import Column, Table

from models.geometry.pose import CameraPose
from models.tracks.trajectory import Trajectory, by_end
from service.commands.migrate import migrate
from service.settings import Settings
from service.store.engines.files import connected
from service.store.record import Record
from studies.simulation.lanes import SiteConfig, draw_lanes, walk_site
from tests.conftest import CAMERA
from tests.running import RunningService, wait_for
from tests.service.street import LENS, PRIOR

APART_S = 5.0  # from one person at a camera to the next
QUEUED = "SELECT count(*) FROM workflow_status WHERE status IN ('ENQUEUED', 'PENDING')"
_SITES = 4
_REFERENCE, _WINDOW = 200, 400
_POSTED = 700  # of which some are pieces of others' walks

# In the order in which one names rows of another.
_TABLES = (
    "cameras",
    "prior_poses",
    "site_references",
    "flow_maps",
    "anchors",
    "tracks",
    "track_sources",
    "camera_rhythms",
    "estimates",
)
_TRACK_IDS = ("read_track_pk", "newest_track_pk")  # they name tracks without a foreign key


def people(site: int, count: int, pose: CameraPose = PRIOR) -> list[Trajectory]:
    """Walks at one of the simulated streets, from the same lanes for each pose of the camera."""
    rng, config = np.random.default_rng(site), SiteConfig()
    lanes = draw_lanes(LENS, PRIOR, config, rng)
    return by_end(walk_site(LENS, pose, lanes, config, count, rng))


def as_posted(walk: Trajectory, track_id: str, ended_s: float) -> dict[str, Any]:
    """A walk as a track that ended at a time."""
    rows = np.column_stack([walk.time_s - walk.time_s[-1] + ended_s, walk.uv])
    return {"id": track_id, "points": rows.round(3).tolist()}


def seed(settings: Settings, cameras: int) -> list[list[Trajectory]]:
    """Fill a store; returns the people who walk at each street from now on."""
    migrate(settings)
    walks = [people(site, _POSTED) for site in range(_SITES)]
    service = RunningService(settings, forked=False)
    service.start()
    try:
        learn_streets(service, walks)
    finally:
        service.stop()
    ids = [f"copy-{n}" for n in range(cameras - _SITES)]
    clone(settings.database_path, [f"site-{site}" for site in range(_SITES)], ids)
    return walks


def learn_streets(service: RunningService, walks: list[list[Trajectory]]) -> None:
    """A camera at each street, until its window is full and its map has grown by it."""
    first_s = time.time() - APART_S * _POSTED
    for site, some in enumerate(walks):
        body = {**CAMERA, "id": f"site-{site}", "reference_tracks": _REFERENCE}
        service.http.post("/cameras", json=body).raise_for_status()
        tracks = [
            as_posted(walk, str(n), first_s + APART_S * (n + 1)) for n, walk in enumerate(some)
        ]
        for part in (tracks[:_REFERENCE], tracks[_REFERENCE:]):
            path = f"/cameras/site-{site}/tracks"
            service.http.post(path, json={"source": "a", "tracks": part}).raise_for_status()
    wait_for(lambda: all(_is_full(service, site) for site in range(_SITES)), timeout_s=300)
    wait_for(lambda: _is_idle(service.settings), every_s=5)


def _is_full(service: RunningService, site: int) -> bool:
    pose = service.http.get(f"/cameras/site-{site}/pose").json()
    return bool(pose["reference"]["state"] == "ready" and pose["tracks"] >= _WINDOW)


def _is_idle(settings: Settings) -> bool:
    with connected(settings.database_path) as connection:
        return bool(connection.execute(QUEUED).fetchone()[0] == 0)


def camera_at(number: int) -> tuple[str, int]:
    """The id of a camera, and its street."""
    if number < _SITES:
        return f"site-{number}", number
    return f"copy-{number - _SITES}", (number - _SITES + 1) % _SITES


def clone(database: Path, prototypes: Sequence[str], ids: Sequence[str]) -> None:
    """Copy cameras in turn, under other ids, in a store that nobody else uses."""
    with connected(database) as connection:
        largest = [
            connection.execute(f"SELECT coalesce(max(id), 0) FROM {name}").fetchone()[0]
            for name in ("prior_poses", "site_references", "tracks", "estimates")
        ]
        shift = max(largest) + 1
        connection.execute("BEGIN IMMEDIATE")
        for number, camera_id in enumerate(ids, start=1):
            given = {
                "old": prototypes[number % len(prototypes)],
                "new": camera_id,
                "by": number * shift,
            }
            for name in _TABLES:
                connection.execute(_copying(Record.metadata.tables[name]), given)
        connection.execute("COMMIT")


def _copying(table: Table) -> str:
    """The statement that copies the rows of a camera; their numbers are moved out of the way."""
    names = ", ".join(column.name for column in table.columns)
    values = ", ".join(_copied(column) for column in table.columns)
    key = "id" if table.name == "cameras" else "camera_id"
    where = f"{key} = :old"
    if key not in table.columns:
        where = "reference_id IN (SELECT id FROM site_references WHERE camera_id = :old)"
    return f"INSERT INTO {table.name} ({names}) SELECT {values} FROM {table.name} WHERE {where}"


def _copied(column: Column[object]) -> str:
    if column.name == "camera_id" or (column.table.name == "cameras" and column.name == "id"):
        return ":new"
    named = column.primary_key or column.foreign_keys or column.name in _TRACK_IDS
    return f"{column.name} + :by" if named and column.type.python_type is int else column.name
