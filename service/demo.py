"""`surefoot demo`: a simulated street, a knocked camera, and the alert, in the terminal."""

import math
import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn
from rich.table import Table

from models.evaluation.scenes import Knock, SceneTrack
from models.geometry.intrinsics import Intrinsics
from models.geometry.pose import CameraPose
from models.geometry.rotation import angle_between
from models.simulation.poses import repeated_pose
from models.simulation.walkers import WalkConfig, simulate_walks
from models.trajectory import Trajectory
from service.data_dir import StartError
from service.demo_folder import (
    demo_folder,
    free_port,
    remove_left_over,
    require_free,
)
from service.formats.degrees import degrees, in_degrees
from service.kinds import AlertState, ReferenceState
from service.process import end_like_ctrl_c
from service.replay import post_tracks
from service.settings import Settings

CAMERA_ID = "demo-street"
LENS = Intrinsics(width=1280, height=720, fx=1100, fy=1100, cx=639.5, cy=359.5)
PRIOR = CameraPose(height_m=6.0, tilt_rad=math.radians(22), roll_rad=math.radians(1))
KNOCK = Knock(tilt_rad=math.radians(6), roll_rad=math.radians(-5))
_BATCH = 10
_REFERENCE_TRACKS, _STILL_TRACKS, _KNOCKED_TRACKS = 100, 50, 100
_BETWEEN_S = 6.0  # of the street's time; the recording ends now
_PAUSE_S = 0.4  # for the eye
_EPOCHS = 5
_LONGEST_S = 150.0


@dataclass(slots=True)
class _Screen:
    """What the terminal shows below the progress bars."""

    tracks: int = 0
    knocked_at: datetime | None = None
    pose: dict[str, Any] | None = None
    alert: dict[str, Any] | None = None

    def table(self, progress: Progress) -> Table:
        page = Table.grid()
        page.add_row(progress)
        rows = Table(title=f"{CAMERA_ID}: {self.tracks} people seen", title_justify="left")
        for column in ("", "height m", "tilt deg", "roll deg"):
            rows.add_column(column, justify="left" if not column else "right")
        rows.add_row("prior pose", *_row(PRIOR))
        truth = KNOCK.apply(PRIOR) if self.knocked_at else PRIOR
        rows.add_row("true pose" + (" (knocked)" if self.knocked_at else ""), *_row(truth))
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
            f"{_clock(self.alert['changed_at'])} the camera is turned by {drift['angle_deg']:.1f} "
            f"deg\n(tilt {drift['tilt_deg']:+.1f}, roll {drift['roll_deg']:+.1f}), height "
            f"{drift['height_m']:+.2f} m"
        )


def run_demo(*, port: int, seed: int, stay: bool, picture: Path | None) -> int:
    """Run the demo; 0 if the alert came and the pose is nearer to the knocked than to the prior."""
    console = Console()
    started = time.monotonic()
    port = port or free_port()
    remove_left_over()
    require_free(port)
    end_like_ctrl_c()
    console.print("A street camera, people walking by; later somebody knocks the camera.")
    with demo_folder() as folder:
        settings = Settings(
            data_dir=folder,
            port=port,
            recipe="default",
            epochs=_EPOCHS,
            seed=seed,
            workers=1,
            auth="off",  # it plays by itself, and with nothing that is anybody's
        )
        url = f"http://{settings.host}:{settings.port}"
        console.print(f"Watch it in a browser: {url}/ui/cameras/{CAMERA_ID}\n")
        with _service(settings) as service, httpx.Client(base_url=url, timeout=30) as http:
            _wait_ready(http, service, started)
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
        console=console,
    )  # fmt: skip
    parts = (
        ("people walk; the reference is learned", PRIOR, _REFERENCE_TRACKS),
        ("people walk on, the camera is still", PRIOR, _STILL_TRACKS),
        ("knocked; people walk on", KNOCK.apply(PRIOR), _KNOCKED_TRACKS),
    )
    clock_s = time.time() - _BETWEEN_S * sum(count for _, _, count in parts)
    with Live(get_renderable=lambda: screen.table(progress), console=console) as live:
        training = progress.add_task("beside it, a regressor is trained", total=None)
        http.post("/cameras", json=_camera()).raise_for_status()
        for number, (words, pose, count) in enumerate(parts):
            if pose != PRIOR:
                screen.knocked_at = datetime.fromtimestamp(clock_s, UTC)
            task = progress.add_task(words, total=count)
            people = _people(pose, count, seed + number)
            for at in range(0, count, _BATCH):
                _show(http, screen, people[at : at + _BATCH], clock_s, started)
                progress.update(task, advance=_BATCH)
                _look_at_training(http, progress, training)
                time.sleep(_PAUSE_S)
            clock_s += _BETWEEN_S * count
        live.refresh()
    return screen, progress


def _show(
    http: httpx.Client,
    screen: _Screen,
    people: Sequence[SceneTrack],
    clock_s: float,
    started: float,
) -> None:
    """Post people as a tracker would, when their walks have ended, and wait for the answer."""
    receipt = post_tracks(http, CAMERA_ID, people, clock_s)
    assert not receipt["rejected"], receipt
    screen.tracks += len(people)
    newest_s = clock_s + float(people[-1].trajectory.time_s[-1])
    while not _looked_at(http, screen, newest_s):
        _check_time(started)
        time.sleep(0.2)


def _looked_at(http: httpx.Client, screen: _Screen, newest_s: float) -> bool:
    """Whether the newest track is in the reference or the estimate that is shown."""
    pose = http.get(f"/cameras/{CAMERA_ID}/pose").raise_for_status().json()
    alerts = http.get(
        "/alerts", params={"camera_id": CAMERA_ID, "state": AlertState.FIRING}
    ).json()["items"]
    screen.pose, screen.alert = pose, alerts[0] if alerts else None
    if pose["reference"]["state"] == ReferenceState.LEARNING:
        return bool(pose["reference"]["tracks"] < _REFERENCE_TRACKS)
    newest = pose["to"] and datetime.fromisoformat(pose["to"]).timestamp() >= newest_s - 1e-3
    return bool(newest) or screen.tracks == _REFERENCE_TRACKS


def _look_at_training(http: httpx.Client, progress: Progress, task: Any) -> None:
    training = http.get(f"/cameras/{CAMERA_ID}/trainings").json()["items"][-1]
    step, steps = training["progress"]["step"], training["progress"]["steps"]
    progress.update(task, completed=step, total=steps or None)


def _save_picture(page: Table, path: Path) -> None:
    """The last screen as SVG."""
    with open(os.devnull, "w") as nowhere:
        recorder = Console(record=True, width=90, file=nowhere)
        recorder.print(page)
        recorder.save_svg(str(path), title="surefoot demo")


def _close(console: Console, screen: _Screen, url: str, took_s: float) -> bool:
    """Say how it ended."""
    if screen.pose is None or screen.alert is None or screen.knocked_at is None:
        console.print("[red]no alert came[/]")
        return False
    served = np.array(screen.pose["pose"]["quaternion_wxyz"])
    to_knocked, to_prior = (
        degrees(float(angle_between(served, pose.quaternion_wxyz)))
        for pose in (KNOCK.apply(PRIOR), PRIOR)
    )
    console.print(
        f"\nKnocked at {screen.knocked_at:%H:%M:%S}; the alert says "
        f"{_clock(screen.alert['changed_at'])}.\n"
        f"The served pose is {to_knocked:.1f} deg from the knocked camera and {to_prior:.1f} deg "
        f"from where it was; {took_s:.0f} s in all.\n"
        f"Look: {url}/, {url}/ui/cameras/{CAMERA_ID}, {url}/docs"
    )
    return to_knocked < to_prior


def _people(pose: CameraPose, count: int, seed: int) -> list[SceneTrack]:
    """People seen by a camera, whose walks end one after the other from time 0 on."""
    rng = np.random.default_rng(seed)
    walk = WalkConfig(speed_sd_mps=0.2, farthest_m=40.0)
    walks = simulate_walks(LENS, repeated_pose(pose, count), walk, rng)
    tracks = []
    for number, (uv, length) in enumerate(zip(walks.uv, walks.lengths, strict=True)):
        time_s = _BETWEEN_S * (number + 1) + (np.arange(length) - length + 1) * walk.step_s
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
        "prior_pose": in_degrees(asdict(PRIOR)),
        "reference_tracks": _REFERENCE_TRACKS,
    }  # fmt: skip


def _wait_ready(http: httpx.Client, service: subprocess.Popen[bytes], started: float) -> None:
    while True:
        if service.poll() is not None:
            raise StartError(f"demo: its service ended with {service.returncode}, see above")
        try:
            if http.get("/readyz").status_code == 200:
                return
        except httpx.TransportError:
            pass  # not listening yet
        _check_time(started)
        time.sleep(0.2)


@contextmanager
def _service(settings: Settings) -> Iterator[subprocess.Popen[bytes]]:
    log_path = settings.data_dir / "serve.log"
    with log_path.open("w") as log:
        process = subprocess.Popen(
            [sys.executable, "-m", "service.cli", "serve", "--follow-stdin"],
            env=settings.as_environment(),
            stdin=subprocess.PIPE,  # its other end closes when we end, in whatever way
            stdout=log,
            stderr=log,
            start_new_session=True,  # Ctrl-C is ours to pass on
        )
        try:
            yield process
        except Exception:
            Console(stderr=True).print(log_path.read_text()[-4000:], markup=False)
            raise
        finally:
            process.terminate()
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


def _clock(moment: str | None) -> str:
    return "an unknown time" if moment is None else f"{datetime.fromisoformat(moment):%H:%M:%S}"
