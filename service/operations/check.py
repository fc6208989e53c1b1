"""A data directory looked over: what is wrong in it, and what is merely left over."""

import shutil
import stat
from collections.abc import Iterator
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from models.regression.recipe import unused_weights, weights_path
from service.data_dir import (
    StartError,
    held_alone,
    megabytes,
    require_stopped,
    running_in,
    strangers_in,
)
from service.job_queue import ENGINE_TABLES, JOBS_FORM
from service.notifications.keys import require_openable, sealer_of
from service.operations.backup import hash_file
from service.operations.restore import READY
from service.settings import Settings
from service.store.engines import files
from service.store.engines.failures import telling_of_database
from service.store.engines.revisions import known_revisions, require_known
from service.store.engines.schemas import schema_faults

_LEAST_FREE = 200e6


class Verdict(StrEnum):
    """Verdicts on one thing."""

    OK = "ok"
    NOTE = "note"
    FAULT = "fault"


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that was looked at."""

    what: str
    verdict: Verdict
    detail: str


def check_data_dir(settings: Settings) -> list[Finding]:
    """Everything that was looked at; nothing is changed, and a service may run meanwhile.

    Raises:
        StartError: there is no data directory.
    """
    folder, path = settings.data_dir, settings.database_path
    if not path.is_file() or not path.stat().st_size:
        raise StartError(f"check: {folder} holds no database; name another by --data-dir")
    findings = [_in_use(folder)]
    try:
        with telling_of_database(path):
            findings += _database(path)
            findings += _weights(settings)
            findings += [_key(settings, path)]
    except StartError as error:
        findings.append(Finding(what="database", verdict=Verdict.FAULT, detail=str(error)))
    return [*findings, _modes(folder), _space(settings), _left_over(folder)]


def repair_weights(settings: Settings) -> int:
    """Delete models whose weights are missing or broken, with those files; returns how many.

    Their cameras are trained anew.

    Raises:
        StartError: something uses the data directory.
    """
    with held_alone(settings.data_dir), telling_of_database(settings.database_path):
        require_stopped(settings.data_dir)
        broken = _broken_models(settings)
        files.drop_models(settings.database_path, list(broken))
        for digest in set(broken.values()):
            weights_path(settings.weights_dir, digest).unlink(missing_ok=True)
    return len(broken)


def _in_use(folder: Path) -> Finding:
    users = running_in(folder)
    return _noted("use", "", f"in use by {', '.join(users)}" if users else "nothing uses it")


def _database(path: Path) -> Iterator[Finding]:
    found = files.faults(path)
    yield _finding("integrity", found[:1], f"{path.name}, {megabytes(files.size(path))}")
    broken = [f"{rows} rows of {table}" for table, rows in files.broken_references(path).items()]
    yield _finding("references", broken, "every row that another names is there")
    revision, newest = files.revision(path), known_revisions()[0]
    try:
        require_known(revision, path.name)
        wrong = schema_faults(path)
        old = "" if revision == newest else f"{revision}: the next start migrates it"
        yield _finding("schema", wrong, newest) if wrong else _noted("schema", old, newest)
    except StartError as error:
        yield Finding(what="schema", verdict=Verdict.FAULT, detail=str(error))
    yield _finding("programs", files.programs(path), "no trigger or view but ours", "not ours: ")
    missing = sorted(set(ENGINE_TABLES) - files.tables(path))
    if len(missing) == len(ENGINE_TABLES):
        yield _noted("job engine", "no tables; the next start makes them", "")
    elif missing:
        yield _finding("job engine", missing, "", "missing: ")
    else:
        pickled = files.jobs_but(path, JOBS_FORM)
        said = f"{pickled} jobs as pickles, which nobody reads; the next start deletes them"
        yield _noted("job engine", said if pickled else "", "its tables are there")


def _weights(settings: Settings) -> Iterator[Finding]:
    named = files.weights_of_models(settings.database_path)
    broken = _broken_models(settings)
    yield _finding(
        "weights",
        [f"model {model_id} has none or broken ones" for model_id in broken],
        f"{len(named)} models, each has its weights",
    )
    unused = unused_weights(settings.weights_dir, named.values())
    detail = f"{len(unused)} files that no model names; retention deletes them"
    yield _noted("unused weights", detail if unused else "", "none")


def _broken_models(settings: Settings) -> dict[str, str]:
    """Models whose weights are missing or not what their name says, with their hashes."""
    named = files.weights_of_models(settings.database_path)
    sound = {
        digest
        for digest in set(named.values())
        if (path := weights_path(settings.weights_dir, digest)).is_file()
        and hash_file(path).sha256 == digest
    }
    return {model_id: digest for model_id, digest in named.items() if digest not in sound}


def _key(settings: Settings, path: Path) -> Finding:
    secrets = files.sealed_secrets(path)
    try:
        if secrets:
            require_openable(sealer_of(settings), secrets)
    except StartError as error:
        return Finding(what="key", verdict=Verdict.FAULT, detail=str(error))
    return _noted("key", "", f"opens {len(secrets)} secrets")


def _modes(folder: Path) -> Finding:
    wide = [path.name for path in (folder, *folder.rglob("*")) if _is_wide(path)]
    detail = f"others may read {', '.join(wide[:5])}; the next start changes what is ours"
    return _noted("modes", detail if wide else "", "all is its user's alone")


def _is_wide(path: Path) -> bool:
    try:
        mode = path.stat(follow_symlinks=False).st_mode
    except FileNotFoundError:  # a service that runs deletes files meanwhile
        return False
    return not stat.S_ISLNK(mode) and bool(mode & 0o077)


def _space(settings: Settings) -> Finding:
    free = shutil.disk_usage(settings.data_dir).free
    wanted = max(_LEAST_FREE, float(files.size(settings.database_path)))
    detail = f"{megabytes(free)} free"
    few = f"{detail}; a migration or backup needs about {megabytes(int(wanted))}"
    return _noted("space", few if free < wanted else "", detail)


def _left_over(folder: Path) -> Finding:
    found = sorted(
        path.name
        for pattern in ("restoring-*", "replaced-*", "copies/*.partial*")
        for path in folder.glob(pattern)
    )
    if (folder / READY).exists():
        return _noted("left over", "a restore was cut off; the next start ends it", "")
    found += strangers_in(folder)
    return _noted("left over", f"not in use: {', '.join(found[:5])}" if found else "", "nothing")


def _noted(what: str, note: str, well: str) -> Finding:
    return Finding(what=what, verdict=Verdict.NOTE if note else Verdict.OK, detail=note or well)


def _finding(what: str, wrong: list[str], well: str, before: str = "") -> Finding:
    if not wrong:
        return _noted(what, "", well)
    more = f" and {len(wrong) - 3} more" if len(wrong) > 3 else ""
    return Finding(what=what, verdict=Verdict.FAULT, detail=f"{before}{'; '.join(wrong[:3])}{more}")
