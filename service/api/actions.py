"""`POST /actions`: one act on many alerts or cameras, each for itself."""

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
from service.enums import Action, Answer
from service.errors import ConflictError, ServiceError
from service.store.access import name_in

_NEEDS = {Action.SILENCE: ("until",), Action.RESOLVE: ("outcome",), Action.MAINTENANCE: ("to",)}


class ActionsBody(Body):
    """An action, and the ids of alerts or cameras that it is done with, in this order.

    `acknowledged` false gives acknowledged alerts back. `until` and `reason` are of a silence,
    `outcome` of a resolution, `from`, `to` and `reason` of maintenance, `add` and `remove` of tags.
    """

    ids: Annotated[list[Text], Field(min_length=1, max_length=500)]
    action: Action
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
        for name in _NEEDS.get(self.action, ()):
            if name not in self.model_fields_set or (name != "until" and not getattr(self, name)):
                raise ValueError(f"{name}: is needed to {self.action}")
        if self.action == Action.TAG and not (self.add or self.remove):
            raise ValueError("add: a tag to add or to remove is needed")
        return self


class ActionProblem(BaseModel):
    """Why it was not done: as of a problem document."""

    status: int
    code: str
    detail: str


class ActionDone(BaseModel):
    """What became of one id; it was done where there is no `problem`."""

    id: str
    problem: ActionProblem | None


class UndoOut(BaseModel):
    """The cameras of which the act `undo` takes back what was done, and until when it is taken."""

    ids: list[str]
    until: datetime


class ActionsOut(BaseModel):
    """One answer an id, in the order of the ids; `undo` where any of it can be taken back."""

    items: list[ActionDone]
    undo: UndoOut | None


router = APIRouter(tags=["alerts"], route_class=NamingRoute)


@router.post("/actions")
def run_action(body: ActionsBody, state: StateDep, write: WritesDep) -> ActionsOut:
    """Apply an action to many alerts or cameras.

    `acknowledge`, `silence` and `resolve` take ids of alerts, all others ids of cameras. Each id
    is a transaction of its own: an error for one does not stop the others.
    """
    begun, undoable = datetime.now(UTC), dict[str, datetime]()

    def done(one: str) -> ActionDone:
        about = one if body.action in _OF_CAMERAS else None
        try:
            with write(about) as session:
                _DO[body.action](session, state, one, body)
                mine = _undoable(session, one, body.action, begun)
            undoable.update(mine)
        except ServiceError as error:  # of this id alone; the others are still to be done
            said = ActionProblem(status=error.status, code=error.code, detail=error.detail)
            return ActionDone(id=one, problem=said)
        return ActionDone(id=one, problem=None)

    items = [done(one) for one in dict.fromkeys(body.ids)]
    until = min(undoable.values(), default=None)
    return ActionsOut(
        items=items, undo=None if until is None else UndoOut(ids=list(undoable), until=until)
    )


def _undoable(session: Session, one: str, action: Action, begun: datetime) -> dict[str, datetime]:
    """Until when what was just said of cameras can be taken back, by their ids."""
    if action not in _ANSWERS:
        return {}
    cameras_of: Sequence[str | None] = [one]
    if action == Action.RESOLVE:
        record = alerts.show_alert(session, one)
        cameras_of = record.camera_ids or [record.camera_id]
    found = {}
    for camera_id in cameras_of:
        entry = None if camera_id is None else undo.last_answer(session, camera_id, begun)
        if camera_id is not None and entry is not None and entry.at >= begun:
            found[camera_id] = entry.at + undo.UNDO_WITHIN
    return found


def _acknowledge(session: Session, state: AppState, one: str, body: ActionsBody) -> None:
    by = name_in(session, body.by)
    alerts.acknowledge_alert(session, one, by, acknowledged=body.acknowledged)


def _silence(session: Session, state: AppState, one: str, body: ActionsBody) -> None:
    by = name_in(session, body.by)
    silence.silence_alert(session, state.settings, one, body.until, body.reason, by)


def _resolve(session: Session, state: AppState, one: str, body: ActionsBody) -> None:
    assert body.outcome is not None
    by = name_in(session, body.by)
    decisions.resolve_alert(session, state.queue, state.settings, one, body.outcome, body.note, by)


def _maintain(session: Session, state: AppState, one: str, body: ActionsBody) -> None:
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


def _tag(session: Session, state: AppState, one: str, body: ActionsBody) -> None:
    record = cameras.require_camera(session, one)
    tags = sorted({*record.tags, *body.add} - {*body.remove})
    if len(tags) > MOST_TAGS:
        raise ConflictError(f"tags: at most {MOST_TAGS} are taken, it would have {len(tags)}")
    if tags != record.tags:
        change, etag = CameraChange(tags=tags), cameras.etag_of(record)
        cameras.change_camera(session, state.queue, state.settings, one, etag, change, body.by)


def _decide(
    use_case: Callable[..., object],
) -> Callable[[Session, AppState, str, ActionsBody], None]:
    def decide(session: Session, state: AppState, one: str, body: ActionsBody) -> None:
        decision = Decision(camera_id=one, by=name_in(session, body.by), note=body.note)
        use_case(session, state.queue, state.settings, decision)

    return decide


_DO: dict[Action, Callable[[Session, AppState, str, ActionsBody], None]] = {
    Action.ACKNOWLEDGE: _acknowledge,
    Action.SILENCE: _silence,
    Action.RESOLVE: _resolve,
    Action.MAINTENANCE: _maintain,
    Action.PUT_BACK: _decide(decisions.put_back),
    Action.ACCEPT: _decide(decisions.accept_pose),
    Action.RESET: _decide(decisions.learn_anew),
    Action.UNDO: _decide(undo.undo_answer),
    Action.TAG: _tag,
}
_ANSWERS = (Action.RESOLVE, Action.PUT_BACK, Action.ACCEPT, Action.RESET)
_OF_CAMERAS = (
    Action.MAINTENANCE,
    Action.PUT_BACK,
    Action.ACCEPT,
    Action.RESET,
    Action.UNDO,
    Action.TAG,
)
