"""`/ui/language`: the language of pages, as somebody chooses it in their head."""

import contextlib
from urllib.parse import urlsplit

from fastapi import APIRouter, Request
from fastapi.responses import RedirectResponse

from service.api.middleware.dependencies import StateDep
from service.api.middleware.language import COOKIE
from service.pages.access import FormDep, ours, over_https
from service.wording.language import LANGUAGES

_A_YEAR_S = 365 * 86_400

router = APIRouter(include_in_schema=False)


@router.post("/ui/language")
def choose(request: Request, form: FormDep, state: StateDep) -> RedirectResponse:
    """Keep a language in this browser, and go back to the page that it was chosen on."""
    back = ""
    with contextlib.suppress(ValueError):  # of a header that is no URL
        here = urlsplit(request.headers.get("referer", ""))
        back = ours(here.path + (f"?{here.query}" if here.query else ""))
    answer = RedirectResponse(back or "/", status_code=303)
    language = form.one("language")
    if language in LANGUAGES:
        secure = over_https(request, state.settings)
        answer.set_cookie(COOKIE, language, max_age=_A_YEAR_S, samesite="lax", secure=secure)
    return answer
