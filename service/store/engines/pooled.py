"""Engines of both databases, and what they have in common."""

from typing import Any

import msgspec
from sqlalchemy import Engine, create_engine


def pooled_engine(url: str, patience_s: float, connections: int, **own: Any) -> Engine:
    """An engine with so many connections at most, for each of which is waited so long.

    All are kept once they were needed: to open one takes some statements, and to close one more.
    The one that was given back last goes out first, so that few have pages in their caches. JSON is
    read by msgspec: pages of thousands of cameras take a twentieth less CPU.
    """
    return create_engine(
        url,
        json_deserializer=msgspec.json.decode,
        pool_size=connections,
        max_overflow=0,
        pool_timeout=patience_s,
        pool_use_lifo=True,
        **own,
    )
