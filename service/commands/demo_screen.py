"""What the demo shows in the terminal."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from models.geometry.pose import CameraPose
from service.commands.demo_street import CAMERA_ID, KNOCK, PRIOR
from service.enums import ReferenceState
from service.formats.degrees import degrees


@dataclass(slots=True)
class Screen:
    """What the terminal shows below the progress bars."""

    tracks: int = 0
    knocked_at: datetime | None = None
    pose: dict[str, Any] | None = None
    alert: dict[str, Any] | None = None

    def table(self, progress: Progress) -> Table:
        """The page as it is now."""
        page = Table.grid()
        page.add_row(progress)
        rows = Table(title=f"{CAMERA_ID}: {self.tracks} people seen", title_justify="left")
        for column in ("", "height m", "tilt deg", "roll deg"):
            rows.add_column(column, justify="left" if not column else "right")
        rows.add_row("prior pose", *row_of(PRIOR))
        truth = KNOCK.apply(PRIOR) if self.knocked_at else PRIOR
        rows.add_row("true pose" + (" (knocked)" if self.knocked_at else ""), *row_of(truth))
        if self.pose is not None:
            rows.add_row(f"served pose: {self.pose['state']}", *_served(self.pose))
        page.add_row(rows)
        if self.pose is not None:
            page.add_row(self._words(self.pose))
        return page

    def _words(self, pose: dict[str, Any]) -> str:
        reference = pose["reference"]
        if reference["state"] == ReferenceState.LEARNING:
            return f"learning what is usual here: {pose['reason']}"
        usual = f"people walk at {reference['walking_speed_mps']:.2f} m/s here"
        if self.alert is None:
            return f"{usual}\n{pose['reason']}"
        drift = {
            name: 0.0 if value is None else value for name, value in self.alert["drift"].items()
        }
        return (
            f"{usual}\n[bold red]ALERT[/] {self.alert['severity']}: since "
            f"{clock(self.alert['changed_at'])} the camera is turned by {drift['angle_deg']:.1f} "
            f"deg\n(tilt {drift['tilt_deg']:+.1f}, roll {drift['roll_deg']:+.1f}), height "
            f"{drift['height_m']:+.2f} m"
        )


def save_picture(page: Table, path: Path) -> None:
    """The last screen as SVG."""
    with open(os.devnull, "w") as nowhere:
        recorder = Console(record=True, width=90, file=nowhere)
        recorder.print(page)
        recorder.save_svg(str(path), title="surefoot demo")


def row_of(pose: CameraPose) -> Sequence[str]:
    """The cells of a pose."""
    return [
        f"{pose.height_m:.2f}",
        f"{degrees(pose.tilt_rad):.2f}",
        f"{degrees(pose.roll_rad):.2f}",
    ]


def _served(pose: dict[str, Any]) -> Sequence[str]:
    """The served numbers, with their deviations where they are estimated."""
    sd = pose["sd"] or {}
    return [
        f"{pose['pose'][name]:.2f}" + (f" ± {sd[name]:.2f}" if sd.get(name) is not None else "")
        for name in ("height_m", "tilt_deg", "roll_deg")
    ]


def clock(moment: str | None) -> str:
    """The time of day in an answer's time."""
    return "an unknown time" if moment is None else f"{datetime.fromisoformat(moment):%H:%M:%S}"
