"""Commands on a data directory: migrate, backup, restore, check, rotate-key."""

import contextlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape
from typer import echo

from service.commands.settings_given import begin
from service.data_dir import StartError
from service.workers.processes.process import end_like_ctrl_c

if TYPE_CHECKING:
    from service.settings import Settings

DataDir = Annotated[Path | None, typer.Option(help="Database and weights live here.")]


def migrate(data_dir: DataDir = None) -> None:
    """Bring the database to the newest revision."""
    from service.commands.migrate import migrate as run_migrations

    settings = begin(data_dir=data_dir)
    run_migrations(settings)
    what = settings.database_path if settings.database_url is None else "the database"
    echo(f"{what} is at the newest revision")


def backup(
    file: Annotated[Path, typer.Argument(help="The archive to write; it must not exist.")],
    data_dir: DataDir = None,
) -> None:
    """Write database, weights and key to one checked archive, while the service runs."""
    from service.operations.backup import write_backup

    settings = _begin_on_file(data_dir, "backup")
    with _progress() as tell:
        manifest = write_backup(settings, file, tell)
    size = sum(member.size for member in manifest.members)
    echo(f"{file}: {len(manifest.members)} files, {size / 1e6:.1f} MB, schema {manifest.revision}")
    if manifest.key == "environment":
        echo(f"Keep SUREFOOT_SECRET_KEY (id {manifest.key_id}) elsewhere: it is not in there.")
    elif manifest.key == "archive":
        echo("The key of the stored secrets is in there: keep it as safe as the service itself.")
    if manifest.missing_weights:
        echo(f"{len(manifest.missing_weights)} weights were missing: see `surefoot check`.")


def restore(
    file: Annotated[Path, typer.Argument(help="An archive of `surefoot backup`.")],
    data_dir: DataDir = None,
    force: Annotated[bool, typer.Option("--force", help="Move aside what is there.")] = False,
) -> None:
    """Verify an archive and put it into a data directory that nothing uses."""
    from service.operations.restore import restore_backup

    settings = _begin_on_file(data_dir, "restore")
    with _progress() as tell:
        done = restore_backup(settings, file, tell, force=force)
    made = f"made {done.manifest.made_at} by release {done.manifest.release}"
    echo(f"{settings.data_dir} is as in {file}, {made}; the next start migrates it.")
    if done.replaced is not None:
        echo(f"What was there before is in {done.replaced}; delete it when you like.")
    if done.manifest.missing_weights:
        echo(f"{len(done.manifest.missing_weights)} weights are missing: `surefoot check --repair`")


def check(
    data_dir: DataDir = None,
    repair: Annotated[
        bool, typer.Option("--repair", help="Delete models without weights: they are trained anew.")
    ] = False,
) -> None:
    """Look a data directory over; 1 where something is wrong. A service may run meanwhile."""
    from rich.table import Table

    from service.operations.check import Verdict, check_data_dir, repair_weights

    settings = _begin_on_file(data_dir, "check")
    if repair:
        echo(f"{repair_weights(settings)} models deleted, to be trained anew")
    findings = check_data_dir(settings)
    table = Table("looked at", "verdict", "detail", title=escape(str(settings.data_dir)))
    colours = {Verdict.OK: "green", Verdict.NOTE: "yellow", Verdict.FAULT: "red"}
    for one in findings:
        table.add_row(one.what, f"[{colours[one.verdict]}]{one.verdict}[/]", escape(one.detail))
    Console().print(table)
    raise typer.Exit(int(any(one.verdict is Verdict.FAULT for one in findings)))


def rotate_key(
    data_dir: DataDir = None,
    old_key_file: Annotated[
        Path | None, typer.Option(help="Of the key until now; secret.key of the data directory.")
    ] = None,
    lost: Annotated[
        bool,
        typer.Option("--lost", help="It is lost: new webhook secrets, no camera credentials."),
    ] = False,
) -> None:
    """Seal the stored secrets with a new key file, or with SUREFOOT_SECRET_KEY if that is set."""
    from service.commands.key_rotation import rotate_key as rotate

    count = rotate(begin(data_dir=data_dir), old_key_file, lost=lost)
    echo(f"{count} secrets are sealed by the new key; earlier backups hold the old one")


def _begin_on_file(data_dir: Path | None, command: str) -> "Settings":
    """Settings for a command that a server has better ones for."""
    settings = begin(data_dir=data_dir)
    if settings.database_url is not None:
        raise StartError(
            f"{command}: it is for SQLite files, and SUREFOOT_DATABASE_URL names a server; use its "
            "own tools (pg_dump, pg_restore, pg_amcheck), and keep the key of the stored secrets"
        )
    return settings


@contextlib.contextmanager
def _progress() -> Iterator[Callable[[str, int, int], None]]:
    """A bar on stderr; an end by signal removes what was half done."""
    from rich.progress import Progress

    end_like_ctrl_c()
    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("", total=None)
        yield lambda what, done, total: bar.update(
            task, description=what, completed=done, total=total
        )


def migrate_data(
    source: Annotated[str, typer.Option("--from", help="sqlite:///… of a stopped data directory.")],
    target: Annotated[str, typer.Option("--to", help="postgresql://user:password@host/name")],
    data_dir: DataDir = None,
) -> None:
    """Move a site to PostgreSQL, checked by counts and hashes; run again, it goes on."""
    from service.commands.postgresql.moving import move
    from service.setting_values import read_database_url

    path = Path(source.removeprefix("sqlite:///"))
    try:
        url = read_database_url(target)
    except ValueError as error:
        raise StartError(f"--to: {error}") from error
    settings = begin(data_dir=data_dir or path.parent, database_url=url)
    with _progress() as tell:
        moved = move(path, settings, tell)
    echo(f"{sum(moved.rows.values())} rows of {len(moved.rows)} tables are there, hashes agree")
    echo(f"{moved.weights} weights are there; {moved.missing_weights} were missing or damaged")
    echo("Set SUREFOOT_DATABASE_URL to it, and SUREFOOT_SECRET_KEY on all machines but this one.")


DATA_COMMANDS = (migrate, backup, restore, check, rotate_key, migrate_data)
