"""Table 1 as Markdown: a row for each variant on each scene, its seeds' spread beside its mean."""

import math
from collections.abc import Sequence
from statistics import mean

from studies.paper.part import (
    PAPERS_OWN,
    PaperCase,
    PaperPart,
    PaperResult,
    by_row,
    markdown,
    own_first,
)
from studies.paper.regressors import (
    AUTHORS_CODE,
    CONSTANT,
    DEFAULT,
    PAPER,
    SERVED,
    VARIANTS,
    made_by,
    run_case,
)

_PART = "regressors"
_SEEDS = (0, 1, 2)
_PUBLISHED = {"town_centre": "0.21 m, 2.16 deg"}
_ORDER = [CONSTANT, *VARIANTS, DEFAULT, SERVED]


def _cases(scenes: Sequence[str]) -> list[PaperCase]:
    """Cases, the quick first; what takes a quarter of an hour for each seed last."""
    left_open = [PAPERS_OWN] if PAPERS_OWN in scenes else []
    others = [scene for scene in scenes if scene not in left_open]
    rows: list[tuple[str, Sequence[str], Sequence[int]]]
    rows = [(variant, scenes, (0,)) for variant in (CONSTANT, SERVED)]
    rows.append((DEFAULT, scenes, _SEEDS))
    rows.append((AUTHORS_CODE, scenes, _SEEDS))
    own = [variant for variant in VARIANTS if variant != AUTHORS_CODE]
    own.sort(key=lambda variant: not variant.startswith(AUTHORS_CODE))
    rows += [(variant, left_open, _SEEDS) for variant in own]
    rows.append((PAPER, others, _SEEDS))
    return [
        PaperCase(part=_PART, scene=scene, variant=variant, seed=seed)
        for variant, on, seeds in rows
        for seed in seeds
        for scene in own_first(on)
    ]


def _table(results: Sequence[PaperResult]) -> str:
    groups = by_row(results)
    ordered = sorted(groups, key=lambda key: (key[0], _ORDER.index(key[1])))
    rows = [_row(*key, groups[key]) for key in ordered]
    header = [
        "scene",
        "what",
        "seeds",
        "centred: off m, deg",
        "published",
        "epoch by held-out walks",
        "epoch by the test set",
        "knocked: off %, deg",
        "slope of tilt, roll, height",
        "one held-out walk: off m, deg",
        "training, CPU-s",
    ]
    return markdown(header, rows)


def _row(scene: str, variant: str, found: Sequence[dict[str, float]]) -> list[str]:
    def figure(name: str, digits: int) -> str:
        values = [each[name] for each in found if name in each and math.isfinite(each[name])]
        if not values:
            return ""
        middle, least, most = (
            f"{round(value, digits) + 0.0:.{digits}f}"  # never minus nought
            for value in (mean(values), min(values), max(values))
        )
        return f"{middle} ({least} to {most})" if len(values) > 1 else middle

    def pair(prefix: str) -> str:
        both = [figure(f"{prefix}_height_m", 2), figure(f"{prefix}_deg", 2)]
        return ", ".join(both) if all(both) else ""

    share = mean(each["knocked_share"] for each in found)
    return [
        scene,
        variant,
        str(len(found)),
        pair("centred"),
        _PUBLISHED.get(scene, "") if variant == PAPER else "",
        pair("by_held_out"),
        pair("by_test"),
        f"{100 * share:.1f}, {figure('knocked_deg', 2)}",
        ", ".join(figure(f"slope_{name}", 2) or "none" for name in ("tilt", "roll", "height")),
        pair("held_out"),
        figure("training_cpu_s", 0),
    ]


REGRESSORS = PaperPart(
    says="table 1, theirs: regressors by recipe, a constant, and what is served",
    cases=_cases,
    run=run_case,
    made_by=made_by,
    table=_table,
)
