"""URLs and addresses that a webhook may have: private ones only where the operator allows them.

The check is on addresses that a name resolves to, never on how the name is spelt, so
`http://2130706433/` is seen as 127.0.0.1. It is made when a webhook is created and again at each
connection, which goes to the very address that was checked: a name that changes between check and
connection gains nothing.
"""

import socket
from collections.abc import Sequence
from ipaddress import IPv4Address, IPv4Network, IPv6Address, IPv6Network, ip_address

import httpx

Networks = Sequence[IPv4Network | IPv6Network]

MAX_URL_LENGTH = 2000
_PORTS = {"http": 80, "https": 443}


class AddressError(ValueError):
    """A URL that nothing may be sent to; the message gives the limit and the value."""


def read_url(text: str) -> httpx.URL:
    """The parsed URL.

    Raises:
        AddressError: it is no plain http or https URL.
    """
    if len(text) > MAX_URL_LENGTH:
        raise AddressError(f"at most {MAX_URL_LENGTH} characters are taken, got {len(text)}")
    try:
        url = httpx.URL(text)
    except (httpx.InvalidURL, UnicodeError) as error:
        raise AddressError(f"a URL is needed: {error}") from error
    if url.scheme not in _PORTS:
        raise AddressError(f"http or https is needed, got {url.scheme or 'no scheme'!r}")
    if url.userinfo:
        raise AddressError("user names and passwords in a URL are not taken")
    if not url.host:
        raise AddressError(f"a host is needed, got {text!r:.80}")
    if url.port is not None and not 0 < url.port < 65536:
        raise AddressError(f"a port from 1 to 65535 is needed, got {url.port}")
    return url


def check_url(text: str, allowed: Networks) -> httpx.URL:
    """The parsed URL, if its host resolves to addresses that may be reached. Asks the resolver.

    Raises:
        AddressError: it is no plain http or https URL, or leads where it must not.
    """
    url = read_url(text)
    checked_addresses(url.host, url.port or _PORTS[url.scheme], allowed)
    return url


def checked_addresses(host: str, port: int, allowed: Networks) -> list[str]:
    """The addresses of a host, all of which may be reached.

    Raises:
        AddressError: it has none, or one of them may not be reached.
    """
    try:
        found = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError) as error:
        raise AddressError(f"the host {host!r} does not resolve: {error}") from error
    addresses = list(dict.fromkeys(str(entry[4][0]) for entry in found))
    for address in addresses:
        if not may_reach(address, allowed):
            ranges = ", ".join(str(network) for network in allowed) or "none"
            raise AddressError(
                f"the host {host!r} resolves to {address}, which is private or reserved; "
                f"SUREFOOT_WEBHOOK_ALLOW names those that may be reached: {ranges}"
            )
    return addresses


def may_reach(address: str, allowed: Networks) -> bool:
    """True where an address is public, or in a network that is allowed."""
    ip = _inner(ip_address(address))
    return _is_public(ip) or any(ip in network for network in allowed)


def _inner(ip: IPv4Address | IPv6Address) -> IPv4Address | IPv6Address:
    """The IPv4 address that an IPv6 address stands for, if it does."""
    if isinstance(ip, IPv4Address):
        return ip
    return ip.ipv4_mapped or ip.sixtofour or ip


def _is_public(ip: IPv4Address | IPv6Address) -> bool:
    # Python counts multicast and the old site-local addresses as global; NAT64 ones are reserved.
    if isinstance(ip, IPv6Address) and ip.is_site_local:
        return False
    return ip.is_global and not (ip.is_multicast or ip.is_reserved or ip.is_unspecified)
