"""The page of settings: a row for each field."""

from service.pages.reference import SettingRow, setting_rows

_HEAD = """\
# Settings

Each is an environment variable, `SUREFOOT_` and its name, of `serve`, `worker` and the other
commands. A wrong value is told at the start, with exit code 2. Booleans are `true` and `false`.
`serve` and `worker` log `variable_without_effect` for a name without the prefix or misspelled.
The common ones are flags of `surefoot serve`, too.

| Setting | Default | Meaning |
|---|---|---|
"""


def settings_page() -> str:
    """The settings: name, default, meaning."""
    return _HEAD + "".join(map(_row, setting_rows()))


def _row(row: SettingRow) -> str:
    words = row.default in ("unset", "by the machine")
    default = row.default if words else f"`{row.default}`"
    meaning = row.meaning.replace("|", "\\|")
    return f"| `{row.name}` | {default} | {meaning} |\n"
