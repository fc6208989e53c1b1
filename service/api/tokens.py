"""`/tokens`: make, list, revoke."""

from datetime import UTC, datetime
from typing import Annotated, Self

from fastapi import APIRouter, Response
from pydantic import BaseModel, Field

from service.access import tokens
from service.access.tokens import MAX_NAME, TokenSpec
from service.api.middleware.dependencies import ReadDep, WriteDep
from service.api.schemas import Body, CameraId, Moment, Out, Text
from service.enums import TokenScope, TokenState
from service.store import access
from service.store.access import TokenRecord, name_in


class TokenBody(Body, extra="forbid"):
    """A token to make; it posts tracks for `cameras` and under `sources`, all if left out.

    An unknown field is refused: were it a misspelt limit, the token could do more than was meant.
    """

    name: Annotated[str, Field(min_length=1, max_length=MAX_NAME)]
    scopes: Annotated[list[TokenScope], Field(min_length=1, max_length=4)]
    cameras: Annotated[list[CameraId], Field(min_length=1, max_length=1000)] | None = None
    sources: Annotated[list[Text], Field(min_length=1, max_length=100)] | None = None
    expires_at: Moment | None = None


class TokenOut(Out):
    """A token, without its secret; `used_at` is to the minute."""

    id: str
    name: str
    scopes: list[TokenScope]
    cameras: list[str] | None
    sources: list[str] | None
    state: TokenState
    created_at: datetime
    created_by: str | None
    expires_at: datetime | None
    used_at: datetime | None
    revoked_at: datetime | None

    @classmethod
    def from_record(cls, record: TokenRecord, **made: str) -> Self:
        """The body of a token, with its text if it was just made."""
        over = record.expires_at is not None and record.expires_at <= datetime.now(UTC)
        state = TokenState.EXPIRED if over else TokenState.VALID
        if record.revoked_at:
            state = TokenState.REVOKED
        return cls.of(record, state=state, **made)


class TokenMade(TokenOut):
    """A token just made: the one answer that has the token itself."""

    token: str


class TokenList(BaseModel):
    """Tokens, oldest first."""

    items: list[TokenOut]


router = APIRouter(prefix="/tokens", tags=["access"])


@router.post("", status_code=201)
def create_token(body: TokenBody, session: WriteDep, response: Response) -> TokenMade:
    """Create a token.

    Its value is in this answer only.
    """
    spec = TokenSpec(**body.model_dump())
    made = tokens.make_token(session, spec, name_in(session, None))
    response.headers["Location"] = "/tokens"
    return TokenMade.from_record(made.record, token=made.text)


@router.get("")
def list_tokens(session: ReadDep) -> TokenList:
    """List the tokens, oldest first, including revoked ones."""
    return TokenList(items=[TokenOut.from_record(record) for record in access.every(session)])


@router.delete("/{token_id}", status_code=204)
def revoke_token(token_id: str, session: WriteDep) -> None:
    """Revoke a token.

    Pages that logged in with it are logged out.
    """
    tokens.revoke_token(session, token_id, name_in(session, None))
