"""The catalogue of a language beside the texts of the code: `python -m tests.catalogue --write`."""

import io
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

from babel.messages.catalog import Catalog
from babel.messages.pofile import read_po, write_po

from service.wording.language import CATALOGUES, ENGLISH, LANGUAGES

ROOT = Path(__file__).parents[2]
FILES = {
    language: CATALOGUES / language / "LC_MESSAGES" / "surefoot.po"
    for language in LANGUAGES
    if language != ENGLISH
}
_EXTRACT = "extract -F pyproject.toml -k N_ -k _n:1,2 --add-location=file"
# Lines of a catalogue's head.
_OF_A_DAY = tuple(
    f'"{name}'.encode()
    for name in ("Project", "Report", "POT", "PO-", "Last", "Language-Team", "Generated")
)


@cache
def extracted() -> Catalog:
    """The texts as they stand in the code, by `[tool.babel]` of pyproject.toml."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "surefoot.pot"
        pybabel = [sys.executable, "-m", "babel.messages.frontend", "-q"]
        subprocess.run([*pybabel, *_EXTRACT.split(), "-o", path, "service"], cwd=ROOT, check=True)
        return read_po(io.BytesIO(path.read_bytes()))


def kept(language: str) -> Catalog:
    """The catalogue of a language."""
    return read_po(io.BytesIO(FILES[language].read_bytes()), language)


def renewed(language: str) -> bytes:
    """The file of a language with the texts of now: what is new in it has no words yet."""
    catalogue = kept(language)
    catalogue.update(extracted(), no_fuzzy_matching=True, update_creation_date=False)
    catalogue.obsolete.clear()
    return file_of(catalogue)


def file_of(catalogue: Catalog) -> bytes:
    """The file of a catalogue, of whose head nothing is kept that is of a day or a person."""
    file = io.BytesIO()
    write_po(file, catalogue, width=100, sort_output=True)
    lines = file.getvalue().splitlines(keepends=True)
    return b"".join(line for line in lines if not line.startswith(_OF_A_DAY))
