"""What routes are given: the application's state, sessions and bodies."""

import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Header, Request
from sqlalchemy.orm import Session

from service.access.callers import Caller
from service.errors import PreconditionRequiredError, TooLargeError
from service.formats.track import MAX_BODY_BYTES
from service.job_queue import JobQueue
from service.routes.instruments import Instruments
from service.settings import Settings
from service.store.actor import Actor, set_actor
from service.store.database import Store


@dataclass(frozen=True, slots=True, kw_only=True)
class AppState:
    """What one application holds from start to stop."""

    settings: Settings
    store: Store
    queue: JobQueue
    instruments: Instruments = field(default_factory=Instruments)
    stopping: threading.Event = field(default_factory=threading.Event)


def get_state(request: Request) -> AppState:
    """The application's state."""
    state: AppState = request.state.app
    return state


StateDep = Annotated[AppState, Depends(get_state)]


def read_session(state: StateDep) -> Iterator[Session]:
    """A session that only reads."""
    with state.store.read() as session:
        yield session


def get_caller(request: Request) -> Caller | None:
    """Who asks; None where access is off."""
    caller: Caller | None = getattr(request.state, "caller", None)
    return caller


CallerDep = Annotated[Caller | None, Depends(get_caller)]


def get_actor(caller: CallerDep) -> Actor | None:
    """In whose name an act is kept, whatever name its body says."""
    return None if caller is None else Actor(name=caller.name, token_id=caller.token_id)


ActorDep = Annotated[Actor | None, Depends(get_actor)]


def name_of(actor: Actor | None, said: str | None = None) -> str | None:
    """Who acts: the person who is known; where access is off, whoever the body says."""
    return said if actor is None else actor.name


def write_session(state: StateDep, actor: ActorDep) -> Iterator[Session]:
    """A session that commits before the answer is sent, or not at all."""
    with state.store.write() as session:
        set_actor(session, actor)
        yield session


ReadDep = Annotated[Session, Depends(read_session, scope="function")]
WriteDep = Annotated[Session, Depends(write_session, scope="function")]


async def limited_body(request: Request) -> bytes:
    """The request's body.

    Raises:
        TooLargeError: it is, or says it is, larger than 32 MiB.
    """
    declared = request.headers.get("content-length", "")
    size = int(declared) if declared.isdigit() else 0
    chunks: list[bytes] = []
    received = 0
    if size <= MAX_BODY_BYTES:
        async for chunk in request.stream():
            received += len(chunk)
            chunks.append(chunk)
            if received > MAX_BODY_BYTES:
                break
    if max(size, received) > MAX_BODY_BYTES:
        raise TooLargeError(
            f"body: at most {MAX_BODY_BYTES} bytes a request are taken, "
            f"got {'at least ' if not size else ''}{max(size, received)}"
        )
    return b"".join(chunks)


BodyDep = Annotated[bytes, Depends(limited_body)]


def required_etag(if_match: Annotated[str | None, Header()] = None) -> str:
    """The version that a change is meant for.

    Raises:
        PreconditionRequiredError: the header is missing.
    """
    if if_match is None:
        raise PreconditionRequiredError("If-Match: the ETag of the camera as read is needed")
    return if_match


EtagDep = Annotated[str, Depends(required_etag)]
