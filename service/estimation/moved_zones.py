"""The consequence of a move for zones: what lies where it was drawn, whom a line misses."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass

from models.geometry.crossings import Steps, crossings
from models.geometry.intrinsics import Intrinsics
from models.geometry.outlines import View, moved_outlines
from models.geometry.pose import CameraPose
from models.tracks.trajectory import Trajectory
from service.enums import ZoneOn
from service.store.zones import ZonesRecord


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedZone:
    """A zone of a camera that moved, if nobody mends its drawing.

    `overlap` is the share that still lies where it was drawn, `in_view` the share in the picture.
    Of a line: how many people `crossed` it where it lies now, how many of them it `missed` where it
    was drawn, and its `false_counts` there; None of an area.
    """

    id: str
    on: ZoneOn
    overlap: float
    in_view: float
    crossed: int | None = None
    missed: int | None = None
    false_counts: int | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class MovedZones:
    """The zones of a camera that moved, and the `form` that they came in; None of our own."""

    zones: tuple[MovedZone, ...]
    form: str | None


def moved_zones(
    record: ZonesRecord | None,
    lens: Intrinsics,
    pose: CameraPose,
    tracks: Sequence[Trajectory] = (),
) -> MovedZones | None:
    """The consequence of a pose for zones; None where there are none, or they were drawn at it.

    `tracks` are of people since the camera has this pose.
    """
    now = View(intrinsics=lens, pose=pose)
    if record is None or not record.zones or record.view == now:
        return None
    steps = Steps.of([track.uv for track in tracks])
    found = []
    outlines = record.outlines
    moved = moved_outlines(list(outlines.values()), now, None)
    for (name, outline), placed in zip(outlines.items(), moved, strict=True):
        told = None if outline.closed else crossings(steps, outline.corners, placed.corners)
        found.append(
            MovedZone(
                id=name,
                on=ZoneOn.GROUND if outline.on_ground else ZoneOn.SCENE,
                overlap=placed.overlap,
                in_view=placed.in_view,
                **({} if told is None else asdict(told)),
            )
        )
    return MovedZones(zones=tuple(found), form=record.form)
