"""Answers that are written where they are made.

Of a body that a plain route returns, FastAPI makes JSON in a second turn in a thread, once it has
been checked against itself.
"""

from pydantic import BaseModel


def written(body: BaseModel, *, exclude_defaults: bool = False) -> bytes:
    """The JSON of a body, as FastAPI writes it."""
    return body.model_dump_json(by_alias=True, exclude_defaults=exclude_defaults).encode()
