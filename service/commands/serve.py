"""`surefoot serve`: the API and its local workers, one command."""

import contextlib
import logging
import os
import signal
import socket
import sys
import time
from datetime import UTC, datetime
from functools import partial

import uvicorn
from sqlalchemy.exc import SQLAlchemyError

from service.access.activity import note_settings
from service.access.bridge_token import TOKEN_ID, renew_bridge_token
from service.api.middleware.connections import ConnectionGuard, GuardedProtocol
from service.api.middleware.hosts import auth_on, is_loopback
from service.commands.local_bridge import TOKEN_VARIABLE, LocalBridge
from service.commands.migrate import migrate
from service.data_dir import StartError, held_alone, make_private
from service.errors import ServiceError
from service.settings import Settings
from service.store import access
from service.store.engines.store import Store
from service.workers.processes import exits
from service.workers.processes.collector import importing, settle_collector
from service.workers.processes.local_workers import LocalWorkers
from service.workers.processes.process import at_end_of_stdin, settle_allocator

log = logging.getLogger("surefoot.serve")

_SWITCH_S = 0.001
_BACKLOG = 128  # connections in the kernel while we are busy; asyncio accepts so many in one go
# Longer than clients and proxies keep what is idle (nginx 60 s, Go 90 s): of two that close at once
# one has asked, and is not answered.
_KEEP_ALIVE_S = 100


def run_service(settings: Settings, *, follow_stdin: bool = False) -> None:
    """Migrate, start the workers, serve until SIGTERM or SIGINT, stop cleanly.

    With `follow_stdin` it ends when its stdin does, too: who started it holds the other end.

    Raises:
        StartError: what keeps it from serving, in one line.
    """
    if follow_stdin:
        at_end_of_stdin(_stop)
    make_private(settings.data_dir)
    settle_allocator()
    with held_alone(settings.data_dir), contextlib.closing(listen(settings)) as listener:
        migrate(settings)
        _require_way_in(settings)
        _keep_settings(settings)
        with importing():  # half of what is imported, and who is refused is told without it
            from service.app import create_app

        app = create_app(settings)
        guard = ConnectionGuard(settings, app.state.instruments)
        config = uvicorn.Config(
            app,
            loop="asyncio",
            http=partial(GuardedProtocol, guard=guard),  # type: ignore[arg-type]
            ws="none",
            backlog=_BACKLOG,
            log_level="warning",
            access_log=False,
            server_header=False,
            proxy_headers=False,  # whom to believe is the guard's to know
            timeout_keep_alive=_KEEP_ALIVE_S,
            timeout_graceful_shutdown=3,
        )
        server = uvicorn.Server(config)

        def give_up() -> None:
            server.should_exit = True

        host, port = listener.getsockname()[:2]
        with (
            LocalWorkers(settings, give_up) as workers,
            LocalBridge(settings, host, port, _bridge_token(settings)),
        ):
            log.info("serving", extra={"url": f"http://{host}:{port}"})
            settle_collector()
            # So long waits each step of the loop for threads that compute.
            sys.setswitchinterval(_SWITCH_S)
            # uvicorn raises the signal that ended it once more; by then there is nothing to kill.
            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, lambda *_: None)
            server.run(sockets=[listener])
    log.info("stopped")
    if workers.refused:
        raise SystemExit(exits.REFUSED)


def _require_way_in(settings: Settings) -> None:
    """Refuse to serve strangers by mistake, and to serve nobody at all."""
    if not auth_on(settings):
        if not is_loopback(settings.host):
            log.warning("access_off", extra={"host": settings.host})
        return
    if settings.proxy_from:
        return
    with contextlib.closing(Store(settings)) as store, store.read() as session:
        count = access.count_valid(session, datetime.now(UTC), besides=TOKEN_ID)
    if not count:
        raise StartError(
            "auth: tokens are needed here, and nobody has one; make one by `surefoot token add "
            "NAME --scope admin` with the same data directory, or let everybody in by "
            "SUREFOOT_AUTH=off"
        )


def _keep_settings(settings: Settings) -> None:
    """Have the log of what was done know other settings; on a full disk, it is served without."""
    try:
        with contextlib.closing(Store(settings)) as store:
            store.write_if_needed(None, partial(note_settings, settings=settings))
    except (SQLAlchemyError, ServiceError) as error:
        log.warning("settings_not_kept", extra={"error": str(error)})


def _bridge_token(settings: Settings) -> str | None:
    """A token for the bridge that runs here; None where it needs none, or has one by hand."""
    if settings.mqtt_url is None or not auth_on(settings) or os.environ.get(TOKEN_VARIABLE):
        return None
    with contextlib.closing(Store(settings)) as store, store.write() as session:
        token = renew_bridge_token(session)
    if token is None:
        log.warning("bridge_token_revoked", extra={"needed": TOKEN_VARIABLE})
    return token


def listen(settings: Settings) -> socket.socket:
    """The listening socket; taken first, so that a port in use fails before anything starts.

    Raises:
        StartError: it cannot be had.
    """
    family = socket.AF_INET6 if ":" in settings.host else socket.AF_INET
    # asyncio switches Nagle's algorithm off only where the protocol is named; with it on, each
    # answer waits 40 ms for the client's acknowledgement of its headers.
    listener = socket.socket(family, socket.SOCK_STREAM, socket.IPPROTO_TCP)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((settings.host, settings.port))
        return listener
    except OSError as error:
        raise StartError(
            f"port: cannot listen on {settings.host}, port {settings.port} ({error.strerror}); "
            "name others by --host and --port, or SUREFOOT_HOST and SUREFOOT_PORT"
        ) from error


def _stop() -> None:
    while True:
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(1.0)
