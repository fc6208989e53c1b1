"""Dataclasses of arrays whose rows belong together."""

from dataclasses import fields, replace
from typing import Any, TypeVar

import numpy as np

from models.geometry.rotation import Index, Mask

_Value = TypeVar("_Value", bound=Any)


def rows_of(value: _Value, chosen: Index | Mask, **others: Any) -> _Value:
    """Some rows of each array of a value; what is no array stays, unless others are given."""
    arrays = {
        field.name: part[chosen]
        for field in fields(value)
        if field.name not in others and isinstance(part := getattr(value, field.name), np.ndarray)
    }
    kept: _Value = replace(value, **arrays, **others)
    return kept
