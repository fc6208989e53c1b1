"""The tables that `python -m studies evaluate` prints."""

from collections.abc import Sequence
from dataclasses import dataclass

from rich.table import Table

from studies.protocol.report import Overall, SceneFigures

TABLE_WIDTH = 110


@dataclass(frozen=True, slots=True, kw_only=True)
class Bar:
    """Floor and bar of a scene: two crude joint estimators' figures, what a pose must reach.

    In words: medians over 12 knocks of +-8 deg, angle and height. The first knows the site's speed,
    the second has its offset at the prior pose taken off.
    """

    site_speed: str
    offset: str
    bar: str


BARS = {
    "wildtrack-c1": Bar(site_speed="0.9 deg, 10 %", offset="0.7 deg, 9 %", bar="0.5 deg, 4 %"),
    "wildtrack-c3": Bar(site_speed="1.7 deg, 5 %", offset="1.8 deg, 3 %", bar="0.9 deg, 3 %"),
    "wildtrack-c6": Bar(site_speed="0.8 deg, 2 %", offset="0.8 deg, 4 %", bar="0.5 deg, 2 %"),
    "town-centre": Bar(site_speed="1.6 deg, 8 %", offset="2.3 deg, 9 %", bar="0.9 deg, 4 %"),
    "pets2009-s1l2-1-v001": Bar(
        site_speed="20 deg, 73 %", offset="4 deg, 12 %", bar="declared, covered"
    ),
    "pets2009-s2l1-v001-sort": Bar(
        site_speed="4.3 deg, 26 %", offset="6.5 deg, 11 %", bar="2 deg, 8 %, or declared"
    ),
    "meva-g336-school": Bar(site_speed="2.9 deg, 26 %", offset="1.6 deg, 10 %", bar="1.5 deg, 7 %"),
}


def scene_table(knock: str, seeds: int, figures: Sequence[SceneFigures]) -> Table:
    """Each estimator on each scene, under the floor and the bar where there are such."""
    table = Table(
        title=f"{knock}, {seeds} seeds: medians (90th percentiles)", title_justify="left"
    )  # fmt: skip
    table.add_column("scene (tracks)\n  estimator", no_wrap=True)
    for name in (
        "angle, deg", "tilt,\nroll", "head-\ning", "height, %",
        "90 %\ncovers", "de-\nclared", "drift-\ning", "s",
    ):  # fmt: skip
        table.add_column(name, justify="right", no_wrap=True)
    for scene in dict.fromkeys(f.scene_id for f in figures):
        own = [f for f in figures if f.scene_id == scene]
        table.add_section()
        table.add_row(f"{scene} ({own[0].tracks:.0f})", style="bold")
        if knock == "knock" and scene in BARS:
            bar = BARS[scene]
            for name, words in (
                ("floor: site speed", bar.site_speed),
                ("floor: offset", bar.offset),
                ("bar", bar.bar),
            ):
                angle, height, *declared = words.split(", ")
                row = f"  {name} ({declared[0]})" if declared else f"  {name}"
                table.add_row(row, angle.removesuffix(" deg"), "", "", height, style="dim")
        for f in own:
            table.add_row(
                f"  {f.estimator}",
                f"{f.angle_error_deg:.2f} ({f.angle_error_p90_deg:.1f})",
                f"{f.tilt_roll_error_deg:.2f}",
                "" if f.heading_error_deg is None else f"{f.heading_error_deg:.2f}",
                f"{100 * f.height_error:.1f} ({100 * f.height_error_p90:.0f})",
                f"{f.coverage:.0%}",
                f"{f.degenerate:.0%}",
                f"{f.drifting:.0%}",
                f"{f.seconds:.2f}",
            )
    return table


def overall_table(knock: str, rows: Sequence[Overall]) -> Table:
    """Slopes and coverage of each estimator over all scenes."""
    table = Table(title=f"{knock}, all scenes", title_justify="left")
    table.add_column("\n\nestimator", no_wrap=True)
    for column in ("\nslope:\ntilt", "\n\nroll", "\n\nlog height", "\n\nheading"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("90 % covers, %:\ntilt, roll,\nheight, heading", justify="right", no_wrap=True)
    for row in rows:
        slopes = ["", "", ""]
        if row.slope is not None and row.slope_se is not None:
            slopes = [_slope(*pair) for pair in zip(row.slope, row.slope_se, strict=True)]
        heading = ""
        if row.heading_slope is not None and row.heading_slope_se is not None:
            heading = _slope(row.heading_slope, row.heading_slope_se)
        shares = [*row.coverage, *([] if row.heading_coverage is None else [row.heading_coverage])]
        covers = ", ".join(f"{100 * share:.0f}" for share in shares)
        table.add_row(row.estimator, *slopes, heading, covers)
    return table


def _slope(slope: float, error: float) -> str:
    return f"{slope:.3f} ± {error:.3f}"
