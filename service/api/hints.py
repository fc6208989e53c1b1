"""`/cameras/{id}/hints`: what a person marks in the picture of a camera without a prior pose."""

from typing import Annotated, Any, Self

from fastapi import APIRouter, Body
from pydantic import BaseModel, Field, model_validator

from models.geometry.hints import HintKind
from service.api.ignored import NamingRoute
from service.api.middleware.dependencies import ReadDep, WriteDep
from service.api.poses import ProposedOut
from service.api.schemas import Body as RequestBody
from service.api.schemas import Finite
from service.cameras import hints
from service.cameras.hints import HintsView

_MOST = 50
_POINTS = {HintKind.MAP_POINT: 1}
_Pixel = Annotated[Finite, Field(ge=-1e6, le=1e6)]
_Metres = Annotated[Finite, Field(ge=-1e6, le=1e6)]


class HintBody(RequestBody):
    """A mark in pixels.

    Two points of the horizon; foot and top of a vertical, which may have a `length_m`; both ends of
    a `length_m` on the ground; a point whose `x_m`, `y_m` a map tells, each to `sd_m` (0.1).
    """

    kind: HintKind
    points: list[Annotated[list[_Pixel], Field(min_length=2, max_length=2)]] = Field(
        min_length=1, max_length=2
    )
    length_m: Annotated[Finite, Field(gt=0.01, le=1000)] | None = None
    x_m: _Metres | None = None
    y_m: _Metres | None = None
    sd_m: Annotated[Finite, Field(ge=0.01, le=100)] | None = None

    @model_validator(mode="after")
    def _is_whole(self) -> Self:
        needed = _POINTS.get(self.kind, 2)
        if len(self.points) != needed:
            raise ValueError(f"points: {needed} are needed, got {len(self.points)}")
        if needed == len(self.points) == 2 and self.points[0] == self.points[1]:
            raise ValueError("points: both are the same one")
        mapped = self.kind == HintKind.MAP_POINT
        if mapped != (self.x_m is not None) or mapped != (self.y_m is not None):
            raise ValueError("x_m, y_m: a map point needs both, nothing else takes them")
        if self.sd_m is not None and not mapped:
            raise ValueError("sd_m: a map point alone takes one")
        if self.kind == HintKind.LENGTH and self.length_m is None:
            raise ValueError("length_m: is needed")
        if self.length_m is not None and self.kind in (HintKind.HORIZON, HintKind.MAP_POINT):
            raise ValueError("length_m: a vertical or a length alone takes one")
        return self

    def kept(self) -> dict[str, Any]:
        """The mark as it is stored."""
        place = {} if self.x_m is None else {"place_m": [self.x_m, self.y_m]}
        sure = {} if self.sd_m is None else {"place_sd_m": self.sd_m}
        length = {} if self.length_m is None else {"length_m": self.length_m}
        return {"kind": self.kind, "points": self.points, **length, **place, **sure}


class HintOut(BaseModel):
    """A mark, and how far it is off, in its own standard deviations: much more than 2 lies."""

    kind: HintKind
    points: list[list[float]]
    length_m: float | None
    x_m: float | None
    y_m: float | None
    sd_m: float | None
    residual_sd: float | None


class HintsOut(BaseModel):
    """All marks of a camera, and the pose that they and its people make."""

    items: list[HintOut]
    proposed: ProposedOut | None

    @classmethod
    def from_value(cls, view: HintsView) -> Self:
        """The body of marks."""
        proposal = view.proposed
        off = None if proposal is None else proposal.residual_sd
        items = []
        for number, kept in enumerate(view.kept):
            x_m, y_m = kept.get("place_m", (None, None))
            items.append(
                HintOut(
                    kind=kept["kind"], points=kept["points"], length_m=kept.get("length_m"),
                    x_m=x_m, y_m=y_m, sd_m=kept.get("place_sd_m"),
                    residual_sd=None if off is None else off[number],
                )
            )  # fmt: skip
        return cls(
            items=items, proposed=None if proposal is None else ProposedOut.from_value(proposal)
        )


router = APIRouter(prefix="/cameras/{camera_id}/hints", tags=["pose"], route_class=NamingRoute)


@router.get("")
def get_hints(camera_id: str, session: ReadDep) -> HintsOut:
    """Get the hints of a camera.

    Each has its residual, and the answer has the pose that is proposed.
    """
    return HintsOut.from_value(hints.view_hints(session, camera_id))


@router.put("")
def put_hints(
    camera_id: str,
    body: Annotated[list[HintBody], Body(max_length=_MOST)],
    session: WriteDep,
) -> HintsOut:
    """Replace the hints of a camera.

    An empty list removes them.
    """
    kept = [each.kept() for each in body]
    return HintsOut.from_value(hints.keep_hints(session, camera_id, kept))
