"""Outcomes in a file, a line each as they come: a study that was ended goes on where it was."""

import hashlib
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
from models.evaluation.served.outcomes import ParameterOutcome, ServedOutcome
from models.evaluation.served.replays import ReplayOutcome, Stretch
from service.studies.served_tasks import Asked, Found, Table

_MODELS = Path(__file__).parent.parent.parent / "models"


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """The first line: by what code, when it was begun, and on what machine."""

    code: str
    begun: str
    processor: str
    cores: int


class OutcomeFile:
    """The outcomes of a study, in a file of JSON lines under a heading.

    Figures of two versions of the estimator are never mixed: the heading has a hash of its code.

    Raises:
        ShapeError: the file was begun by other code, or a line in it is broken.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.found: dict[Asked, Found] = {}
        if path.exists() and path.stat().st_size:
            self.heading = self._read()
        else:
            self.heading = _heading_now()
            self._append([asdict(self.heading)])

    def add(self, found: Iterable[Found]) -> None:
        """Keep some: once this returns they are in the file. What failed is asked again."""
        kept = [each for each in found if not each.failure]
        self.found |= {each.asked: each for each in kept}
        self._append([asdict(each) for each in kept])

    def _append(self, rows: Iterable[dict[str, Any]]) -> None:
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
            found = [_found(json.loads(line)) for line in lines]
        except (ValueError, KeyError, TypeError) as error:
            raise ShapeError(f"{self.path}: no file of outcomes: {error!r}") from error
        if heading.code != code_hash():
            raise ShapeError(
                f"{self.path}: begun {heading.begun} by other code of models/ "
                f"({heading.code}, now {code_hash()}); name another file, or remove it"
            )
        self.found = {each.asked: each for each in found}
        return heading


def code_hash() -> str:
    """Twelve digits that change with the code between tracks and pose, not with the studies."""
    digest = hashlib.sha256()
    for path in sorted(_MODELS.rglob("*.py")):
        place = path.relative_to(_MODELS)
        if place.parts[0] != "evaluation":
            digest.update(str(place).encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def _heading_now() -> Heading:
    return Heading(
        code=code_hash(),
        begun=datetime.now(UTC).date().isoformat(),
        processor=platform.processor() or platform.machine(),
        cores=multiprocessing.cpu_count(),
    )


def _found(row: dict[str, Any]) -> Found:
    asked = Asked(**{**row["asked"], "table": Table(row["asked"]["table"])})
    told = row["outcome"]
    if asked.table == Table.REPLAYS:
        return Found(asked=asked, outcome=_replay_outcome(told))
    return Found(
        asked=asked,
        outcome=ServedOutcome(**{**told, "parameters": _parameters(told["parameters"])}),
    )


def _replay_outcome(told: dict[str, Any]) -> ReplayOutcome:
    before, after, measured = told["before"], told["after"], told["measured"]
    return ReplayOutcome(
        **{
            **told,
            "before": _stretch(before),
            "after": None if after is None else _stretch(after),
            "measured": None if measured is None else _parameters(measured),
        }
    )


def _stretch(told: dict[str, Any]) -> Stretch:
    counts = {name: tuple(told[name]) for name in ("identifiable", "covered")}
    return Stretch(**{**told, **counts})


def _parameters(told: Iterable[dict[str, Any]]) -> tuple[ParameterOutcome, ...]:
    return tuple(ParameterOutcome(**each) for each in told)
