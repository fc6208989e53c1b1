"""Products of vectors row by row. Over an axis of two or three, `sum` takes three times as long."""

import numpy as np

from models.geometry.rotation import Array


def dot(first: Array, second: Array) -> Array:
    """Products (...) of vectors (..., K)."""
    return np.asarray(np.einsum("...k,...k->...", first, second))


def norm(vectors: Array) -> Array:
    """Lengths (...) of vectors (..., K)."""
    return np.asarray(np.sqrt(dot(vectors, vectors)))


def aside_of(directions: Array) -> Array:
    """Vectors (M, 2) a quarter turn to the left of others (M, 2)."""
    return np.column_stack([-directions[:, 1], directions[:, 0]])
