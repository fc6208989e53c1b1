"""So many people's tracks, where a tracker gives some of them several: pieces of a walk are one."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.recalibration import count_walks
from service.store.tables.tracks import TrackRecord
from service.windows.unpacked import Unpacked

MOST_PIECES = 5  # to a walk, on average: more tracks than that are not unpacked for an estimate


@dataclass(frozen=True, slots=True, kw_only=True)
class Gathered:
    """Tracks, and whether there are `enough`: of as many people as were wanted."""

    records: Sequence[TrackRecord]
    enough: bool


def until_so_many(
    load: Callable[[int], Sequence[TrackRecord]],
    wanted: int,
    intrinsics: Intrinsics,
    prior: CameraPose,
    unpacked: Unpacked,
) -> Gathered:
    """The fewest tracks that are of so many people; all that there are where these are too few.

    One track more is never two people more, so that asking for as many more as are missing ends at
    the same tracks whenever it is asked. Five times as many tracks as people do in any case.

    Args:
        load: the first so many tracks, or the newest.
        wanted: people.
        intrinsics: of the camera.
        prior: about where it stands.
        unpacked: what was unpacked already, and will be.
    """
    limit, most = wanted, MOST_PIECES * wanted
    while True:
        records = load(limit)
        if len(records) < limit:
            return Gathered(records=records, enough=False)
        walks = count_walks(
            [unpacked.seen(record, intrinsics) for record in records], intrinsics, prior
        )
        if walks >= wanted or limit == most:
            return Gathered(records=records, enough=True)
        limit = min(limit + wanted - walks, most)
