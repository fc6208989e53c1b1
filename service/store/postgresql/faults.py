"""What a PostgreSQL server's refusals mean to an operator."""

import contextlib
from collections.abc import Iterator

from sqlalchemy import make_url
from sqlalchemy.exc import DBAPIError, OperationalError

from service.data_dir import StartError

# The first of these that a SQLSTATE begins with.
_MEANINGS = {
    "28": ("does not let us in", "check user and password in SUREFOOT_DATABASE_URL"),
    "3D": ("is not there", "make it: createdb -E UTF8 NAME"),
    "42501": ("may not be changed by this user", "let it own the database"),
    "25006": ("is read-only", "name the primary in SUREFOOT_DATABASE_URL"),
    "53": ("has no room or no connection left", "see to the server and start again"),
    "57P": ("is starting or stopping", "start again when it runs"),
}


@contextlib.contextmanager
def telling_of_server(url: str) -> Iterator[None]:
    """Turn what a server refuses into one line about the database, without its password.

    Raises:
        StartError: it cannot be reached, or lets us do nothing.
    """
    name = make_url(url).render_as_string(hide_password=True).replace("+psycopg", "")
    try:
        yield
    except DBAPIError as error:
        state = getattr(error.orig, "sqlstate", None) or ""
        said = " ".join(str(error.orig).split())[:300]
        for begins, (meaning, advice) in _MEANINGS.items():
            if state.startswith(begins):
                raise StartError(f"database: {name} {meaning} ({said}); {advice}") from error
        if isinstance(error, OperationalError) and (not state or state.startswith("08")):
            raise StartError(
                f"database: {name} cannot be reached ({said}); see to the server and start again"
            ) from error
        raise
