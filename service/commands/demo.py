"""`surefoot demo`: a simulated street, a knocked camera, and the alert, in the terminal."""

import contextlib
import fcntl
import math
import os
import shutil
import socket
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import httpx
import numpy as np
from rich.console import Console
from rich.live import Live
from rich.progress import BarColumn, Progress, TextColumn

from models.geometry.rotation import angle_between
from models.tracks.scenes import SceneTrack
from service.commands.demo_street import (
    BETWEEN_S,
    CAMERA_ID,
    KNOCK,
    KNOCKED_TRACKS,
    PRIOR,
    REFERENCE_TRACKS,
    STILL_TRACKS,
    Screen,
    clock,
    save_picture,
    street_body,
    street_people,
)
from service.commands.replay import post_tracks
from service.commands.settings_given import settings_given
from service.data_dir import StartError, running_in
from service.enums import AlertState, ReferenceState
from service.interpreter import command_of
from service.settings import Settings
from service.workers.processes.process import end_like_ctrl_c

_PREFIX, _LOCK = "surefoot-demo-", "demo.lock"
_HOST = "127.0.0.1"
_BATCH = 10
_PAUSE_S = 0.4  # for the eye
_PATIENCE_S = 150.0  # for one step, on a machine that is busy with other things
_STOP_S = 20.0
_BUSY = (429, 503)


def run_demo(*, port: int, seed: int, stay: bool, picture: Path | None) -> int:
    """Run the demo; 0 if the alert came and the pose is nearer to the knocked than to the prior.

    Raises:
        StartError: the port is taken, the service ended, or it did not answer in time.
    """
    # It plays by itself: a site's settings, its database or its broker, are nothing of its.
    for name in [name for name in os.environ if name.startswith("SUREFOOT_")]:
        del os.environ[name]
    console = Console()
    started = time.monotonic()
    _remove_left_over()
    port = _free_port(port)
    end_like_ctrl_c()
    console.print("A street camera, people walking by; later somebody knocks the camera.")
    with _folder() as folder:
        settings = settings_given(
            data_dir=folder,
            port=port,
            recipe="default",
            seed=seed,
            workers=1,
            auth="off",  # nothing there is anybody's
        )
        url = f"http://{settings.host}:{settings.port}"
        console.print(f"Watch it in a browser: {url}/ui/cameras/{CAMERA_ID}\n")
        with _service(settings) as service, httpx.Client(base_url=url, timeout=30) as http:
            try:
                _wait(lambda: http.get("/readyz").is_success, service, "started")
                screen, progress = _play(http, console, seed, service)
            except httpx.HTTPError as error:
                raise StartError(f"demo: its service failed: {error}".splitlines()[0]) from error
            won = _close(console, screen, url, time.monotonic() - started)
            if picture is not None:
                save_picture(screen.table(progress), picture)
            if won and stay:
                console.print("Ctrl-C stops the service.")
                with contextlib.suppress(KeyboardInterrupt):
                    service.wait()
    return 0 if won else 1


def _play(
    http: httpx.Client, console: Console, seed: int, service: subprocess.Popen[bytes]
) -> tuple[Screen, Progress]:
    screen = Screen()
    progress = Progress(
        TextColumn("{task.description}"), BarColumn(), TextColumn("{task.percentage:.0f} %"),
        console=console,
    )  # fmt: skip
    parts = (
        ("people walk; the reference is learned", PRIOR, REFERENCE_TRACKS),
        ("people walk on, the camera is still", PRIOR, STILL_TRACKS),
        ("knocked; people walk on", KNOCK.apply(PRIOR), KNOCKED_TRACKS),
    )
    clock_s = time.time() - BETWEEN_S * sum(count for _, _, count in parts)
    with Live(get_renderable=lambda: screen.table(progress), console=console) as live:
        training = progress.add_task("beside it, a regressor is trained", total=None)
        _wait(lambda: _registered(http), service, "registered the camera")
        for number, (words, pose, count) in enumerate(parts):
            if pose != PRIOR:
                screen.knocked_at = datetime.fromtimestamp(clock_s, UTC)
            task = progress.add_task(words, total=count)
            people = street_people(pose, count, seed + number)
            for at in range(0, count, _BATCH):
                _show(http, screen, people[at : at + _BATCH], clock_s, service)
                progress.update(task, advance=_BATCH)
                _look_at_training(http, progress, training)
                time.sleep(_PAUSE_S)
            clock_s += BETWEEN_S * count
        live.refresh()
    return screen, progress


def _show(
    http: httpx.Client,
    screen: Screen,
    people: Sequence[SceneTrack],
    clock_s: float,
    service: subprocess.Popen[bytes],
) -> None:
    """Post people as a tracker would, when their walks have ended, and wait for the estimate."""
    _wait(lambda: _posted(http, people, clock_s), service, "stored the tracks")
    screen.tracks += len(people)
    newest_s = clock_s + float(people[-1].trajectory.time_s[-1])
    _wait(lambda: _looked_at(http, screen, newest_s), service, "estimated from the newest tracks")


def _registered(http: httpx.Client) -> bool:
    answer = http.post("/cameras", json=street_body())
    if answer.status_code != 409:  # a request that timed out may have registered it
        answer.raise_for_status()
    return True


def _posted(http: httpx.Client, people: Sequence[SceneTrack], clock_s: float) -> bool:
    receipt = post_tracks(http, CAMERA_ID, people, clock_s)
    assert not receipt["rejected"], receipt
    return True


def _looked_at(http: httpx.Client, screen: Screen, newest_s: float) -> bool:
    """True if the newest track is in the reference or the estimate that is shown."""
    pose = http.get(f"/cameras/{CAMERA_ID}/pose").raise_for_status().json()
    wanted = {"camera_id": CAMERA_ID, "state": AlertState.FIRING}
    alerts = http.get("/alerts", params=wanted).raise_for_status().json()["items"]
    screen.pose, screen.alert = pose, alerts[0] if alerts else None
    if pose["reference"]["state"] == ReferenceState.LEARNING:
        return bool(pose["reference"]["tracks"] < REFERENCE_TRACKS)
    newest = pose["to"] and datetime.fromisoformat(pose["to"]).timestamp() >= newest_s - 1e-3
    return bool(newest) or screen.tracks == REFERENCE_TRACKS


def _look_at_training(http: httpx.Client, progress: Progress, task: Any) -> None:
    answer = http.get(f"/cameras/{CAMERA_ID}/trainings")
    if answer.status_code in _BUSY:
        return
    training = answer.raise_for_status().json()["items"][-1]
    step, steps = training["progress"]["step"], training["progress"]["steps"]
    progress.update(task, completed=step, total=steps or None)


def _close(console: Console, screen: Screen, url: str, took_s: float) -> bool:
    """Say how it ended."""
    if screen.pose is None or screen.alert is None or screen.knocked_at is None:
        console.print("[red]no alert came[/]")
        return False
    served = np.array(screen.pose["pose"]["quaternion_wxyz"])
    to_knocked, to_prior = (
        math.degrees(float(angle_between(served, pose.quaternion_wxyz)))
        for pose in (KNOCK.apply(PRIOR), PRIOR)
    )
    console.print(
        f"\nKnocked at {screen.knocked_at:%H:%M:%S}; the alert says "
        f"{clock(screen.alert['changed_at'])}.\n"
        f"The served pose is {to_knocked:.1f} deg from the knocked camera and {to_prior:.1f} deg "
        f"from where it was; {took_s:.0f} s in all.\n"
        f"Look: {url}/, {url}/ui/cameras/{CAMERA_ID}, {url}/docs"
    )
    return to_knocked < to_prior


@contextlib.contextmanager
def _service(settings: Settings) -> Iterator[subprocess.Popen[bytes]]:
    log_path = settings.data_dir / "serve.log"
    with log_path.open("w") as log:
        process = subprocess.Popen(
            command_of("service.cli", "serve", "--follow-stdin"),
            env=settings.as_environment(),
            stdin=subprocess.PIPE,  # its other end closes when we end, in whatever way
            stdout=log,
            stderr=log,
            start_new_session=True,  # Ctrl-C is ours to pass on
        )
        try:
            yield process
        finally:
            if process.poll() is not None:  # it ended by itself: its log has the reason
                Console(stderr=True).print(log_path.read_text()[-4000:], markup=False)
            process.terminate()
            try:
                process.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _wait(until: Callable[[], bool], service: subprocess.Popen[bytes], step: str) -> None:
    """Try until a step of the demo is done; a service that is busy or starting is asked again.

    Raises:
        StartError: the service ended, or has not done the step within `_PATIENCE_S`.
        httpx.HTTPStatusError: it refuses the request.
    """
    until_s = time.monotonic() + _PATIENCE_S
    while not _done(until):
        if service.poll() is not None:
            raise StartError(f"demo: its service ended with {service.returncode}, see above")
        if time.monotonic() > until_s:
            raise StartError(
                f"demo: its service has not {step} within {_PATIENCE_S:.0f} s; try again when the "
                "machine is less busy"
            )
        time.sleep(0.2)


def _done(until: Callable[[], bool]) -> bool:
    try:
        return until()
    except httpx.TransportError:  # not listening yet, or too busy to answer in time
        return False
    except httpx.HTTPStatusError as error:
        if error.response.status_code in _BUSY:
            return False
        raise


@contextlib.contextmanager
def _folder() -> Iterator[Path]:
    """A folder that is removed at the end; by its lock others see that a demo is in it."""
    with (
        tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True) as name,
        (Path(name) / _LOCK).open("w") as lock,
    ):
        fcntl.flock(lock, fcntl.LOCK_EX)
        yield Path(name)


def _remove_left_over() -> None:
    """Remove the folders of demos that were killed, once nothing runs in them."""
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        # Without the lock it is somebody else's, or is just being made.
        with contextlib.suppress(OSError):
            if (folder / _LOCK).exists() and not running_in(folder):
                shutil.rmtree(folder)


def _free_port(port: int) -> int:
    """A port of this machine that nobody listens on: the one that is named, any of 0.

    Raises:
        StartError: somebody does; the demo would register its street there.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((_HOST, port))
        except OSError as error:
            raise StartError(
                f"port: {_HOST}, port {port} cannot be had ({error.strerror}); another service "
                "runs there: name another port by --port, or none"
            ) from error
        free: int = probe.getsockname()[1]
        return free
