"""Pages of `docs/reference/`, and examples, that `python -m tests.reference --write` makes."""

from collections.abc import Callable
from pathlib import Path

from tests.reference.examples import EXAMPLES, examples_file
from tests.reference.glossary import glossary_page
from tests.reference.http import http_page
from tests.reference.settings import settings_page
from tests.reference.states import states_page

REFERENCE = Path(__file__).parents[2] / "docs" / "reference"
_MADE = "<!-- Made by `python -m tests.reference --write`. -->\n\n"


def _marked(page: Callable[[], str]) -> Callable[[], str]:
    return lambda: _MADE + page().rstrip() + "\n"


FILES: dict[Path, Callable[[], str]] = {
    EXAMPLES: examples_file,
    REFERENCE / "glossary.md": glossary_page,
    REFERENCE / "http.md": _marked(http_page),
    REFERENCE / "settings.md": _marked(settings_page),
    REFERENCE / "states.md": _marked(states_page),
}
