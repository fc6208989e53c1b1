"""The schema's revisions that this release knows."""

import re
from importlib.resources import files
from typing import TYPE_CHECKING

from service.data_dir import StartError

if TYPE_CHECKING:
    from alembic.config import Config

MIGRATIONS = files("migrations")

# Of a migration's file, which begins with it: of which revision it makes which.
_MAKES = re.compile(
    r"""^revision = ["'](\w+)["']\ndown_revision = (?:["'](\w+)["']|None)$""", re.MULTILINE
)


def alembic_config(url: str) -> "Config":
    """Alembic's configuration for the migrations that ship with the package."""
    from alembic.config import Config  # 0.1 s, where there is something to migrate

    config = Config()
    config.set_main_option("script_location", str(MIGRATIONS))
    config.attributes["url"] = url
    return config


def known_revisions() -> list[str]:
    """All revisions, the newest first; each start asks, so they are read without Alembic."""
    next_of: dict[str, str] = {}
    for script in MIGRATIONS.joinpath("versions").iterdir():
        if script.name.endswith(".py"):
            made = _MAKES.search(script.read_text())
            assert made is not None, script.name
            next_of[made[2] or ""] = made[1]
    found, last = [], ""
    while last in next_of:
        last = next_of[last]
        found.append(last)
    return found[::-1]


def require_known(found: str | None, what: str) -> None:
    """Check that this release knows a schema's revision.

    Raises:
        StartError: it does not: a newer release wrote it, or none did.
    """
    known = known_revisions()
    if found is None or found in known:
        return
    if found < known[-1]:  # they begin with their dates
        raise StartError(
            f"schema: {what} is of revision {found}, of before the first release, which no "
            "release reads; begin with an empty data directory or database"
        )
    raise StartError(
        f"schema: {what} is of revision {found}, newer than this release, which knows up to "
        f"{known[0]}; install the release that wrote it, or restore an older backup"
    )
