"""Dependencies of routes: the application's state, sessions and bodies.

Coroutines, where nothing waits: anything else is given a thread, which costs more than most of them
do.
"""

import threading
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass, field
from typing import Annotated

from fastapi import Depends, Header, Request
from sqlalchemy.orm import Session

from service.access.tokens import Caller
from service.api.middleware.event_feed import Feed
from service.api.middleware.instruments import Instruments
from service.cameras.post_log import PostLog
from service.cameras.tracks import Pictures, Quota, Watched
from service.job_queue import JobQueue
from service.notifications.host_backoff import HostBackoff
from service.settings import Settings
from service.store.access import set_actor
from service.store.engines.sqlite import Turns
from service.store.engines.store import Store

_AIM_PAUSE_S = 10.0


@dataclass(frozen=True, slots=True, kw_only=True)
class AppState:
    """State of one application from start to stop.

    Event streams follow the `feed`; large bodies are read in `large_bodies`' turns, still images in
    `stills`', for each takes a process of its own. `image_hosts` are hosts of cameras that did not
    answer an aim; its pause is short, because the person who aims may have just switched one on.
    """

    settings: Settings
    store: Store
    queue: JobQueue
    quota: Quota
    feed: Feed
    pictures: Pictures = field(default_factory=Pictures)
    watched: Watched = field(default_factory=Watched)
    posts: PostLog = field(default_factory=PostLog)
    instruments: Instruments = field(default_factory=Instruments)
    large_bodies: Turns = field(default_factory=lambda: Turns("large bodies"))
    stills: Turns = field(default_factory=lambda: Turns("still images"))
    image_hosts: HostBackoff = field(default_factory=lambda: HostBackoff(_AIM_PAUSE_S))
    stopping: threading.Event = field(default_factory=threading.Event)


async def get_state(request: Request) -> AppState:
    """The application's state."""
    state: AppState = request.state.app
    return state


StateDep = Annotated[AppState, Depends(get_state)]


async def read_session(state: StateDep) -> AsyncIterator[Session]:
    """A session that only reads; it connects with its first statement, in the route's thread."""
    with state.store.read() as session:
        yield session


async def get_caller(request: Request) -> Caller | None:
    """The caller; None where access is off."""
    caller: Caller | None = getattr(request.state, "caller", None)
    return caller


CallerDep = Annotated[Caller | None, Depends(get_caller)]


async def get_address(request: Request) -> str:
    """The address that a request came from."""
    address: str = request.state.address
    return address


AddressDep = Annotated[str, Depends(get_address)]


Writes = Callable[[str | None], AbstractContextManager[Session]]


async def get_writes(state: StateDep, caller: CallerDep, address: AddressDep) -> Writes:
    """Sessions that write about a camera, or about everything: None.

    They do so in the name of the caller, whatever name a body says.
    """

    @contextmanager
    def write(about: str | None) -> Iterator[Session]:
        with state.store.write(about) as session:
            set_actor(session, caller, address)
            yield session

    return write


WritesDep = Annotated[Writes, Depends(get_writes)]


def write_session(request: Request, write: WritesDep) -> Iterator[Session]:
    """A session that commits before the answer is sent, or not at all.

    It writes about the camera that the path names, or about everything.
    """
    with write(request.path_params.get("camera_id")) as session:
        yield session


ReadDep = Annotated[Session, Depends(read_session, scope="function")]
WriteDep = Annotated[Session, Depends(write_session, scope="function")]


async def whole_body(request: Request) -> bytes:
    """The request's body; how large it may be was seen to before (`admission.py`)."""
    return await request.body()


BodyDep = Annotated[bytes, Depends(whole_body)]


def media_type_of(request: Request) -> str:
    """The type of the request's body, without its parameters."""
    return request.headers.get("content-type", "").split(";")[0].strip().lower()


IfMatch = Annotated[
    str | None, Header(description="the ETag of what is changed, as it was read; or *")
]
