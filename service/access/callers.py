"""Callers, and what their scopes allow."""

from collections.abc import Iterable
from dataclasses import dataclass

from service.enums import TokenScope

# Each of these holds those before it; posting tracks is apart, so that a tracker's token reads
# nothing and an operator's invents no people.
_LADDER = (TokenScope.READ, TokenScope.OPERATE, TokenScope.ADMIN)


@dataclass(frozen=True, slots=True, kw_only=True)
class Caller:
    """Somebody who was let in.

    `token_id` is None where a proxy vouches for a person, `session_hash` where no page is logged
    in. `cameras` are those that tracks may be posted for; None: all.
    """

    name: str
    scopes: frozenset[str]
    token_id: str | None = None
    session_hash: str | None = None
    cameras: frozenset[str] | None = None

    def may(self, scope: TokenScope) -> bool:
        """True if what needs a scope is allowed."""
        return scope in widened(self.scopes)

    def may_post(self, camera_id: str) -> bool:
        """True if tracks of a camera may be posted, as far as the camera goes."""
        return self.cameras is None or camera_id in self.cameras


def widened(scopes: Iterable[str]) -> frozenset[str]:
    """Scopes with all that they hold."""
    given = set(scopes)
    for at, scope in enumerate(_LADDER):
        if scope in given:
            given.update(_LADDER[:at])
    return frozenset(given)
