"""`PUT /bridges/{bridge}`: the heartbeat of `surefoot bridge`."""

from typing import Annotated

from fastapi import APIRouter, Path
from pydantic import Field, StringConstraints

from service.api.middleware.dependencies import CallerDep, WritesDep
from service.api.schemas import Body, CameraId, Moment, Text
from service.operations import bridges
from service.operations.bridges import Beat

BridgeName = Annotated[str, Path(pattern=r"^[A-Za-z0-9._-]{1,63}$")]
_Count = Annotated[int, Field(ge=0, le=2**53)]
_CountName = Annotated[str, StringConstraints(pattern=r"^[a-z_]{1,40}$")]


def _text(most: int) -> type[str]:
    return Annotated[Text, Field(max_length=most)]  # type: ignore[return-value]


class RejectionBody(Body):
    """Why a message, or rows of one, were rejected; `extract` is its beginning."""

    at: Moment
    event: _text(40)  # type: ignore[valid-type]
    topic: _text(200)  # type: ignore[valid-type]
    code: _text(40)  # type: ignore[valid-type]
    detail: _text(500)  # type: ignore[valid-type]
    extract: _text(600)  # type: ignore[valid-type]


class BridgeBody(Body):
    """What a bridge has done since it started.

    `connected` is to its broker; `waiting` tracks are not posted yet. `cameras` are those that it
    has posted for, `unknown_cameras` counts messages for cameras that the service does not have.
    """

    started_at: Moment
    connected: bool
    stopped: bool = False
    waiting: _Count = 0
    spools_moved_aside: _Count = 0
    counts: Annotated[dict[_CountName, _Count], Field(max_length=50)] = {}
    unknown_cameras: Annotated[dict[CameraId, _Count], Field(max_length=100)] = {}
    cameras: Annotated[list[CameraId], Field(max_length=1000)] = []
    newest_rejections: Annotated[list[RejectionBody], Field(max_length=20)] = []


router = APIRouter(prefix="/bridges", tags=["operation"])


@router.put("/{bridge}", status_code=204)
def report_bridge(
    bridge: BridgeName, body: BridgeBody, write: WritesDep, caller: CallerDep
) -> None:
    """Report the state and the counts of a bridge.

    A bridge does so every 10 s.
    """
    found = body.model_dump(mode="json", exclude={"started_at", "stopped"})
    if caller is not None:
        found["cameras"] = [each for each in body.cameras if caller.may_post(each)]
    beat = Beat(started_at=body.started_at, stopped=body.stopped, report=found)
    with write(bridges.ABOUT) as session:
        bridges.note_heartbeat(session, bridge, beat, caller)
