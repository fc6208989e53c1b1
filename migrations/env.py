"""Runs migrations against the URL that the caller gives, or `SUREFOOT_DATA_DIR`'s database."""

from alembic import context

from service.settings import Settings
from service.store.database import engine_for
from service.store.tables import Record, UtcDateTime


def _ours(obj: object, name: str | None, kind: str, reflected: bool, compare_to: object) -> bool:
    # The job engine keeps its tables in the same file; they are not Alembic's to drop.
    return not (kind == "table" and reflected and name not in Record.metadata.tables)


def _render(kind: str, obj: object, autogen: object) -> str | bool:
    # A migration must not change when the application's types do.
    return "sa.DateTime()" if kind == "type" and isinstance(obj, UtcDateTime) else False


url = context.config.attributes.get("url") or Settings().database_url
engine = engine_for(url)
with engine.connect() as connection:
    context.configure(
        connection=connection,
        target_metadata=Record.metadata,
        render_as_batch=True,
        compare_type=True,
        include_object=_ours,
        render_item=_render,
    )
    with context.begin_transaction():
        context.run_migrations()
engine.dispose()
