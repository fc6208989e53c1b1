"""Pages of `docs/reference/` that `python -m tests.reference --write` makes."""

from collections.abc import Callable
from pathlib import Path

from tests.reference.http import http_page
from tests.reference.settings import settings_page
from tests.reference.states import states_page

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
_MADE = "<!-- Made by `python -m tests.reference --write`. -->\n\n"


def _marked(page: Callable[[], str]) -> Callable[[], str]:
    return lambda: _MADE + page().rstrip() + "\n"


PAGES: dict[str, Callable[[], str]] = {
    "http.md": _marked(http_page),
    "settings.md": _marked(settings_page),
    "states.md": _marked(states_page),
}
