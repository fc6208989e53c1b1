"""Runs migrations against the URL that the caller gives, or `SUREFOOT_DATA_DIR`'s database."""

from alembic import context
from sqlalchemy import Enum

from service.settings import Settings
from service.store.engines.store import engine_for
from service.store.record import Record, UtcDateTime


def _ours(obj: object, name: str | None, kind: str, reflected: bool, compare_to: object) -> bool:
    # The job engine keeps its tables in the same file; they are not Alembic's to drop.
    return not (kind == "table" and reflected and name not in Record.metadata.tables)


def _render(kind: str, obj: object, autogen: object) -> str | bool:
    # A migration must not change when the application's types do.
    if kind == "type" and isinstance(obj, Enum):
        return "sa.String()"
    return "sa.DateTime()" if kind == "type" and isinstance(obj, UtcDateTime) else False


url = context.config.attributes.get("url") or Settings().store_url
engine = engine_for(url)
on_sqlite = engine.dialect.name == "sqlite"
with engine.connect() as connection:
    if on_sqlite:
        # It changes a table by making it anew: dropping the old one would delete, by cascade, all
        # that refers to it.
        connection.exec_driver_sql("PRAGMA foreign_keys=OFF")
        connection.commit()
    context.configure(
        connection=connection,
        target_metadata=Record.metadata,
        render_as_batch=on_sqlite,
        compare_type=True,
        include_object=_ours,
        render_item=_render,
    )
    with context.begin_transaction():
        context.run_migrations()
        if on_sqlite:
            broken = connection.exec_driver_sql("PRAGMA foreign_key_check").first()
            assert broken is None, broken
engine.dispose()
