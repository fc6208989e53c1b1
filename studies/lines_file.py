"""Rows of a study in a file, a line each as they come: what was ended goes on where it was."""

import json
import multiprocessing
import os
import platform
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from models.errors import ShapeError
from studies.code_hash import code_hash


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """The first line: by what code, when it was begun, and on what machine."""

    code: str
    begun: str
    processor: str
    cores: int


class LinesFile:
    """Rows in a file of JSON lines under a heading; `rows` are those that were found in it.

    Figures of two versions of the estimator are never mixed: the heading has a hash of its code.
    Where `rows_tell_code`, they are told apart by whoever reads the rows.

    Raises:
        ShapeError: the file was begun by other code, or a line in it is broken.
    """

    def __init__(self, path: Path, *, rows_tell_code: bool = False) -> None:
        self.path = path
        self._rows_tell_code = rows_tell_code
        self.rows: list[dict[str, Any]] = []
        if path.exists() and path.stat().st_size:
            self.heading = self._read()
        else:
            self.heading = _heading_now()
            self.add([asdict(self.heading)])

    def add(self, rows: Iterable[dict[str, Any]]) -> None:
        """Keep some: once this returns they are in the file."""
        with self.path.open("a") as file:
            file.writelines(json.dumps(row) + "\n" for row in rows)
            file.flush()
            os.fsync(file.fileno())

    def _read(self) -> Heading:
        text = self.path.read_text()
        whole = text[: text.rfind("\n") + 1]
        if len(whole) < len(text):  # a line was being written when the study was killed
            with self.path.open("r+") as file:
                file.truncate(len(whole.encode()))
        first, *lines = whole.splitlines() or [""]
        try:
            heading = Heading(**json.loads(first))
            self.rows = [json.loads(line) for line in lines]
        except (ValueError, TypeError) as error:
            raise ShapeError(f"{self.path}: no file of outcomes: {error!r}") from error
        if not self._rows_tell_code and heading.code != code_hash():
            raise ShapeError(
                f"{self.path}: begun {heading.begun} by other code of models/ "
                f"({heading.code}, now {code_hash()}); name another file, or remove it"
            )
        return heading


def _heading_now() -> Heading:
    return Heading(
        code=code_hash(),
        begun=datetime.now(UTC).date().isoformat(),
        processor=platform.processor() or platform.machine(),
        cores=multiprocessing.cpu_count(),
    )
