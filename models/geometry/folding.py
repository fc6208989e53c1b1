"""Where a lens' polynomial folds back: beyond it, a picture has nothing of the view."""

import math
from functools import lru_cache

import numpy as np

_NO_DISTORTION = 1e-9  # a coefficient that moves no pixel


@lru_cache(maxsize=1024)
def first_fold(slope: tuple[float, ...]) -> float:
    """The least r above 0 at which a slope, a polynomial in r^2, is 0; infinite if there is none.

    `slope` has the coefficient of the highest power first. Cached, because each projection of
    points needs it.
    """
    roots = np.roots(np.where(np.abs(slope) < _NO_DISTORTION, 0.0, slope))
    real = roots[(np.abs(roots.imag) < 1e-9) & (roots.real > 0)].real
    return float(np.sqrt(real.min())) if real.size else math.inf
