"""The words of the pages' glossary, within the page of all words, which is written by hand."""

from pathlib import Path

from service.wording.glossary import WORDS

_PAGE = Path(__file__).parents[2] / "docs" / "reference" / "glossary.md"
_BEGIN = "<!-- Made by `python -m tests.reference --write`, of service/wording/glossary.py. -->\n"
_END = "<!-- The end of what is made. -->\n"


def glossary_page() -> str:
    """The page as it stands, with the words that the service shows at `/ui/glossary`."""
    before, _, rest = _PAGE.read_text().partition(_BEGIN)
    after = rest.partition(_END)[2]
    tables = [
        f"\n**{title}**\n\n| Word | Meaning |\n|---|---|\n"
        + "".join(f"| {word} | {meaning} |\n" for word, meaning in words.items())
        for title, words in WORDS.items()
    ]
    return f"{before}{_BEGIN}{''.join(tables)}\n{_END}{after}"
