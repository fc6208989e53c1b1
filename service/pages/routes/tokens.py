"""`/ui/tokens`: the page of tokens, to make, list and revoke them without a script."""

from datetime import UTC, datetime, timedelta

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, RedirectResponse
from sqlalchemy.orm import Session

from service.access import tokens
from service.access.tokens import MadeToken, TokenSpec
from service.api.middleware.dependencies import ReadDep, StateDep, WriteDep
from service.api.middleware.hosts import auth_on
from service.api.middleware.pages import render
from service.api.tokens import list_all
from service.errors import FieldError, MalformedError
from service.pages.routes.forms import Form, FormDep
from service.store.access import name_in

router = APIRouter(include_in_schema=False)

_MOST_DAYS = 36_500


@router.get("/ui/tokens")
def show(request: Request, state: StateDep, session: ReadDep) -> HTMLResponse:
    """Tokens, and a form for another one."""
    return _page(request, auth_on(state.settings), session)


@router.post("/ui/tokens")
def create(request: Request, form: FormDep, state: StateDep, session: WriteDep) -> HTMLResponse:
    """Make a token by the form, and show it this once."""
    try:
        made = tokens.make_token(session, _spec(form), name_in(session, None))
    except MalformedError as error:
        session.rollback()
        return _page(request, auth_on(state.settings), session, typed=form, wrong=error.errors)
    return _page(request, auth_on(state.settings), session, made=made)


@router.post("/ui/tokens/{token_id}/revoke")
def revoke(token_id: str, session: WriteDep) -> RedirectResponse:
    """Revoke a token by its button."""
    tokens.revoke_token(session, token_id, name_in(session, None))
    return RedirectResponse("/ui/tokens", status_code=303)


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
        tokens=list_all(session).items,
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
            raise MalformedError.of_field("expires_at", reason)
        expires_at = datetime.now(UTC) + timedelta(days=int(days))
    return TokenSpec(
        name=form.one("name"),
        scopes=tuple(form.get("scopes", [])),
        cameras=cameras or None,
        expires_at=expires_at,
    )
