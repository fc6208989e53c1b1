"""Keys of advisory locks."""

import hashlib

# The first key of our advisory locks; the second tells what is locked.
LOCKS = 0x5F007


def lock_key(about: str) -> int:
    """A name as an int4 above 0; two names of one key wait for each other, and no more."""
    return int.from_bytes(hashlib.sha256(about.encode()).digest()[:4], "big") % (2**31 - 1) + 1
