"""`surefoot token`: make, list and revoke tokens where the data directory is."""

import contextlib
import re
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from service.commands.asking import account
from service.commands.data import DataDir
from service.commands.settings_given import settings_given
from service.data_dir import StartError
from service.errors import ServiceError
from service.workers.processes.process import be_private

if TYPE_CHECKING:
    from service.store.access import TokenRecord
    from service.store.engines.store import Store

app = typer.Typer(help="Tokens, by which programs and people are let in.", no_args_is_help=True)

_UNITS = {"h": 1 / 24, "d": 1.0, "w": 7.0, "y": 365.0}


@app.command()
def add(
    name: Annotated[str, typer.Argument(help="The person or program that it is for.")],
    scope: Annotated[
        list[str], typer.Option(help="read, operate, admin or ingest; may be given repeatedly.")
    ],
    camera: Annotated[
        list[str] | None, typer.Option(help="With ingest: a camera to post for; repeatedly.")
    ] = None,
    source: Annotated[
        list[str] | None, typer.Option(help="With ingest: a name to post under; repeatedly.")
    ] = None,
    expires: Annotated[
        str | None, typer.Option(help="How long it holds: 12h, 90d, 8w, 1y; for ever if left out.")
    ] = None,
    data_dir: DataDir = None,
) -> None:
    """Make a token and print it, once; the database is made if there is none."""
    from service.access import tokens

    spec = tokens.TokenSpec(
        name=name,
        scopes=tuple(scope),
        cameras=tuple(camera) if camera else None,
        sources=tuple(source) if source else None,
        expires_at=None if expires is None else _time_after(expires),
    )
    with _store(data_dir) as store, store.write() as session:
        made = tokens.make_token(session, spec, _who())
    typer.echo(made.text)


@app.command(name="list")
def list_all(data_dir: DataDir = None) -> None:
    """List the tokens, without their secrets."""
    from service.store import access

    table = Table("id", "name", "may", "cameras", "sources", "made", "last used", "ends")
    with _store(data_dir) as store, store.read() as session:
        for record in access.every(session):
            table.add_row(
                record.id,
                escape(record.name),
                ", ".join(record.scopes),
                "all" if record.cameras is None else escape(", ".join(record.cameras)),
                "all" if record.sources is None else escape(", ".join(record.sources)),
                _time(record.created_at),
                _time(record.used_at),
                _end(record),
            )
    Console().print(table)


@app.command()
def revoke(
    token_id: Annotated[str, typer.Argument(help="As `surefoot token list` shows it.")],
    data_dir: DataDir = None,
) -> None:
    """Let a token in no more; a service that runs knows it with the next request."""
    from service.access import tokens

    with _store(data_dir) as store, store.write() as session:
        name = tokens.revoke_token(session, token_id, _who()).name
    typer.echo(f"revoked the token {token_id} of {name}")


@contextlib.contextmanager
def _store(data_dir: Path | None) -> Iterator["Store"]:
    """A migrated store; what it refuses is told in a line."""
    from service.commands.migrate import migrate
    from service.store.engines.store import Store

    be_private()
    settings = settings_given(data_dir=data_dir)
    migrate(settings)
    with contextlib.closing(Store(settings)) as store:
        try:
            yield store
        except ServiceError as error:
            raise StartError(error.detail) from error


def _who() -> str:
    """The account that runs the command, as the log of activity names it."""
    name = account()
    return "command line" if name is None else f"{name} (command line)"


def _time_after(text: str) -> datetime:
    match = re.fullmatch(r"(\d{1,5})([hdwy])", text.strip())
    if match is None or int(match[1]) == 0:
        raise StartError(f"expires: a time such as 90d is needed, got {text!r}")
    days = int(match[1]) * _UNITS[match[2]]
    try:
        return datetime.now(UTC) + timedelta(days=days)
    except OverflowError as error:
        raise StartError(f"expires: {text!r} is too far away") from error


def _time(at: datetime | None) -> str:
    return "never" if at is None else f"{at:%Y-%m-%d %H:%M}Z"


def _end(record: "TokenRecord") -> str:
    return f"revoked {_time(record.revoked_at)}" if record.revoked_at else _time(record.expires_at)
