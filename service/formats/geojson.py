"""A camera and the ground that it sees, as GeoJSON (RFC 7946)."""

import json
import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from models.geometry.footprint import REACH, view_outline
from models.geometry.ground import ground_share
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import Array
from service.degrees import in_degrees
from service.errors import MalformedError

_EQUATOR_M, _ECCENTRICITY_2 = 6_378_137.0, 6.69437999014e-3  # WGS 84
_FARTHEST_M = 10_000.0  # from the origin: there the flat world is off by about 10 m


@dataclass(frozen=True, slots=True, kw_only=True)
class GeoOrigin:
    """Where x = y = 0 of a world is on the earth (WGS 84, degrees); its +Y is north there."""

    lat_deg: float
    lon_deg: float

    def lon_lat(self, ground_m: Array) -> Array:
        """Longitudes and latitudes (N, 2) in degrees of points x, y (N, 2) in metres.

        By the ellipsoid's two radii of curvature at the origin.

        Raises:
            MalformedError: a point is farther from the origin than a flat world holds.
        """
        farthest = float(np.linalg.norm(ground_m, axis=1).max())
        if farthest > _FARTHEST_M:
            raise MalformedError.of_field(
                "origin_lat_deg",
                f"the camera and its view within {_FARTHEST_M:.0f} m of x = y = 0 are needed, "
                f"got {farthest:.0f} m",
            )
        lat = math.radians(self.lat_deg)
        bulge = 1 - _ECCENTRICITY_2 * math.sin(lat) ** 2
        across = _EQUATOR_M / math.sqrt(bulge) * math.cos(lat)
        along = _EQUATOR_M * (1 - _ECCENTRICITY_2) / bulge**1.5
        turned = np.degrees(ground_m / (across, along))
        return np.asarray(turned + (self.lon_deg, self.lat_deg))


def geojson(
    intrinsics: Intrinsics, pose: CameraPose, *, camera_id: str, origin: GeoOrigin | None
) -> str:
    """A point with the pose and, where any ground is in the picture, a polygon of it.

    The polygon ends at `REACH` camera heights from the camera's foot. Without an origin the
    coordinates are metres in the world and `crs` is null, GeoJSON's word (2008) for a system that
    no map knows.

    Raises:
        MalformedError: as of `GeoOrigin.lon_lat`.
    """
    reach_m = REACH * pose.height_m
    features = [_feature("Point", _coordinates(pose.centre_m[None, :2], origin)[0])]
    features[0]["id"] = camera_id
    features[0]["properties"] = in_degrees(asdict(pose))
    ring = view_outline(intrinsics, pose, reach_m)
    if len(ring) and ground_share(intrinsics, pose) > 0:
        ring = _anticlockwise(ring)
        ring = np.concatenate([ring, ring[:1]])
        features.append(_feature("Polygon", [_coordinates(ring, origin)]))
        features[1]["id"] = f"{camera_id}/footprint"
        features[1]["properties"] = {"reach_m": reach_m}
    local = {} if origin is not None else {"crs": None, "unit": "metre"}
    return json.dumps({"type": "FeatureCollection", **local, "features": features})


def _feature(kind: str, coordinates: Any) -> dict[str, Any]:
    return {"type": "Feature", "geometry": {"type": kind, "coordinates": coordinates}}


def _coordinates(ground_m: Array, origin: GeoOrigin | None) -> list[list[float]]:
    points: list[list[float]] = (ground_m if origin is None else origin.lon_lat(ground_m)).tolist()
    return points


def _anticlockwise(ring: Array) -> Array:
    x, y = ring.T
    area = float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
    return ring if area > 0 else ring[::-1]
