"""`/tokens`, and the page of them: make, list, revoke."""

from datetime import UTC, datetime, timedelta

from fastapi import APIRouter, Request, Response
from fastapi.responses import HTMLResponse, RedirectResponse
from sqlalchemy.orm import Session

from service.access import tokens
from service.access.tokens import MadeToken, TokenSpec
from service.api.middleware.dependencies import ActorDep, ReadDep, StateDep, WriteDep, name_of
from service.api.middleware.hosts import auth_on
from service.api.middleware.pages import render
from service.api.tokens_schemas import TokenBody, TokenList, TokenMade, TokenOut
from service.errors import FieldError, MalformedError
from service.pages.routes.forms import Form, FormDep

router = APIRouter(tags=["access"])

_MOST_DAYS = 36_500


@router.post("/tokens", status_code=201)
def create(body: TokenBody, session: WriteDep, actor: ActorDep, response: Response) -> TokenMade:
    """Make a token. It is in this answer and in no other."""
    made = tokens.make_token(session, body.to_spec(), name_of(actor))
    response.headers["Location"] = "/tokens"
    response.headers["Cache-Control"] = "no-store"
    return TokenMade.from_value(made)


@router.get("/tokens")
def list_all(session: ReadDep) -> TokenList:
    """Tokens, oldest first; those that were revoked, too."""
    return TokenList(items=_every(session))


@router.delete("/tokens/{token_id}", status_code=204)
def revoke(token_id: str, session: WriteDep, actor: ActorDep) -> None:
    """Let a token in no more; pages that logged in with it are logged out."""
    tokens.revoke_token(session, token_id, name_of(actor))


@router.get("/ui/tokens", include_in_schema=False)
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Tokens, and a form for another one."""
    return _page(request, auth_on(state.settings), session)


@router.post("/ui/tokens", include_in_schema=False)
def create_by_form(
    request: Request, form: FormDep, state: StateDep, session: WriteDep, actor: ActorDep
) -> HTMLResponse:
    """Make a token by the form, and show it this once."""
    try:
        made = tokens.make_token(session, _spec(form), name_of(actor))
    except MalformedError as error:
        session.rollback()
        return _page(request, auth_on(state.settings), session, typed=form, wrong=error.errors)
    return _page(request, auth_on(state.settings), session, made=made)


@router.post("/ui/tokens/{token_id}/revoke", include_in_schema=False)
def revoke_by_form(token_id: str, session: WriteDep, actor: ActorDep) -> RedirectResponse:
    """Revoke a token by its button."""
    tokens.revoke_token(session, token_id, name_of(actor))
    return RedirectResponse("/ui/tokens", status_code=303)


def _every(session: Session) -> list[TokenOut]:
    return [TokenOut.from_record(record) for record in tokens.list_tokens(session)]


def _page(
    request: Request,
    access_on: bool,
    session: Session,
    *,
    made: MadeToken | None = None,
    typed: Form | None = None,
    wrong: tuple[FieldError, ...] = (),
) -> HTMLResponse:
    return render(
        request,
        "tokens.html",
        422 if wrong else 200,
        tokens=_every(session),
        made=made,
        typed=typed or Form(),
        wrong={error.pointer[1:]: error.reason for error in wrong},
        access_on=access_on,
    )


def _spec(form: Form) -> TokenSpec:
    """The token that was typed, as the use case takes it.

    Raises:
        MalformedError: the days are no number.
    """
    cameras = tuple(form.one("cameras").replace(",", " ").split())
    days = form.one("days")
    expires_at = None
    if days:
        if not days.isascii() or not days.isdigit() or not 0 < int(days) <= _MOST_DAYS:
            reason = f"a number of days from 1 to {_MOST_DAYS} is needed, got {days!r:.20}"
            field = FieldError(pointer="/expires_at", reason=reason)
            raise MalformedError(f"expires_at: {reason}", (field,))
        expires_at = datetime.now(UTC) + timedelta(days=int(days))
    return TokenSpec(
        name=form.one("name"),
        scopes=tuple(form.get("scopes", [])),
        cameras=cameras or None,
        expires_at=expires_at,
    )
