"""`surefoot serve`: the API and its local workers, one command."""

import contextlib
import logging
import signal

import uvicorn

from service.app import create_app
from service.jobs import exits
from service.listener import listen
from service.local_workers import local_workers
from service.migrate import migrate
from service.settings import Settings

log = logging.getLogger("surefoot.serve")


def run_service(settings: Settings) -> None:
    """Migrate, start the workers, serve until SIGTERM or SIGINT, stop cleanly."""
    with contextlib.closing(listen(settings)) as listener:
        migrate(settings)
        config = uvicorn.Config(
            create_app(settings),
            log_level="warning",
            access_log=False,
            timeout_graceful_shutdown=3,
        )
        server = uvicorn.Server(config)

        def give_up() -> None:
            server.should_exit = True

        with local_workers(settings, give_up) as workers:
            host, port = listener.getsockname()[:2]
            log.info("serving", extra={"url": f"http://{host}:{port}"})
            # uvicorn raises the signal that ended it once more; by then there is nothing to kill.
            for number in (signal.SIGTERM, signal.SIGINT):
                signal.signal(number, lambda *_: None)
            server.run(sockets=[listener])
    log.info("stopped")
    if workers.refused:
        raise SystemExit(exits.REFUSED)
