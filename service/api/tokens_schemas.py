"""Bodies of `/tokens`."""

from datetime import UTC, datetime
from typing import Annotated, Self

from pydantic import BaseModel, Field

from service.access.tokens import MAX_NAME, MadeToken, TokenSpec
from service.api.fields import Body, CameraId, Moment
from service.enums import TokenScope, TokenState
from service.store.access import TokenRecord


class TokenBody(Body):
    """A token to make; `cameras` are those that it posts tracks for, all if left out."""

    name: Annotated[str, Field(min_length=1, max_length=MAX_NAME)]
    scopes: Annotated[list[TokenScope], Field(min_length=1, max_length=4)]
    cameras: Annotated[list[CameraId], Field(min_length=1, max_length=1000)] | None = None
    expires_at: Moment | None = None

    def to_spec(self) -> TokenSpec:
        """A token for the use case."""
        return TokenSpec(
            name=self.name,
            scopes=tuple(self.scopes),
            cameras=None if self.cameras is None else tuple(self.cameras),
            expires_at=self.expires_at,
        )


class TokenOut(BaseModel):
    """A token, without its secret; `used_at` is to the minute."""

    id: str
    name: str
    scopes: list[TokenScope]
    cameras: list[str] | None
    state: TokenState
    created_at: datetime
    created_by: str | None
    expires_at: datetime | None
    used_at: datetime | None
    revoked_at: datetime | None

    @classmethod
    def from_record(cls, record: TokenRecord) -> Self:
        """The body of a token."""
        return cls.model_validate(_fields(record))


class TokenMade(TokenOut):
    """A token just made: the one answer that has the token itself."""

    token: str

    @classmethod
    def from_value(cls, made: MadeToken) -> Self:
        """The body of a new token."""
        return cls.model_validate({**_fields(made.record), "token": made.text})


class TokenList(BaseModel):
    """Tokens, oldest first."""

    items: list[TokenOut]


def _fields(record: TokenRecord) -> dict[str, object]:
    names = TokenOut.model_fields.keys() - {"state"}
    over = record.expires_at is not None and record.expires_at <= datetime.now(UTC)
    state = TokenState.EXPIRED if over else TokenState.VALID
    if record.revoked_at:
        state = TokenState.REVOKED
    return {**{name: getattr(record, name) for name in names}, "state": state}
