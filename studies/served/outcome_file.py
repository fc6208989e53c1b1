"""Outcomes of the protocol in a file, as they come."""

from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from models.errors import ShapeError
from studies.lines_file import LinesFile
from studies.served.outcomes import ParameterOutcome, ServedOutcome
from studies.served.replays import ReplayOutcome, Stretch
from studies.served.tasks import CaseId, CaseResult, Table


class OutcomeFile:
    """The outcomes of a study, by case.

    Raises:
        ShapeError: the file was begun by other code, or a line in it is broken.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._file = LinesFile(path)
        self.heading = self._file.heading
        try:
            found = [_result(row) for row in self._file.rows]
        except (ValueError, KeyError, TypeError) as error:
            raise ShapeError(f"{path}: no file of outcomes: {error!r}") from error
        self.found: dict[CaseId, CaseResult] = {each.case_id: each for each in found}

    def add(self, found: Iterable[CaseResult]) -> None:
        """Keep some: once this returns they are in the file. What failed is run again."""
        kept = [each for each in found if not each.failure]
        self.found |= {each.case_id: each for each in kept}
        self._file.add(_row(each) for each in kept)


def _row(result: CaseResult) -> dict[str, Any]:
    """Line of a result; `asked` is the case's name in files that are kept."""
    row = asdict(result)
    return {"asked": row.pop("case_id"), **row}


def _result(row: dict[str, Any]) -> CaseResult:
    case_id = CaseId(**{**row["asked"], "table": Table(row["asked"]["table"])})
    values = row["outcome"]
    if case_id.table == Table.REPLAYS:
        return CaseResult(case_id=case_id, outcome=_replay_outcome(values))
    return CaseResult(
        case_id=case_id,
        outcome=ServedOutcome(**{**values, "parameters": _parameters(values["parameters"])}),
    )


def _replay_outcome(values: dict[str, Any]) -> ReplayOutcome:
    before, after, measured = values["before"], values["after"], values["measured"]
    return ReplayOutcome(
        **{
            **values,
            "before": _stretch(before),
            "after": None if after is None else _stretch(after),
            "measured": None if measured is None else _parameters(measured),
        }
    )


def _stretch(values: dict[str, Any]) -> Stretch:
    counts = {name: tuple(values[name]) for name in ("identifiable", "covered")}
    return Stretch(**{**values, **counts})


def _parameters(values: Iterable[dict[str, Any]]) -> tuple[ParameterOutcome, ...]:
    return tuple(ParameterOutcome(**each) for each in values)
