"""What settings are written as, and what is said of one that is refused."""

import base64
from ipaddress import IPv4Network, IPv6Network, ip_network

from pydantic import ValidationError

_SECRETS = ("secret_key", "proxy_secret")


def wrong_settings(error: ValidationError) -> list[str]:
    """One line for each setting that was refused: its variable, what is needed, what was given."""
    lines = []
    for item in error.errors(include_url=False):
        name = ".".join(str(part) for part in item["loc"])
        reason = item["msg"].removeprefix("Value error, ")
        given = "" if name in _SECRETS or ", got " in reason else f", got {item['input']!r:.80}"
        lines.append(f"SUREFOOT_{name.upper()}: {reason}{given}")
    return lines


def read_key(text: str) -> bytes:
    """The 32 bytes of a key in base64, the plain alphabet or the one for URLs.

    Raises:
        ValueError: it is not such a key. A passphrase is not: it would be guessed.
    """
    try:
        key = base64.b64decode(text.strip().translate(str.maketrans("-_", "+/")), validate=True)
    except ValueError:
        key = b""
    if len(key) != 32:
        raise ValueError("32 bytes in base64 are needed, as `openssl rand -base64 32` prints them")
    return key


def read_networks(text: str) -> tuple[IPv4Network | IPv6Network, ...]:
    """The networks that a text names, with commas."""
    return tuple(ip_network(part.strip()) for part in text.split(",") if part.strip())


def read_numbers(text: str) -> tuple[float, ...]:
    """The numbers of a text, with commas."""
    return tuple(float(part) for part in text.split(","))
