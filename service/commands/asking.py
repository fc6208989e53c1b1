"""What the commands that ask a running service share: where it is, a token, answers, ends."""

import contextlib
import getpass
import json
import os
from collections.abc import Iterator, Sequence
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

if TYPE_CHECKING:
    from surefoot.bridge.service import Service

LOCAL_URL = "http://127.0.0.1:8080"
Url = Annotated[str, typer.Option(envvar="SUREFOOT_URL", help="The running service.")]
# No flag takes the token itself: every user of a machine sees the words of its commands.
TokenFile = Annotated[
    Path | None,
    typer.Option(
        envvar="SUREFOOT_TOKEN_FILE",
        help="A file with the token; without one, the variable SUREFOOT_TOKEN has it.",
    ),
]
Json = Annotated[bool, typer.Option("--json", help="JSON objects, one a line, for programs.")]


class End(IntEnum):
    """Exit statuses of these commands; a wrong flag is `UNKNOWN`, too."""

    FINE = 0
    FIRES = 1  # an alert that is told of fires, or the service is not ready
    UNKNOWN = 2  # nobody answered, or the service refused


@contextlib.contextmanager
def asked(url: str, token_file: Path | None) -> Iterator["Service"]:
    """A client of a service; what cannot be asked is told in a line, and is the command's end."""
    import httpx

    from surefoot.bridge.service import LaterError, RefusedError, Service

    try:
        yield Service(url, _token(token_file))
    except (LaterError, RefusedError, httpx.InvalidURL) as error:
        give_up(f"{url}: {error}")


def give_up(why: str) -> NoReturn:
    """End a command with what keeps it from its answer.

    Raises:
        typer.Exit: always.
    """
    typer.echo(f"surefoot: {plain(why)}", err=True)
    raise typer.Exit(End.UNKNOWN)


def tell(document: Any) -> None:
    """Print a line of JSON; as ASCII, so that nothing in it is an order to a terminal."""
    typer.echo(json.dumps(document))


def table(rows: Sequence[Sequence[object]]) -> None:
    """Print rows whose columns stand below one another, the first of them as headings."""
    cells = [[plain(str(cell)) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for row in cells:
        line = "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True))
        typer.echo(line.rstrip())


def plain(text: str) -> str:
    """The text without what a terminal would obey: names and reasons are other people's words."""
    return "".join(each if each.isprintable() else "\N{REPLACEMENT CHARACTER}" for each in text)


def account() -> str | None:
    """The name of the account that runs a command; containers may have one without."""
    try:
        return getpass.getuser()
    except (KeyError, OSError):
        return None


def _token(file: Path | None) -> str | None:
    if file is None:
        return os.environ.get("SUREFOOT_TOKEN") or None
    try:
        text = file.read_text(encoding="ascii").strip()
    except (OSError, ValueError) as error:
        give_up(f"--token-file: {file} cannot be read ({error})")
    if not text or len(text.split()) > 1:
        give_up(f"--token-file: one token is needed, {file} has {len(text.split())} words")
    return text
