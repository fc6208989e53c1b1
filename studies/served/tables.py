"""The tables of `python -m studies protocol`, in Markdown."""

from collections.abc import Iterable, Sequence

import numpy as np

from models.assessment import CameraState
from models.pose.config import MOVED_PRIOR
from models.reasons import TracksCode
from studies.faults.catalogue import FAULTS
from studies.lines_file import Heading
from studies.pages import markers
from studies.served.figures import Figures, ParameterFigures, figures_of
from studies.served.outcomes import ServedOutcome
from studies.served.replays import ReplayOutcome
from studies.served.tasks import ALONE, FAR_DEG, FEW, MOVES, CaseId, CaseResult, Table

BETWEEN = markers("protocol", "python -m studies protocol --write")
_KNOCKS = {
    "still": "still",
    "knock": "tilt, roll, height",
    "pan": "all four",
    "tilt-alone": "tilt alone",
    "roll-alone": "roll alone",
    "height-alone": "height alone",
    "pan-alone": "pan alone",
}
_MOVES = {
    "still": "still",
    "tilt-2": "tilt by 2 deg",
    "roll-2": "roll by 2 deg",
    "pan-2": "pan by 2 deg",
    "pan": "all four",
}
_SHOWN = (
    "whole rotation, deg",
    "height",
    "tilt, roll, pan, deg",
    "covers: tilt, roll, height, pan",
    "identifiable",
    "beyond 5 sd",
    "cut",
)


def all_tables(heading: Heading, found: Iterable[CaseResult]) -> str:
    """Every table that there is something for, under a line that says whence."""
    rows = sorted(found, key=lambda each: _place(each.case_id))
    seeds = sorted({each.case_id.seed for each in rows})
    batches = sorted({each.case_id.batch for each in rows})
    tables = [
        f"{len(rows)} cases and replays, seeds {_listed(seeds)}, in batches of {_listed(batches)}; "
        f"begun {heading.begun}, code {heading.code}, {heading.cores} cores of "
        f"{heading.processor}. Medians (90th percentiles); pan is the heading."
    ]
    cases = [(e.case_id, e.outcome) for e in rows if isinstance(e.outcome, ServedOutcome)]
    replays = [(e.case_id, e.outcome) for e in rows if isinstance(e.outcome, ReplayOutcome)]
    if any(case_id.table in _WORDS for case_id, _ in cases):
        tables += [_knock_table(cases), _scene_table(cases)]
    if any(case_id.table == Table.FAULTS for case_id, _ in cases):
        tables.append(_fault_table(cases))
    if replays:
        tables.append(_replay_table(replays))
    few = [(a, o) for a, o in cases if a.table == Table.FEW]
    if few:
        tables.append(_few_table(few))
    far = [(a, o) for a, o in cases if a.table == Table.FAR]
    if far:
        tables.append(_far_table(far))
    if any(a.table == Table.NAMES for a, _ in cases):
        tables.append(_name_table([(a, o) for a, o in cases if a.table in _NAMED]))
    judged = [(a, o) for a, o in cases if a.table not in _FAULTY and o.moved is not None]
    if judged:
        tables.append(_reliability_table(judged))
    return "\n".join(f"{each.rstrip()}\n" for each in tables)


def _place(case_id: CaseId) -> tuple[int, str, int]:
    """The place of a case, of whichever process came first; those of one task keep their order."""
    return list(Table).index(case_id.table), case_id.scene, case_id.reference or 0


_Cases = Sequence[tuple[CaseId, ServedOutcome]]


def _knock_table(cases: _Cases) -> str:
    """Over all scenes, by what was moved; the slopes, too."""
    lines = _head("moved", "n", *_SHOWN, "slope: tilt, roll, height, pan")
    for table, words in _WORDS.items():
        for size in _sizes(cases, table):
            for knock, name in _KNOCKS.items():
                own = [
                    o
                    for a, o in cases
                    if a.table == table and a.knock == knock and _size(a) == size
                ]
                if own:
                    figures = figures_of(own)
                    title = f"{name}; {words}{_of_size(size)}"
                    lines.append(_row(title, figures.cases, *_cells(figures), _slopes(figures)))
    return "**By what was moved**, over all scenes:\n\n" + "\n".join(lines)


def _scene_table(cases: _Cases) -> str:
    lines = _head("scene (tracks: reference, after)", "moved", "n", *_SHOWN)
    scenes = dict.fromkeys((a.scene, _size(a)) for a, _ in cases if a.table == Table.TIME)
    kinds = {"still": ("still",), "moved, no pan": _WITHOUT_PAN, "moved, pan": _WITH_PAN}
    for scene, size in scenes:
        for kind, knocks in kinds.items():
            for table, words in ((Table.TIME, "later"), (Table.PEOPLE, "random")):
                own = [
                    o
                    for a, o in cases
                    if (a.scene, _size(a)) == (scene, size)
                    and a.table == table
                    and a.knock in knocks
                ]
                if own:
                    figures = figures_of(own)
                    title = f"{scene} ({figures.reference_tracks:.0f}, {figures.seen_tracks:.0f})"
                    lines.append(_row(title, f"{kind}; {words}", figures.cases, *_cells(figures)))
    return "**By scene**:\n\n" + "\n".join(lines)


_WORDS = {
    Table.TIME: "later people",
    Table.PEOPLE: "random people",
    Table.MIDWAY: "after half of them",
}
_WITHOUT_PAN = ("knock", "tilt-alone", "roll-alone", "height-alone")
_WITH_PAN = ("pan", "pan-alone")
assert set(ALONE) <= {*_WITHOUT_PAN, *_WITH_PAN}


def _fault_table(cases: _Cases) -> str:
    own = [(a, o) for a, o in cases if a.table == Table.FAULTS]
    scenes = dict.fromkeys(a.scene for a, _ in own)
    lines = _head("fault", "moved", "n", *_SHOWN, "covered or declared")
    for fault in ("", *FAULTS):
        for knock in ("still", "pan"):
            some = [o for a, o in own if a.fault == fault and a.knock == knock]
            if some:
                figures = figures_of(some)
                name = _fault_name(fault) if fault else "none"
                lines.append(
                    _row(
                        name,
                        _KNOCKS[knock],
                        figures.cases,
                        *_cells(figures),
                        f"{figures.sound:.0%}",
                    )
                )
    return f"**Faults**, later people of {', '.join(scenes)}:\n\n" + "\n".join(lines)


def _replay_table(replays: Sequence[tuple[CaseId, ReplayOutcome]]) -> str:
    lines = _head(
        "camera", "moved", "seed", "reference tracks", "still: tracks", "map in use",
        "“paths have changed”", "cuts", "alarm after", "covers: tilt, roll, height, pan",
        "worst, sd", "moved: tracks", "alarm after", "map in use",
        "250 tracks on: error (sd) of tilt, roll, pan, deg",
    )  # fmt: skip
    order = {move: place for place, move in enumerate(MOVES)}
    for case_id, outcome in sorted(
        replays, key=lambda each: (each[0].scene, order[each[0].knock], each[0].seed)
    ):
        before, after = outcome.before, outcome.after
        cells = [
            case_id.scene, _MOVES[case_id.knock], case_id.seed, outcome.reference_tracks,
            before.tracks,
            f"{before.mapped:.0%}", f"{before.paths_changed:.0%}", before.cuts,
            _after(before.alarm_after),
            ", ".join(
                "-" if not n else f"{100 * c / n:.0f}"
                for c, n in zip(before.covered, before.identifiable, strict=True)
            ),
            f"{before.worst_sd:.1f}",
        ]  # fmt: skip
        if after is None:
            cells += ["", "", "", ""]
        else:
            cells += [after.tracks, _after(after.alarm_after), f"{after.mapped:.0%}"]
            cells.append(
                "too few came"
                if outcome.measured is None
                else ", ".join(
                    f"{n.error:+.2f} ({n.sd:.2f})" if n.identifiable else "not identifiable"
                    for n in (outcome.measured[0], outcome.measured[1], outcome.measured[3])
                )
            )
        lines.append(_row(*cells))
    return "**Long recordings in their order**, a map that never grows:\n\n" + "\n".join(lines)


def _few_table(cases: _Cases) -> str:
    """Windows of few tracks: what is served, and what is said."""
    lines = _head("tracks", "moved", "n", *_SHOWN[:4], "worst, sd", *_STATES)
    for size in FEW:
        for knock in dict.fromkeys(a.knock for a, _ in cases):
            own = [o for a, o in cases if (a.seen, a.knock) == (size, knock)]
            if own:
                figures = figures_of(own)
                worst = max(each.worst_sd or 0.0 for each in figures.parameters)
                lines.append(
                    _row(
                        size,
                        _KNOCKS[knock],
                        figures.cases,
                        *_cells(figures)[:4],
                        f"{worst:.1f}",
                        *_states(own),
                    )
                )
    return "**Few tracks**, later people:\n\n" + "\n".join(lines)


def _far_table(cases: _Cases) -> str:
    """Far pans after which 30 people came: what is said, and how far off the heading is."""
    lines = _head("pan, deg", "n", *_STATES, "told: heading off, deg, median (p90, worst)")
    enough = [(a, o) for a, o in cases if o.used_tracks >= _ENOUGH]
    for size in FAR_DEG:
        own = [o for a, o in enough if abs(int(a.knock.removeprefix("pan"))) == size]
        if own:
            told = [o for o in own if o.state == "drifting" and o.parameters[3].identifiable]
            off = np.abs([o.parameters[3].error for o in told])
            cell = "-"
            if told:
                cell = f"{np.median(off):.1f} ({np.quantile(off, 0.9):.1f}, {off.max():.0f})"
            lines.append(_row(f"±{size}", len(own), *_states(own), cell))
    return f"**Far pans**, by {_ENOUGH} people and more:\n\n" + "\n".join(lines)


def _name_table(cases: _Cases) -> str:
    """The names that changes get: alerts by the pose alone, and states without one."""
    rows: dict[str, list[ServedOutcome]] = {}
    rights: dict[str, str] = {}
    for a, o in cases:
        title, right_name = _KNOCKS.get(a.knock, "pan, far"), "-" if a.knock == "still" else "drift"
        if a.fault:
            title, right_name = _fault_name(a.fault), _RIGHT_NAMES.get(a.fault, "-")
        rows.setdefault(title, []).append(o)
        rights[title] = right_name
    lines = _head("changed", "n", "name", *_NAMES)
    right, told, moved, other = 0, 0, 0, 0
    for title, own in rows.items():
        said = [_name(o) for o in own]
        lines.append(_row(title, len(own), rights[title], *(said.count(name) for name in _NAMES)))
        if (name := rights[title]) != "-":
            right += said.count(name)
            told += sum(said.count(alert) for alert in _ALERTS)
        if name == "drift":
            moved += len(own)
            other += sum(said.count(name) for name in _CAUSES.values())
    words = (
        f"The right name in {right} of {told} that are told of and have one; "
        f"the clock's or the lens's in {other} of {moved} that moved."
    )
    return f"**Names**, by the pose alone. {words}\n\n" + "\n".join(lines)


_CAUSES: dict[str, str] = {TracksCode.SCALE_CHANGED: "clock", TracksCode.LENS_CHANGED: "lens"}
_ALERTS = ("drift", *_CAUSES.values(), "unsure")
_NAMES = (*_ALERTS, "suspected", "ok", "learning")
_NAMED = (Table.TIME, Table.FAR, Table.NAMES)
_FAULTY = (Table.FAULTS, Table.NAMES)
_RIGHT_NAMES = {
    "slow-clock-later": "clock",
    "fast-clock-later": "clock",
    "zoom-later": "lens",
    "other-paths-later": "unsure",
}


def _fault_name(fault: str) -> str:
    return f"{fault} ({FAULTS[fault].words})"


def _name(outcome: ServedOutcome) -> str:
    """The alert of an outcome, or the state without one."""
    if outcome.state == CameraState.DRIFTING:
        return _CAUSES.get(outcome.cause, "drift")
    return outcome.state or CameraState.LEARNING


def _reliability_table(cases: _Cases) -> str:
    """How many had moved, by how likely that was said to be; shares as if 2 of 10 had moved.

    Where few that had not were to be expected, none of them says little.
    """
    lines = _head(
        "moved", "cases that had", "had not", "would not, as said", "share, weighed", "said"
    )
    said = np.array([o.moved for _, o in cases], dtype=np.float64)
    moved = np.array([a.knock != "still" for a, _ in cases])
    still_weight = (1 - MOVED_PRIOR) / max((~moved).sum(), 1)
    weights = np.where(moved, MOVED_PRIOR / max(moved.sum(), 1), still_weight)
    for tenth in range(10):
        own = np.minimum((10 * said).astype(int), 9) == tenth
        if own.any():
            whole = weights[own].sum()
            share = f"{(weights * moved)[own].sum() / whole:.2f}"
            mean = (weights * said)[own].sum() / whole
            stills = (weights * moved)[own].sum() * (1 - mean) / mean / still_weight
            lines.append(
                _row(
                    f"{tenth / 10:.1f} to {(tenth + 1) / 10:.1f}",
                    int((own & moved).sum()),
                    int((own & ~moved).sum()),
                    f"{stills:.1f}",
                    share,
                    f"{mean:.2f}",
                )
            )
    return "**Reliability** of `moved`, by the pose alone:\n\n" + "\n".join(lines)


_STATES = tuple(CameraState)
_ENOUGH = 30  # people


def _states(outcomes: Sequence[ServedOutcome]) -> list[int]:
    """How many are in each state; what could not be estimated is still `learning`."""
    said = [outcome.state or CameraState.LEARNING for outcome in outcomes]
    return [said.count(state) for state in _STATES]


def _cells(figures: Figures) -> list[str]:
    tilt, roll, height, pan = figures.parameters
    errors = ", ".join(_or_dash(each.error, "{:.2f}") for each in (tilt, roll, pan))
    every = (tilt, roll, height, pan)
    least = min(each.identifiable for each in every)
    return [
        f"{figures.rotation_deg:.2f} ({figures.rotation_p90_deg:.1f})",
        f"{100 * figures.height_error:.1f} % ({100 * figures.height_error_p90:.0f})",
        errors,
        ", ".join(_or_dash(_percent(each), "{:.0f}") for each in every) + " %",
        "all" if least == 1 else ", ".join(f"{each.identifiable:.0%}" for each in every),
        str(figures.beyond),
        f"{figures.cut:.0%}",
    ]


def _percent(parameter: ParameterFigures) -> float | None:
    return None if parameter.covered is None else 100 * parameter.covered


def _slopes(figures: Figures) -> str:
    return ", ".join(_or_dash(each.slope, "{:.2f}") for each in figures.parameters)


def _or_dash(value: float | None, form: str) -> str:
    return "-" if value is None else form.format(value)


def _after(tracks: int | None) -> str:
    return "none" if tracks is None else str(tracks)


_Size = tuple[int | None, int | None]


def _size(case_id: CaseId) -> _Size:
    return case_id.reference, case_id.seen if case_id.reference is not None else None


def _sizes(cases: _Cases, table: Table) -> list[_Size]:
    found = {_size(case_id) for case_id, _ in cases if case_id.table == table}
    return sorted(found, key=lambda size: size[0] or 0)


def _of_size(size: _Size) -> str:
    return "" if size[0] is None else f", {size[1]} after {size[0]}"


def _listed(values: Sequence[int]) -> str:
    return ", ".join(map(str, values))


def _head(*names: str) -> list[str]:
    return [_row(*names), _row(*("---" for _ in names))]


def _row(*cells: object) -> str:
    return "| " + " | ".join(str(cell) for cell in cells) + " |"
