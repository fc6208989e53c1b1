"""Bring a data directory's database to the newest revision."""

import fcntl
from importlib.resources import files

import alembic.command
import alembic.config

from service.job_queue import migrate_engine_tables
from service.settings import Settings


def migrate(settings: Settings) -> None:
    """Create or upgrade the application's and the job engine's tables; one process at a time."""
    settings.data_dir.mkdir(parents=True, exist_ok=True)
    with (settings.data_dir / "migrate.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        alembic.command.upgrade(alembic_config(settings.database_url), "head")
        migrate_engine_tables(settings)


def alembic_config(url: str) -> alembic.config.Config:
    """Alembic's configuration for the migrations that ship with the package."""
    config = alembic.config.Config()
    config.set_main_option("script_location", str(files("migrations")))
    config.attributes["url"] = url
    return config
