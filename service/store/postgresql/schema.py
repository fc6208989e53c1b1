"""The first schema of an empty database: the newest one, made at once.

What is older than PostgreSQL's support has only ever been a file of SQLite's: migrations from
before say how such files became what they are, and an empty database has nothing to bring along.
"""

from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy import Connection, text

from service.store.tables.record import Record

_ENTRIES_STAY = """
CREATE FUNCTION activity_unchanged() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN RAISE EXCEPTION 'activity: entries are never changed' USING ERRCODE = 'check_violation'; END
$$;
CREATE TRIGGER activity_unchanged BEFORE UPDATE ON activity
    FOR EACH ROW EXECUTE FUNCTION activity_unchanged();
CREATE FUNCTION activity_kept() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    RAISE EXCEPTION 'activity: entries of the last 30 days are kept'
        USING ERRCODE = 'check_violation';
END
$$;
CREATE TRIGGER activity_kept BEFORE DELETE ON activity
    FOR EACH ROW WHEN (OLD.at > (now() AT TIME ZONE 'UTC') - interval '30 days')
    EXECUTE FUNCTION activity_kept();
"""


def make_schema(connection: Connection, scripts: ScriptDirectory) -> None:
    """Make all tables of an empty database, at the newest revision, in the caller's transaction."""
    Record.metadata.create_all(connection)
    connection.execute(text(_ENTRIES_STAY))
    MigrationContext.configure(connection).stamp(scripts, "head")


def revision(connection: Connection) -> str | None:
    """The schema's revision; None of a database without tables."""
    return MigrationContext.configure(connection).get_current_revision()
