"""Tables of studies in pages, between markers that say what made them."""

from pathlib import Path

from models.errors import ShapeError


def markers(name: str, command: str) -> tuple[str, str]:
    """The lines before and after what a command makes of a name."""
    return f"<!-- {name}: made by `{command}` -->\n", f"<!-- end of {name} -->\n"


def write_between(page: Path, between: tuple[str, str], text: str) -> None:
    """Put a text between a page's markers.

    Raises:
        ShapeError: the page lacks them.
    """
    begin, end = between
    whole = page.read_text()
    if whole.count(begin) != 1 or whole.count(end) != 1:
        raise ShapeError(f"{page}: {begin.strip()} and {end.strip()} are needed, once each")
    before, rest = whole.split(begin)
    page.write_text(before + begin + "\n" + text + "\n" + end + rest.split(end)[1])
