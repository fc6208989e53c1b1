"""Where a test's store is: a file in its data directory, or a database of a server for the run."""

import os
import secrets
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from service.commands.migrate import migrate
from service.data_dir import DATABASE
from service.settings import Settings
from service.store.engines.store import engine_for
from tests.stores import server as servers
from tests.stores.server import SERVER, Server

_TEMPLATE = "surefoot_migrated"
_running: list[Server] = []


def begin_run() -> None:
    """Start the run's server where the switch says so; its processes know it by a variable."""
    if servers.wanted() and SERVER not in os.environ:
        _running.append(Server())
        _running[0].start()
        os.environ[SERVER] = _running[0].url()


def end_run() -> None:
    """Throw the server away, in the process that has started it."""
    if _running:
        _running.pop().remove()
        del os.environ[SERVER]


def server() -> str | None:
    """The URL of the run's server; None where stores are files."""
    return os.environ.get(SERVER)


def make_template(folder: Path) -> None:
    """A data directory that was just migrated, and a database if there is a server."""
    migrate(Settings(data_dir=folder / "data"))
    if (url := server()) is not None:
        made = servers.make(url, _TEMPLATE)
        migrate(Settings(data_dir=folder / "data", database_url=made))


@contextmanager
def fresh(folder: Path, **values: Any) -> Iterator[Settings]:
    """Settings of a migrated store of its own, for a script: a file, or a server by the switch."""
    begin_run()
    try:
        url = server()
        made = None if url is None else servers.make(url, "surefoot")
        settings = Settings(data_dir=folder / "data", database_url=made, **values)
        migrate(settings)
        yield settings
    finally:
        end_run()


@contextmanager
def settled(template: Path, folder: Path, **values: Any) -> Iterator[Settings]:
    """Settings of a data directory like another one, with a database of its own."""
    shutil.copytree(template, folder)
    url = server()
    if url is None:
        yield Settings(data_dir=folder, **values)
        return
    (folder / DATABASE).unlink()
    name = f"test_{secrets.token_hex(8)}"
    made = servers.make(url, name, _TEMPLATE)
    try:
        yield Settings(data_dir=folder, database_url=made, **values)
    finally:
        servers.drop(url, name)


def copy_store(source: Settings, target: Settings) -> None:
    """Make a data directory and its database anew, as another one's are."""
    shutil.rmtree(target.data_dir, ignore_errors=True)
    shutil.copytree(source.data_dir, target.data_dir)
    if source.database_url is not None and target.database_url is not None:
        url = server()
        assert url is not None
        servers.make(url, _name(target.database_url), _name(source.database_url))


def named_like(settings: Settings, name: str) -> str | None:
    """The URL of another database of a test's server; None where stores are files."""
    url = server()
    if settings.database_url is None or url is None:
        return None
    return servers.named(url, name)


def ask(settings: Settings, statement: str) -> list[tuple[Any, ...]]:
    """What a statement gives, on whichever database; it is committed."""
    engine = engine_for(settings.store_url)
    with engine.begin() as connection:
        result = connection.exec_driver_sql(statement)
        rows = [tuple(row) for row in result] if result.returns_rows else []
    engine.dispose()
    return rows


def only_sqlite(why: str) -> pytest.MarkDecorator:
    """Marks a test of what is there on SQLite alone."""
    return pytest.mark.skipif(servers.wanted(), reason=f"SQLite only: {why}")


def _name(url: str) -> str:
    return url.partition("://")[2].partition("/")[2].partition("?")[0]
