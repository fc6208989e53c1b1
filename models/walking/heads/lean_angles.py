"""Lean angles of people to the side at a candidate tilt and roll, with derivatives.

A foot's ray f and its head's ray h span a plane through the camera, of normal n. An upright pole
lies in a plane with the vertical g, so n' g = 0 there; else n' g is the angle by which what stands
between f and h leans out of that plane, whatever its height and however far away it is.

Source: Hartley and Zisserman 2004, Multiple View Geometry, section 8.6, for the images of verticals
and their vanishing point; that the product is the lean itself is ours.
"""

from dataclasses import dataclass

import numpy as np

from models.geometry.ground import ground_of_rays, rotation_and_turns
from models.geometry.rotation import Array, Mask, aside_of, dot, norm
from models.tracks.observations import HeadFootPairs, Rows

_LEAST_SPAN = 1e-9  # of the product of two rays that are one
_LEAST_WAY = 0.02  # of camera heights: who goes no farther stands


@dataclass(frozen=True, slots=True, kw_only=True)
class LeanAngles:
    """Leans (M,) at one candidate, radians, positive to the right in the picture.

    `jacobian` (M, 2) are derivatives by tilt and roll; `column` (M,) what the leans would be were
    the heads right above the feet in the picture; `sideways` (M,) how much of their way the people
    walk to the right, -1 to 1, 0 for those who stand. `valid` (M,): foot and head span a plane, and
    the foot is below the horizon; what is not is 0. `rows` say whose they are.
    """

    value: Array
    jacobian: Array
    column: Array
    sideways: Array
    valid: Mask
    rows: Rows


def measure_lean_angles(pairs: HeadFootPairs, angles: Array) -> LeanAngles:
    """The leans of people were the camera's tilt and roll (2,) those given."""
    rotation, turns = rotation_and_turns(float(angles[0]), float(angles[1]), 0.0)
    up = rotation[:, 2]
    normals, spanned = _normals(pairs.foot_rays, pairs.head_rays)
    columns, column_spanned = _normals(pairs.foot_rays, pairs.column_rays)
    foot, falls = ground_of_rays(pairs.foot_rays, rotation, beyond=0.0)
    valid = spanned & column_spanned & falls
    turned = np.stack([rotation @ turn[:, 2] for turn in turns], axis=1)
    return LeanAngles(
        value=np.where(valid, -normals @ up, 0.0),
        jacobian=np.where(valid[:, None], -normals @ turned, 0.0),
        column=np.where(valid, -columns @ up, 0.0),
        sideways=np.where(valid, _sideways(pairs, rotation, foot), 0.0),
        valid=valid,
        rows=_rows_of(pairs),
    )


def _rows_of(pairs: HeadFootPairs) -> Rows:
    """Rows in the middles of their tracks, where no trend is, and linked to none."""
    count = len(pairs)
    return Rows(
        owner_idx=pairs.owner_idx, linked=np.zeros(count, dtype=bool), time_s=np.zeros(count),
        when=np.zeros(count), owners=pairs.owners,
    )  # fmt: skip


def _normals(feet: Array, heads: Array) -> tuple[Array, Mask]:
    """Unit normals (M, 3) of the planes through rays, 0 where these are one, and where they are."""
    product = np.cross(feet, heads)
    length = norm(product)
    spanned = length > _LEAST_SPAN
    return product / np.where(spanned, length, np.inf)[:, None], spanned


def _sideways(pairs: HeadFootPairs, rotation: Array, foot: Array) -> Array:
    """The share (M,) of their walk on the ground to the right of the view of their feet."""
    start, start_falls = ground_of_rays(pairs.from_rays, rotation, beyond=0.0)
    end, end_falls = ground_of_rays(pairs.to_rays, rotation, beyond=0.0)
    way = np.where((start_falls & end_falls)[:, None], end - start, 0.0)
    length = norm(way)
    right = -aside_of(foot)
    across = dot(way, right) / np.maximum(length * norm(right), 1e-12)
    return np.asarray(np.where(length > _LEAST_WAY, across, 0.0))
