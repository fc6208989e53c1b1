"""`surefoot demo`: a simulated street, a knocked camera, and the alert, in the terminal."""

import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn
from rich.table import Table

from models.evaluation.scenes import Knock, SceneTrack
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.trajectory import Trajectory
from service.replay import post_tracks
from service.settings import Settings

CAMERA_ID = "demo-street"
LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
PRIOR = CameraPose(height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1))
KNOCK = Knock(tilt_rad=math.radians(6), roll_rad=math.radians(-5))
_BATCH = 10
_STILL_TRACKS, _KNOCKED_TRACKS = 120, 160
_EPOCHS = 5
_LONGEST_S = 170.0


@dataclass(slots=True)
class _Screen:
    """What the terminal shows below the progress bars."""

    tracks: int = 0
    knocked: bool = False
    pose: dict[str, Any] | None = None
    alert: dict[str, Any] | None = None

    def table(self, progress: Progress) -> Table:
        page = Table.grid()
        page.add_row(progress)
        rows = Table(title=f"{CAMERA_ID}: {self.tracks} people seen", title_justify="left")
        for column in ("", "height m", "tilt deg", "roll deg"):
            rows.add_column(column, justify="left" if not column else "right")
        rows.add_row("prior pose", *_row(PRIOR))
        truth = KNOCK.apply(PRIOR) if self.knocked else PRIOR
        rows.add_row("true pose" + (" (knocked)" if self.knocked else ""), *_row(truth))
        if self.pose is not None and self.pose["estimated"]:
            pose, sd = self.pose["pose"], self.pose["sd"]
            rows.add_row(
                f"served pose: {self.pose['state']}",
                *(f"{pose[k]:.2f} ± {sd[k]:.2f}" for k in ("height_m", "tilt_deg", "roll_deg")),
            )
        page.add_row(rows)
        if self.alert is not None:
            drift = self.alert["drift"]
            page.add_row(
                f"[bold red]ALERT[/] {self.alert['severity']}: the camera has turned by "
                f"{drift['angle_deg']:.1f} deg (tilt {drift['tilt_deg']:+.1f}, roll "
                f"{drift['roll_deg']:+.1f}), height {drift['height_m']:+.2f} m"
            )
        return page


def run_demo(*, port: int, seed: int, stay: bool, picture: Path | None) -> int:
    """Run the demo; 0 if the alert came and the pose is nearer to the knocked than to the prior."""
    console = Console()
    started = time.monotonic()
    console.print("A street camera, people walking by; later somebody knocks the camera.\n")
    with tempfile.TemporaryDirectory(prefix="surefoot-demo-") as folder:
        settings = Settings(
            data_dir=Path(folder),
            port=port or _free_port(),
            recipe="default",
            epochs=_EPOCHS,
            seed=seed,
            workers=1,
            window_tracks=100,
        )
        url = f"http://{settings.host}:{settings.port}"
        with _service(settings), httpx.Client(base_url=url, timeout=30) as http:
            screen, progress = _play(http, console, seed, started)
            won = _close(console, screen, url, time.monotonic() - started)
            if picture is not None:
                _save_picture(screen.table(progress), picture)
            if won and stay:
                console.print("Ctrl-C stops the service.")
                _wait_for_interrupt()
    return 0 if won else 1


def _play(
    http: httpx.Client, console: Console, seed: int, started: float
) -> tuple[_Screen, Progress]:
    screen = _Screen()
    progress = Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:.0f} %"),
        TimeRemainingColumn(), console=console,
    )  # fmt: skip
    with Live(get_renderable=lambda: screen.table(progress), console=console) as live:
        _wait_ready(http, started)
        training = progress.add_task("training this camera's regressor", total=None)
        http.post("/cameras", json=_camera()).raise_for_status()
        _wait_trained(http, progress, training, started)
        still = progress.add_task("people walk, the camera is still", total=_STILL_TRACKS)
        _walk(http, screen, progress, still, PRIOR, _STILL_TRACKS, seed, started)
        screen.knocked = True
        moved = progress.add_task("knocked; people walk on", total=_KNOCKED_TRACKS)
        knocked = KNOCK.apply(PRIOR)
        newest_s = _walk(http, screen, progress, moved, knocked, _KNOCKED_TRACKS, seed + 1, started)
        _settle(http, screen, newest_s, started)
        live.refresh()
    return screen, progress


def _save_picture(page: Table, path: Path) -> None:
    """The last screen as SVG."""
    with open(os.devnull, "w") as nowhere:
        recorder = Console(record=True, width=90, file=nowhere)
        recorder.print(page)
        recorder.save_svg(str(path), title="surefoot demo")


def _walk(
    http: httpx.Client,
    screen: _Screen,
    progress: Progress,
    task: Any,
    pose: CameraPose,
    count: int,
    seed: int,
    started: float,
) -> float:
    """Post people in small groups, as a tracker would; returns when the last one ended."""
    tracks = _people(pose, count, seed)
    now_s = 0.0
    for at in range(0, count, _BATCH):
        group = tracks[at : at + _BATCH]
        # Each group has just ended its walk.
        now_s = time.time()
        receipt = post_tracks(http, CAMERA_ID, group, now_s)
        assert not receipt["rejected"], receipt
        screen.tracks += len(group)
        progress.update(task, advance=len(group))
        _look(http, screen)
        time.sleep(0.7)
        _check_time(started)
    return now_s


def _settle(http: httpx.Client, screen: _Screen, newest_s: float, started: float) -> None:
    """Wait until the last tracks are in the estimate and the alert is out."""
    while True:
        _look(http, screen)
        seen = (screen.pose or {}).get("to")
        whole = seen is not None and datetime.fromisoformat(seen).timestamp() >= newest_s - 1e-3
        if screen.alert is not None and whole:
            return
        _check_time(started)
        time.sleep(0.3)


def _look(http: httpx.Client, screen: _Screen) -> None:
    screen.pose = http.get(f"/cameras/{CAMERA_ID}/pose").raise_for_status().json()
    alerts = http.get("/alerts", params={"camera_id": CAMERA_ID, "state": "firing"}).json()["items"]
    screen.alert = alerts[0] if alerts else None


def _close(console: Console, screen: _Screen, url: str, took_s: float) -> bool:
    """Say how it ended."""
    pose = (screen.pose or {}).get("pose")
    if pose is None or screen.alert is None:
        console.print("[red]no alert came[/]")
        return False
    served, prior = pose["quaternion_wxyz"], PRIOR.quaternion_wxyz
    knocked = KNOCK.apply(PRIOR).quaternion_wxyz
    to_knocked = math.degrees(angle_between(served, knocked))
    to_prior = math.degrees(angle_between(served, prior))
    console.print(
        f"\nThe served pose is {to_knocked:.1f} deg from the knocked camera and {to_prior:.1f} deg "
        f"from where it was; {took_s:.0f} s in all.\n"
        f"Look: {url}/docs, {url}/cameras/{CAMERA_ID}/pose, {url}/alerts"
    )
    return to_knocked < to_prior


def _people(pose: CameraPose, count: int, seed: int) -> list[SceneTrack]:
    """People seen by a camera; each walk ends at time 0."""
    rng = np.random.default_rng(seed)
    walk = WalkConfig(speed_sd_mps=0.2, farthest_m=40.0)
    walks = simulate_walks(LENS, repeated_pose(pose, count), walk, rng)
    tracks = []
    for number, (uv, length) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
        time_s = (np.arange(length) - length + 1) * walk.step_s
        noisy = uv[:length] + rng.normal(0, 1.5, (length, 2))
        tracks.append(
            SceneTrack(track_id=f"{seed}-{number}", trajectory=Trajectory(time_s=time_s, uv=noisy))
        )
    return tracks


def _camera() -> dict[str, Any]:
    return {
        "id": CAMERA_ID,
        "name": "Demo street",
        "intrinsics": {name: getattr(LENS, name) for name in
                       ("width", "height", "fx", "fy", "cx", "cy")},
        "prior_pose": {
            "height_m": PRIOR.height_m,
            "tilt_deg": math.degrees(PRIOR.tilt_rad),
            "roll_deg": math.degrees(PRIOR.roll_rad),
        },
    }  # fmt: skip


def _wait_ready(http: httpx.Client, started: float) -> None:
    while True:
        try:
            if http.get("/readyz").status_code == 200:
                return
        except httpx.TransportError:
            pass  # not listening yet
        _check_time(started)
        time.sleep(0.2)


def _wait_trained(http: httpx.Client, progress: Progress, task: Any, started: float) -> None:
    while True:
        training = http.get(f"/cameras/{CAMERA_ID}/trainings").json()["items"][-1]
        step, steps = training["progress"]["step"], training["progress"]["steps"]
        progress.update(task, completed=step, total=steps or None)
        if training["state"] == "succeeded":
            return
        if training["state"] in ("failed", "cancelled"):
            raise RuntimeError(f"training {training['state']}: {training['error']}")
        _check_time(started)
        time.sleep(0.3)


@contextmanager
def _service(settings: Settings) -> Iterator[None]:
    log_path = settings.data_dir / "serve.log"
    with log_path.open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "service.cli", "serve"],
            env=settings.as_environment(),
            stdout=log,
            stderr=log,
            start_new_session=True,  # Ctrl-C is ours to pass on
        )
        try:
            yield
        except Exception:
            Console(stderr=True).print(log_path.read_text()[-4000:], markup=False)
            raise
        finally:
            process.send_signal(signal.SIGTERM)
            process.wait(20)


def _check_time(started: float) -> None:
    if time.monotonic() - started > _LONGEST_S:
        raise TimeoutError(f"demo: took more than {_LONGEST_S:.0f} s")


def _wait_for_interrupt() -> None:
    try:
        while True:
            time.sleep(3600)
    except KeyboardInterrupt:
        return


def _row(pose: CameraPose) -> Sequence[str]:
    return [
        f"{pose.height_m:.2f}",
        f"{math.degrees(pose.tilt_rad):.2f}",
        f"{math.degrees(pose.roll_rad):.2f}",
    ]


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port
