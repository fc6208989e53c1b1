"""`/docs`, `/ui/settings`, `/ui/glossary`: the API to try, what is set, what words mean."""

from dataclasses import dataclass
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from service.api.middleware.dependencies import StateDep
from service.api.middleware.pages import VIEWER_SCRIPT_URL, VIEWER_STYLE_URL, render
from service.settings import Settings
from service.wording.glossary import WORDS

_UNSET, _BY_MACHINE = "unset", "by the machine"


@dataclass(frozen=True, slots=True, kw_only=True)
class SettingRow:
    """A setting in words: its name, what it is and would be by itself, what it does.

    A secret is not told, only whether there is one.
    """

    name: str
    value: str
    default: str
    meaning: str

    @property
    def changed(self) -> bool:
        """True of one that somebody has set."""
        return self.value not in (self.default, _UNSET) and self.default != _BY_MACHINE


def setting_rows(settings: Settings | None = None) -> list[SettingRow]:
    """All settings, in their order; without values, those that they have by themselves."""
    rows = []
    for name, field in Settings.model_fields.items():
        default = _BY_MACHINE if field.default_factory else _said(field.default)
        value = default if settings is None else _said(getattr(settings, name))
        if not field.repr and value != _UNSET:
            value = "set, not shown"
        meaning = field.description or ""
        rows.append(SettingRow(name=name.upper(), value=value, default=default, meaning=meaning))
    return rows


def _said(value: Any) -> str:
    if value is None or value == "":
        return _UNSET
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:g}" if isinstance(value, float) else str(value)


router = APIRouter(include_in_schema=False)


@router.get("/docs")
def show_docs(request: Request) -> HTMLResponse:
    """Swagger UI over `/openapi.json`, without asking any other host."""
    return render(
        request,
        "api_docs.html",
        description_url=request.app.openapi_url,
        script_url=VIEWER_SCRIPT_URL,
        style_url=VIEWER_STYLE_URL,
    )


@router.get("/ui/settings")
def show_settings(request: Request, state: StateDep) -> HTMLResponse:
    """The settings of this process as they are."""
    return render(request, "settings.html", rows=setting_rows(state.settings))


@router.get("/ui/glossary")
def show_glossary(request: Request) -> HTMLResponse:
    """What the words of pages mean."""
    return render(request, "glossary.html", words=WORDS)
