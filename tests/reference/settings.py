"""The page of settings: a row for each field."""

from typing import Any

from service.settings import Settings

_HEAD = """\
# Settings

Each is an environment variable, `SUREFOOT_` and its name, of `serve`, `worker` and the other
commands. A wrong value is told at the start, with exit code 2. Booleans are `true` and `false`.
The common ones are flags of `surefoot serve`, too.

| Setting | Default | Meaning |
|---|---|---|
"""


def settings_page() -> str:
    """The settings: name, default, meaning."""
    return _HEAD + "".join(f"{_row(name)}\n" for name in Settings.model_fields)


def _row(name: str) -> str:
    field = Settings.model_fields[name]
    described = (field.description or "").replace("|", "\\|")
    default = "by the machine" if field.default_factory else _words(field.default)
    return f"| `{name.upper()}` | {default} | {described} |"


def _words(value: Any) -> str:
    if value is None or value == "":
        return "unset"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    return f"`{value:g}`" if isinstance(value, float) else f"`{value}`"
