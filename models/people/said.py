"""What is to be told of who the tracks are: that many are pieces, or of nobody who walks."""

from models.people.kinds import Kind
from models.people.people import People
from models.reasons import Reason, TracksCode

_PIECES = 0.1  # of the tracks
_NO_WALKERS = 0.1  # of those that move


def reason_of_people(people: People) -> Reason | None:
    """How many of the tracks are of walkers; None where almost all are, each of another one."""
    counts = {kind: people.count(kind) for kind in Kind}
    tracks = people.walk_idx.size
    strange = counts[Kind.WHEELS] + counts[Kind.OTHER]
    moving = strange + counts[Kind.WALKER]
    if people.linked < _PIECES * tracks and strange < _NO_WALKERS * moving or not tracks:
        return None
    values = {f"{kind}": float(count) for kind, count in counts.items()}
    return Reason(
        code=TracksCode.NOT_ALL_WALKERS,
        values={**values, "tracks": float(tracks), "linked": float(people.linked)},
    )
