"""The tables that `python -m studies evaluate` prints."""

from collections.abc import Sequence

from rich.table import Table

from studies.protocol.bar import BARS
from studies.protocol.report import Overall, SceneFigures

TABLE_WIDTH = 110


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
