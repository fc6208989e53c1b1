"""Settings as they are written, and what is said of one that is refused."""

import base64
import os
import re
from collections.abc import Callable
from ipaddress import IPv4Network, IPv6Network, ip_network
from urllib.parse import urlsplit
from zoneinfo import ZoneInfo, ZoneInfoNotFoundError

from pydantic import AfterValidator, ValidationError

from models.durations import DAY_S, HOUR_S

_SECRETS = ("secret_key", "proxy_secret", "database_url", "mqtt_password", "smtp_password")
_SCHEMES = ("postgresql", "postgres", "postgresql+psycopg")

WEEKDAYS = ("monday", "tuesday", "wednesday", "thursday", "friday", "saturday", "sunday")
_ADDRESS = re.compile(r"[!-?A-~]+@[!-?A-~]+")  # of printable ASCII; what takes it knows the rest
_UNITS_S = {"days": DAY_S, "hours": HOUR_S, "h": HOUR_S, "min": 60.0, "s": 1.0}
_LONGEST_S, _LARGEST = 36_500 * DAY_S, 2**31 - 1
_MOST_WORKERS = 4  # unless more are asked for: each holds 240 MB


def one_a_core() -> int:
    """The number of workers of a machine where nobody says."""
    ours = getattr(os, "sched_getaffinity", None)  # Linux's alone
    cores = len(ours(0)) if ours else os.cpu_count() or 1
    return min(cores, _MOST_WORKERS)


def wrong_settings(error: ValidationError) -> list[str]:
    """One line for each setting that was refused: its variable, what is needed, what was given."""
    lines = []
    for item in error.errors(include_url=False):
        name = ".".join(str(part) for part in item["loc"])
        reason = item["msg"].removeprefix("Value error, ")
        given = "" if name in _SECRETS or ", got " in reason else f", got {item['input']!r:.80}"
        lines.append(f"SUREFOOT_{name.upper()}: {reason}{given}")
    return lines


def readable(read: Callable[[str], object]) -> AfterValidator:
    """The check of a text that it can be read so; it stays text."""

    def check(text: str) -> str:
        read(text)
        return text

    return AfterValidator(check)


def check_number(name: str, value: float) -> None:
    """Check that a number is one that times and rows can be counted by; `name` ends with its unit.

    Raises:
        ValueError: it is infinite, or more than a century or 2147483647.
    """
    unit_s = _UNITS_S.get(name.rpartition("_")[2])
    most = _LARGEST if unit_s is None else _LONGEST_S / unit_s
    if not abs(value) <= most:  # nor is it NaN
        raise ValueError(f"at most {most:.10g} is taken, got {value!r:.40}")


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


def read_mqtt_url(text: str) -> str:
    """The URL of a broker.

    Raises:
        ValueError: it is none.
    """
    parts = urlsplit(text)
    if parts.scheme not in ("mqtt", "mqtts") or not parts.hostname or parts.username is not None:
        raise ValueError("mqtt://host:port or mqtts://host:port is needed, users by MQTT_USER")
    _ = parts.port  # raises where it is no number of one
    return text


def read_http_url(text: str) -> str:
    """The URL of another service.

    Raises:
        ValueError: it is none, or has a user, a query or a fragment.
    """
    parts = urlsplit(text)
    plain = parts._replace(query="", fragment="").geturl() == text and "@" not in parts.netloc
    if parts.scheme not in ("http", "https") or not parts.hostname or not plain:
        raise ValueError("http://host:port or https://host:port is needed, without a user")
    _ = parts.port  # raises where it is no number of one
    return text


def read_public_url(text: str) -> str:
    """The URL of this service; empty is none.

    Raises:
        ValueError: it is none, or has a user, a query or a fragment.
    """
    return text and read_http_url(text)


def read_camera_names(text: str) -> dict[str, str]:
    """Ids of cameras by the names that others have for them: `name=id`, with commas.

    Raises:
        ValueError: a part is not such a pair.
    """
    names = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, equals, camera_id = (side.strip() for side in part.partition("="))
        if not (name and equals and camera_id):
            raise ValueError(f"name=camera-id, with commas, is needed, got {part!r:.80}")
        names[name] = camera_id
    return names


def read_addresses(text: str) -> tuple[str, ...]:
    """The mail addresses of a text, with commas.

    Raises:
        ValueError: one of them is none.
    """
    found = tuple(part.strip() for part in text.split(",") if part.strip())
    if not all(_ADDRESS.fullmatch(each) for each in found):
        raise ValueError(f"addresses as name@host, with commas, are needed, got {text!r:.80}")
    return found


def read_delays(text: str) -> tuple[float, ...]:
    """The times in seconds of a text, with commas.

    Raises:
        ValueError: one of them is none, or not above 0.
    """
    delays = tuple(float(part) for part in text.split(","))
    if not all(0 < delay <= _LONGEST_S for delay in delays):
        raise ValueError(f"numbers above 0, with commas, are needed, got {text!r}")
    return delays


def read_zone(text: str) -> str:
    """The name of a zone that this machine knows.

    Raises:
        ValueError: there is no such zone.
    """
    if text != "UTC":  # which needs no zone database
        try:
            ZoneInfo(text)
        except (ZoneInfoNotFoundError, ValueError) as error:
            raise ValueError(f"a zone such as Europe/Berlin is needed, got {text!r}") from error
    return text


def read_database_url(text: str) -> str:
    """The URL of a PostgreSQL database, by the name that SQLAlchemy knows its driver by.

    Raises:
        ValueError: it names no such database; the message has no password.
    """
    scheme, _, rest = text.partition("://")
    if scheme not in _SCHEMES or not urlsplit(f"//{rest}").path.strip("/"):
        raise ValueError(
            "postgresql://user:password@host:port/database is needed, or nothing for an SQLite "
            f"file in the data directory, got {scheme[:20]}://"
        )
    return f"postgresql+psycopg://{rest}"
