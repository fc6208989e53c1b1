"""`POST /acts`: one act on many alerts or cameras, each for itself."""

from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from typing import Annotated, Self

from fastapi import APIRouter
from pydantic import BaseModel, Field, model_validator
from sqlalchemy.orm import Session

from service.alerts import alerts, silence
from service.api.ignored import NamingRoute
from service.api.labels import MOST_TAGS, Tags
from service.api.middleware.dependencies import AppState, StateDep, WritesDep
from service.api.schemas import Body, Moment, Text, Who
from service.cameras import cameras, decisions, maintenance, undo
from service.cameras.answers import Decision
from service.cameras.cameras import CameraChange
from service.enums import Act, Answer
from service.errors import ConflictError, ServiceError
from service.store.access import name_in

_NEEDS = {Act.SILENCE: ("until",), Act.RESOLVE: ("outcome",), Act.MAINTENANCE: ("to",)}


class ActsBody(Body):
    """An act, and the ids of alerts or cameras that it is done with, in this order.

    `acknowledged` false gives acknowledged alerts back. `until` and `reason` are of a silence,
    `outcome` of a resolution, `from`, `to` and `reason` of maintenance, `add` and `remove` of tags.
    """

    ids: Annotated[list[Text], Field(min_length=1, max_length=500)]
    act: Act
    by: Who | None = None
    acknowledged: bool = True
    note: str | None = Field(None, max_length=2000)
    reason: str | None = Field(None, max_length=2000)
    until: Moment | None = None
    outcome: Answer | None = None
    from_: Moment | None = Field(None, alias="from")
    to: Moment | None = None
    add: Tags = []
    remove: Tags = []

    @model_validator(mode="after")
    def _complete(self) -> Self:
        for name in _NEEDS.get(self.act, ()):
            if name not in self.model_fields_set or (name != "until" and not getattr(self, name)):
                raise ValueError(f"{name}: is needed to {self.act}")
        if self.act == Act.TAG and not (self.add or self.remove):
            raise ValueError("add: a tag to add or to remove is needed")
        return self


class ActProblem(BaseModel):
    """Why it was not done: as of a problem document."""

    status: int
    code: str
    detail: str


class ActDone(BaseModel):
    """What became of one id; it was done where there is no `problem`."""

    id: str
    problem: ActProblem | None


class UndoOut(BaseModel):
    """The cameras of which the act `undo` takes back what was done, and until when it is taken."""

    ids: list[str]
    until: datetime


class ActsOut(BaseModel):
    """One answer an id, in the order of the ids; `undo` where any of it can be taken back."""

    items: list[ActDone]
    undo: UndoOut | None


router = APIRouter(tags=["alerts"], route_class=NamingRoute)


@router.post("/acts")
def act(body: ActsBody, state: StateDep, write: WritesDep) -> ActsOut:
    """Do one act with many alerts or cameras. Each is a transaction: what one refuses stops none.

    `acknowledge`, `silence` and `resolve` take ids of alerts, all others ids of cameras.
    """
    begun, undoable = datetime.now(UTC), dict[str, datetime]()

    def done(one: str) -> ActDone:
        about = one if body.act in _OF_CAMERAS else None
        try:
            with write(about) as session:
                _DO[body.act](session, state, one, body)
                mine = _undoable(session, one, body.act, begun)
            undoable.update(mine)
        except ServiceError as error:  # of this id alone; the others are still to be done
            said = ActProblem(status=error.status, code=error.code, detail=error.detail)
            return ActDone(id=one, problem=said)
        return ActDone(id=one, problem=None)

    items = [done(one) for one in dict.fromkeys(body.ids)]
    until = min(undoable.values(), default=None)
    return ActsOut(
        items=items, undo=None if until is None else UndoOut(ids=list(undoable), until=until)
    )


def _undoable(session: Session, one: str, act: Act, begun: datetime) -> dict[str, datetime]:
    """Until when what was just said of cameras can be taken back, by their ids."""
    if act not in _ANSWERS:
        return {}
    cameras_of: Sequence[str | None] = [one]
    if act == Act.RESOLVE:
        record = alerts.show_alert(session, one)
        cameras_of = record.camera_ids or [record.camera_id]
    found = {}
    for camera_id in cameras_of:
        entry = None if camera_id is None else undo.last_answer(session, camera_id, begun)
        if camera_id is not None and entry is not None and entry.at >= begun:
            found[camera_id] = entry.at + undo.UNDO_WITHIN
    return found


def _acknowledge(session: Session, state: AppState, one: str, body: ActsBody) -> None:
    by = name_in(session, body.by)
    alerts.acknowledge_alert(session, one, by, acknowledged=body.acknowledged)


def _silence(session: Session, state: AppState, one: str, body: ActsBody) -> None:
    by = name_in(session, body.by)
    silence.silence_alert(session, state.settings, one, body.until, body.reason, by)


def _resolve(session: Session, state: AppState, one: str, body: ActsBody) -> None:
    assert body.outcome is not None
    by = name_in(session, body.by)
    decisions.resolve_alert(session, state.queue, state.settings, one, body.outcome, body.note, by)


def _maintain(session: Session, state: AppState, one: str, body: ActsBody) -> None:
    assert body.to is not None
    maintenance.open_window(
        session,
        state.queue,
        state.settings,
        one,
        from_at=body.from_,
        to_at=body.to,
        reason=body.reason,
        by=name_in(session, body.by),
    )


def _tag(session: Session, state: AppState, one: str, body: ActsBody) -> None:
    record = cameras.require_camera(session, one)
    tags = sorted({*record.tags, *body.add} - {*body.remove})
    if len(tags) > MOST_TAGS:
        raise ConflictError(f"tags: at most {MOST_TAGS} are taken, it would have {len(tags)}")
    if tags != record.tags:
        change, etag = CameraChange(tags=tags), cameras.etag_of(record)
        cameras.change_camera(session, state.queue, state.settings, one, etag, change, body.by)


def _decide(use_case: Callable[..., object]) -> Callable[[Session, AppState, str, ActsBody], None]:
    def decide(session: Session, state: AppState, one: str, body: ActsBody) -> None:
        decision = Decision(camera_id=one, by=name_in(session, body.by), note=body.note)
        use_case(session, state.queue, state.settings, decision)

    return decide


_DO: dict[Act, Callable[[Session, AppState, str, ActsBody], None]] = {
    Act.ACKNOWLEDGE: _acknowledge,
    Act.SILENCE: _silence,
    Act.RESOLVE: _resolve,
    Act.MAINTENANCE: _maintain,
    Act.PUT_BACK: _decide(decisions.put_back),
    Act.ACCEPT: _decide(decisions.accept_pose),
    Act.RESET: _decide(decisions.learn_anew),
    Act.UNDO: _decide(undo.undo_answer),
    Act.TAG: _tag,
}
_ANSWERS = (Act.RESOLVE, Act.PUT_BACK, Act.ACCEPT, Act.RESET)
_OF_CAMERAS = (Act.MAINTENANCE, Act.PUT_BACK, Act.ACCEPT, Act.RESET, Act.UNDO, Act.TAG)
