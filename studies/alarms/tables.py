"""Tables of what alarms do: false ones a camera-year, and tracks until the true ones."""

from collections.abc import Sequence

import numpy as np
from rich.table import Table

from studies.alarms.results import (
    AlarmResults,
    Delay,
    by_knock,
    rate_interval,
    share_within,
)

# Tracks within which a knock of so many degrees should be found, and in which share of cases.
BARS = {5.0: (60, 0.95), 2.0: (250, 0.90), 1.0: (800, 0.70)}


def still_table(title: str, results: Sequence[AlarmResults]) -> Table:
    """False alarms of cameras that stand still, by scene and in all."""
    table = Table(title=title, title_justify="left")
    for name in (
        "scene",
        "reference,\nwalking groups",
        "camera-\nyears",
        "false\nalarms",
        "a camera-\nyear (95 %)",
        "highest,\nof its level",
        "pose, of\nits limit",
    ):
        table.add_column(name, justify="left" if name == "scene" else "right")
    names = list(dict.fromkeys(result.name for result in results))
    groups = [(name, [one for one in results if one.name == name]) for name in names]
    if len(names) <= 12:
        for name, own in groups:
            table.add_row(*_still_cells(name, own))
    table.add_row(*_still_cells("all", results), style="bold")
    return table


def delay_table(title: str, results: Sequence[AlarmResults]) -> Table:
    """Tracks from a knock to the alarm: the share within the bar, and the median, by scene."""
    table = Table(title=title, title_justify="left")
    table.add_column("scene", no_wrap=True)
    knocks = sorted(by_knock(results), key=lambda knock: (knock[1], -knock[0]))
    for angle_deg, pan in knocks:
        within = BARS[angle_deg][0] if angle_deg in BARS else 0
        kind = "pan" if pan else "tilt, roll"
        table.add_column(f"{angle_deg:g} deg {kind},\nwithin {within}", justify="right")
    names = list(dict.fromkeys(result.name for result in results))
    if len(names) <= 12:
        for name in names:
            own = by_knock([one for one in results if one.name == name])
            table.add_row(name, *(_delay_cell(knock[0], own.get(knock, [])) for knock in knocks))
    every = by_knock(results)
    table.add_row("all", *(_delay_cell(knock[0], every[knock]) for knock in knocks), style="bold")
    return table


def _still_cells(name: str, results: Sequence[AlarmResults]) -> list[str]:
    years = sum(result.years for result in results)
    alarms = sum(result.false_alarms for result in results)
    low, high = rate_interval(results)
    return [
        name,
        f"{np.median([result.walking_groups for result in results]):.0f}",
        f"{years:.1f}",
        str(alarms),
        f"{alarms / years:.2f} ({low:.2f} to {high:.2f})",
        f"{max(result.highest for result in results):.2f}",
        f"{max(result.pose_excess for result in results):.2f}",
    ]


def _delay_cell(angle_deg: float, delays: Sequence[Delay]) -> str:
    if not delays:
        return "-"
    median = float(np.median([delay.tracks for delay in delays]))
    tracks = f"{median:.0f}" if np.isfinite(median) else "never"
    within = BARS[angle_deg][0] if angle_deg in BARS else np.inf
    return f"{share_within(delays, within):.0%}, {tracks}"
