"""The person in whose name a session writes: what is kept of an act says so by itself."""

from dataclasses import dataclass

from sqlalchemy.orm import Session

_KEY = "surefoot.actor"


@dataclass(frozen=True, slots=True, kw_only=True)
class Actor:
    """A person who is known, and the token that stands for it."""

    name: str
    token_id: str | None


def set_actor(session: Session, actor: Actor | None) -> None:
    """Let a session write in somebody's name."""
    session.info[_KEY] = actor


def name_in(session: Session, said: str | None) -> str | None:
    """Who did it: in whose name a session writes, and where that is not known, who is said."""
    actor = actor_of(session)
    return said if actor is None else actor.name


def actor_of(session: Session) -> Actor | None:
    """In whose name a session writes; None where nobody is known, or the service acts."""
    actor: Actor | None = session.info.get(_KEY)
    return actor
