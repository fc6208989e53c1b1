"""The table of settings in service/README.md: `python -m tests.settings_table --write` makes it."""

import sys
from pathlib import Path
from typing import Any

from service.settings import Settings

PAGE = Path(__file__).parent.parent / "service" / "README.md"
_BEGIN = "<!-- settings: made by `python -m tests.settings_table --write` -->\n"
_END = "<!-- end of settings -->\n"


def settings_table() -> str:
    """A row for each field of the settings: variable, default, meaning."""
    rows = ["| Setting | Default | What it is |", "|---|---|---|"]
    for name, field in Settings.model_fields.items():
        described = (field.description or "").replace("|", "\\|")
        default = "by the machine" if field.default_factory else _words(field.default)
        rows.append(f"| `{name.upper()}` | {default} | {described} |")
    return "\n".join(rows) + "\n"


def written_table() -> str:
    """The table that the page has now."""
    return PAGE.read_text().split(_BEGIN)[1].split(_END)[0]


def write_table() -> None:
    """Put the table of today's settings between the page's markers."""
    before, rest = PAGE.read_text().split(_BEGIN)
    PAGE.write_text(before + _BEGIN + settings_table() + _END + rest.split(_END)[1])


def _words(value: Any) -> str:
    if value is None or value == "":
        return "unset"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"


if __name__ == "__main__":
    if sys.argv[1:] == ["--write"]:
        write_table()
    else:
        sys.stdout.write(settings_table())
