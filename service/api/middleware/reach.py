"""From where a service is reached, by which names, and whether that asks for access control."""

from ipaddress import ip_address
from urllib.parse import urlsplit

from service.settings import Settings

LOCAL = "localhost"


def is_address(name: str) -> bool:
    """Whether a host is an IP address rather than a name."""
    try:
        ip_address(name)
    except ValueError:
        return False
    return True


def is_loopback(host: str) -> bool:
    """Whether a name or an address is this machine's own."""
    return host == LOCAL or (is_address(host) and ip_address(host).is_loopback)


def host_names(settings: Settings) -> frozenset[str]:
    """Names and addresses that requests may be for; small letters, without ports."""
    given = {part.strip().lower().strip("[]") for part in settings.allowed_hosts.split(",")}
    public = urlsplit(settings.public_url or "").hostname or ""
    return frozenset({LOCAL, settings.host.lower(), public, *given} - {""})


def auth_on(settings: Settings) -> bool:
    """Whether tokens are needed: by themselves wherever others than this machine may ask."""
    if settings.auth != "auto":
        return settings.auth == "on"
    public = urlsplit(settings.public_url or "").hostname or LOCAL
    here = is_loopback(settings.host) and is_loopback(public)
    return not here or bool(settings.proxy_from)
