"""The tables of `python -m studies evaluate` fit a page and show what was measured."""

from io import StringIO

from rich.console import Console

from studies.protocol.report import Overall, SceneFigures
from studies.protocol.tables import BARS, TABLE_WIDTH, overall_table, scene_table


def printed(table) -> str:
    console = Console(width=300, file=StringIO())
    console.print(table)
    return console.file.getvalue()


def test_tables_keep_within_their_width_at_long_figures():
    figures = [
        SceneFigures(
            scene_id=scene, estimator="calibrated_reference", cases=12, tracks=1234.0,
            angle_error_deg=9.59, angle_error_p90_deg=45.5, tilt_roll_error_deg=99.99,
            height_error=0.488, height_error_p90=0.76, coverage=1.0, degenerate=1.0, drifting=1.0,
            seconds=2.34, heading_error_deg=43.45, heading_coverage=1.0,
        )
        for scene in BARS
    ]  # fmt: skip
    text = printed(scene_table("knock", 12, figures))
    assert max(map(len, text.splitlines())) <= TABLE_WIDTH
    assert "wildtrack-c1 (1234)" in text
    assert "99.99" in text
    assert "bar (or declared)" in text
    rows = [
        Overall(
            estimator="calibrated_reference", cases=84, slope=(-1.234, 1.0, 1.0),
            slope_se=(0.1, 0.1, 0.1), coverage=(1.0, 1.0, 1.0), heading_slope=0.9876,
            heading_slope_se=0.0123, heading_coverage=0.875,
        ),
        Overall(
            estimator="joint", cases=84, slope=None, slope_se=None, coverage=(0.9, 0.8, 0.7),
            heading_slope=None, heading_slope_se=None, heading_coverage=None,
        ),
    ]  # fmt: skip
    text = printed(overall_table("knock", rows))
    assert max(map(len, text.splitlines())) <= TABLE_WIDTH
    assert "0.988 ± 0.012" in text
    assert "100, 100, 100, 88" in text
    assert "90, 80, 70 │" in text
