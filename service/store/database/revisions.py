"""The schema's revisions that this release knows."""

from importlib.resources import files

import alembic.config
from alembic.script import ScriptDirectory

from service.data_dir import StartError


def alembic_config(url: str) -> alembic.config.Config:
    """Alembic's configuration for the migrations that ship with the package."""
    config = alembic.config.Config()
    config.set_main_option("script_location", str(files("migrations")))
    config.attributes["url"] = url
    return config


def known_revisions() -> list[str]:
    """All revisions, the newest first."""
    return [script.revision for script in scripts().walk_revisions()]


def scripts() -> ScriptDirectory:
    """The migrations themselves."""
    return ScriptDirectory.from_config(alembic_config(""))


def require_known(found: str | None, what: str) -> None:
    """Check that this release knows a schema's revision.

    Raises:
        StartError: it does not: a newer release wrote it.
    """
    known = known_revisions()
    if found is not None and found not in known:
        raise StartError(
            f"schema: {what} is of revision {found}, newer than this release, which knows up to "
            f"{known[0]}; install the release that wrote it, or restore an older backup"
        )
