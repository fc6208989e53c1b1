"""Outcomes of the protocol in a file, as they come."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from models.errors import ShapeError
from studies.lines_file import LinesFile
from studies.served.outcomes import ParameterOutcome, ServedOutcome
from studies.served.replays import ReplayOutcome, Stretch
from studies.served.tasks import Asked, Found, Table


class OutcomeFile:
    """The outcomes of a study, by what was asked.

    Raises:
        ShapeError: the file was begun by other code, or a line in it is broken.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = LinesFile(path)
        self.heading = self._file.heading
        try:
            found = [_found(row) for row in self._file.rows]
        except (ValueError, KeyError, TypeError) as error:
            raise ShapeError(f"{path}: no file of outcomes: {error!r}") from error
        self.found: dict[Asked, Found] = {each.asked: each for each in found}

    def add(self, found: Iterable[Found]) -> None:
        """Keep some: once this returns they are in the file. What failed is asked again."""
        kept = [each for each in found if not each.failure]
        self.found |= {each.asked: each for each in kept}
        self._file.add(asdict(each) for each in kept)


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
