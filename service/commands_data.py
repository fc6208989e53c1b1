"""Commands on a data directory: migrate, backup, restore, check, rotate-key."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from service.data_dir import be_private
from service.logs import configure_logs
from service.settings import Settings

DataDir = Annotated[Path | None, typer.Option(help="Database and weights live here.")]


def migrate(data_dir: DataDir = None) -> None:
    """Bring the database to the newest revision."""
    from service.migrate import migrate as run_migrations

    settings = _begin(data_dir)
    run_migrations(settings)
    Console().print(f"{settings.database_path} is at the newest revision", soft_wrap=True)


def rotate_key(
    data_dir: DataDir = None,
    old_key_file: Annotated[
        Path | None, typer.Option(help="Of the key until now; secret.key of the data directory.")
    ] = None,
) -> None:
    """Seal the stored secrets with a new key file, or with SUREFOOT_SECRET_KEY if that is set."""
    from service.recalibration.key_rotation import rotate_key as rotate

    count = rotate(_begin(data_dir), old_key_file)
    Console().print(f"{count} secrets are sealed by the new key; backups hold the old one")


def _begin(data_dir: Path | None) -> Settings:
    configure_logs()
    be_private()
    return Settings() if data_dir is None else Settings(data_dir=data_dir)


DATA_COMMANDS = (migrate, rotate_key)
