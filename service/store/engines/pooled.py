"""Engines of both databases, and what they have in common."""

import json
import logging
from typing import Any

import msgspec
from sqlalchemy import Engine, create_engine

_log = logging.getLogger(__name__)


def pooled_engine(url: str, patience_s: float, connections: int, **own: Any) -> Engine:
    """An engine with so many connections at most, for each of which is waited so long.

    All are kept once they were needed: to open one takes some statements, and to close one more.
    The one that was given back last goes out first, so that few have pages in their caches. JSON is
    read by msgspec: pages of thousands of cameras take a twentieth less CPU.
    """
    return create_engine(
        url,
        json_serializer=_as_json,
        json_deserializer=msgspec.json.decode,
        pool_size=connections,
        max_overflow=0,
        pool_timeout=patience_s,
        pool_use_lifo=True,
        **own,
    )


def _as_json(value: Any) -> str:
    """JSON of a value, null for what is not finite: PostgreSQL takes no such number, nor msgspec.

    One such number must not keep an alert from being opened, or from being read.
    """
    try:
        return json.dumps(value, allow_nan=False)
    except ValueError:
        _log.warning("a number that is not finite is stored as null")
        return json.dumps(json.loads(json.dumps(value), parse_constant=lambda _: None))
