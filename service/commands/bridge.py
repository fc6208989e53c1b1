"""`surefoot bridge`: between an MQTT broker and a running service."""

import signal
import threading
from importlib.metadata import version

from service.data_dir import BRIDGE, StartError, make_private
from service.setting_values import read_camera_names
from service.settings import Settings
from service.workers.processes.process import at_end_of_stdin
from surefoot.bridge.broker import Address
from surefoot.bridge.feeds import Topics, read_feeds
from surefoot.bridge.run import Bridge
from surefoot.bridge.spool import Spool, SpoolError


def run_bridge(
    settings: Settings, url: str, token: str | None, *, follow_stdin: bool = False
) -> None:
    """Run until SIGTERM or SIGINT, or with `follow_stdin` until that ends.

    Raises:
        StartError: no broker is named, its certificates cannot be read, or another bridge runs on
            this data directory.
    """
    if settings.mqtt_url is None:
        raise StartError("SUREFOOT_MQTT_URL: mqtt://host:port of a broker is needed, got none")
    try:
        feeds = read_feeds(settings.mqtt_feeds)
    except ValueError as error:
        raise StartError(f"SUREFOOT_MQTT_FEEDS: {error}") from error
    address = Address(
        url=settings.mqtt_url,
        client_id=settings.mqtt_client_id,
        user=settings.mqtt_user,
        password=settings.mqtt_password,
        ca_file=settings.mqtt_ca_file,
    )
    if settings.mqtt_ca_file is not None:
        try:
            address.tls_context()
        except OSError as error:  # ssl.SSLError, too
            needed = "a file with PEM certificates is needed"
            raise StartError(
                f"SUREFOOT_MQTT_CA_FILE: {needed}, got {settings.mqtt_ca_file} ({error})"
            ) from error
    stopping = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.set())
    if follow_stdin:
        at_end_of_stdin(stopping.set)
    topics = Topics(
        prefix=settings.mqtt_prefix,
        frigate=settings.mqtt_frigate or None,
        cameras=read_camera_names(settings.mqtt_cameras),
        feeds=feeds,
    )
    make_private(settings.data_dir)
    try:
        spool = Spool(settings.data_dir / BRIDGE, int(settings.mqtt_spool_mb * 2**20))
    except SpoolError as error:
        raise StartError(f"data_dir: {error}") from error
    Bridge(
        address=address,
        topics=topics,
        spool=spool,
        frigate_url=settings.mqtt_frigate_url if settings.mqtt_frigate else None,
        url=url,
        token=token,
        discovery=settings.mqtt_discovery or None,
        version=version("surefoot"),
    ).run(stopping)
