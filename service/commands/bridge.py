"""`surefoot bridge`: between an MQTT broker and a running service."""

import signal
import threading
from importlib.metadata import version

from service.data_dir import StartError
from service.setting_values import read_camera_names
from service.settings import Settings
from surefoot.bridge.broker import Address
from surefoot.bridge.inward import Topics
from surefoot.bridge.run import Bridge


def run_bridge(settings: Settings, url: str, token: str | None) -> None:
    """Run until SIGTERM or SIGINT.

    Raises:
        StartError: no broker is named, or its certificates cannot be read.
    """
    if settings.mqtt_url is None:
        raise StartError("SUREFOOT_MQTT_URL: mqtt://host:port of a broker is needed, got none")
    if settings.mqtt_ca_file is not None and not settings.mqtt_ca_file.is_file():
        raise StartError(f"SUREFOOT_MQTT_CA_FILE: a file is needed, got {settings.mqtt_ca_file}")
    stopping = threading.Event()
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, lambda *_: stopping.set())
    address = Address(
        url=settings.mqtt_url,
        client_id=settings.mqtt_client_id,
        user=settings.mqtt_user,
        password=settings.mqtt_password,
        ca_file=settings.mqtt_ca_file,
    )
    topics = Topics(
        prefix=settings.mqtt_prefix,
        frigate=settings.mqtt_frigate or None,
        cameras=read_camera_names(settings.mqtt_cameras),
    )
    Bridge(
        address=address,
        topics=topics,
        url=url,
        token=token,
        discovery=settings.mqtt_discovery or None,
        version=version("surefoot"),
    ).run(stopping)
