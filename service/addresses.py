"""Addresses that are stored: the part of each that callers without `admin` see."""

from urllib.parse import urlsplit


def origin_of(url: str) -> str:
    """Scheme, host and port of a stored address.

    The rest is hidden from callers without `admin`: users, paths and queries often hold secrets.
    """
    parts = urlsplit(url)
    return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}".lower()
