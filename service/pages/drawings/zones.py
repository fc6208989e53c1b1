"""Zones over the picture: as they were drawn, and where they are once the camera has moved."""

from collections.abc import Sequence
from typing import Literal

import numpy as np
from markupsafe import escape

from models.geometry.intrinsics import Intrinsics
from models.geometry.outlines import within_picture
from models.geometry.rotation import Array

_LABEL = 48  # labels are so often in the picture's width


def zone_parts(
    lens: Intrinsics, zones: Sequence[tuple[str, Array]], kind: Literal["drawn", "now"]
) -> list[str]:
    """SVG of zones by their names and corners (N, 2) in pixels; those that are now have labels."""
    parts = []
    for name, corners in zones:
        closed = len(corners) > 2
        seen = within_picture(corners, lens, closed=closed) if len(corners) else corners
        if len(seen) < 2:
            continue
        points = "L".join(f"{u:.1f} {v:.1f}" for u, v in seen.tolist())
        parts.append(f'<path class="zone {kind}" d="M{points}{"Z" * closed}"/>')
        if kind == "now":
            u, v = np.mean(seen, axis=0)
            parts.append(
                f'<text class="zone-name" x="{u:.0f}" y="{v:.0f}" text-anchor="middle" '
                f'font-size="{lens.width / _LABEL:.0f}">{escape(name)}</text>'
            )
    return parts
