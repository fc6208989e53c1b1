"""The listening socket of the API."""

import socket

from service.settings import Settings


def listen(settings: Settings) -> socket.socket:
    """The listening socket; taken first, so that a port in use fails before anything starts."""
    listener = socket.socket(socket.AF_INET6 if ":" in settings.host else socket.AF_INET)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    listener.bind((settings.host, settings.port))
    return listener
