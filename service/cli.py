"""The command line: serve, worker, migrate, replay, demo, evaluate and the other studies."""

import math
import sys
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

from service.logs import configure_logs
from service.settings import Settings

app = typer.Typer(
    help="Tells when a fixed camera has moved, by how much, and its pose now.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

DataDir = Annotated[Path | None, typer.Option(help="Database and weights live here.")]

Recipe = Annotated[str | None, typer.Option(help="Recipe of new trainings: default or paper.")]


@app.command()
def serve(
    data_dir: DataDir = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on.")] = None,
    port: Annotated[int | None, typer.Option(help="Port to listen on.")] = None,
    workers: Annotated[int | None, typer.Option(min=0, help="Local worker processes.")] = None,
    recipe: Recipe = None,
) -> None:
    """Serve the API and run the local workers, until SIGTERM."""
    from service.serve import run_service

    configure_logs()
    run_service(_settings(data_dir=data_dir, host=host, port=port, workers=workers, recipe=recipe))


@app.command()
def worker(
    name: Annotated[
        str, typer.Option(help="Stable and its own: by it a worker finds its unfinished jobs.")
    ] = "standalone",
    data_dir: DataDir = None,
    follow_stdin: Annotated[bool, typer.Option(help="End when stdin ends.")] = False,
) -> None:
    """Run a worker alone, beside an API that runs elsewhere on this machine."""
    from service.jobs import exits
    from service.jobs.worker import WorkerRunningError, run_worker
    from service.migrate import migrate as run_migrations

    configure_logs()
    settings = _settings(data_dir=data_dir)
    if not follow_stdin:  # `serve` has migrated already
        run_migrations(settings)
    try:
        run_worker(settings, name, follow_stdin)
    except WorkerRunningError as error:
        Console(stderr=True).print(f"[red]worker refused:[/] {error}")
        raise typer.Exit(exits.REFUSED) from error


@app.command()
def migrate(data_dir: DataDir = None) -> None:
    """Bring the database to the newest revision."""
    from service.migrate import migrate as run_migrations

    settings = _settings(data_dir=data_dir)
    run_migrations(settings)
    Console().print(f"{settings.database_path} is at the newest revision")


@app.command()
def replay(
    scene_dir: Annotated[Path, typer.Argument(help="Folder with camera.json and tracks.csv.")],
    url: Annotated[str, typer.Option(help="The running service.")] = "http://127.0.0.1:8080",
    knock: Annotated[
        str | None,
        typer.Option(
            help="Move the camera: tilt and roll in degrees, log height ratio. With --protocol how "
            "far it may be moved: still, knock (the default), hard, pan or hard-pan."
        ),
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0, help="Times as fast as recorded; 0: as fast as it goes.")
    ] = 0.0,
    protocol: Annotated[
        int | None,
        typer.Option(min=0, help="Seed: post a case of the protocol, and compare with the truth."),
    ] = None,
    hard: Annotated[bool, typer.Option("--hard", help="With --protocol: a far knock.")] = False,
    still: Annotated[bool, typer.Option("--still", help="With --protocol: no knock.")] = False,
) -> None:
    """Register a recorded camera and post its tracks in time order."""
    import httpx
    from rich.progress import Progress

    from models.errors import CalibrationError
    from service.replay import replay_scene

    if protocol is not None:
        name = "hard" if hard else "still" if still else knock or "knock"
        _replay_protocol(scene_dir, url, protocol, name)
        return
    console = Console()
    try:
        with Progress(console=console) as bar:
            task = bar.add_task(f"posting {scene_dir.name}", total=None)
            scene, done = replay_scene(
                scene_dir,
                url,
                knock=_knock(knock or "0,0,0"),
                speed=speed,
                on_progress=lambda now: bar.update(task, total=now.tracks, completed=now.posted),
            )
    except (CalibrationError, httpx.HTTPError) as error:
        console.print(f"[red]replay failed:[/] {error}")
        raise typer.Exit(1) from error
    console.print(
        f"{done.accepted} tracks accepted, {done.duplicates} known already, {done.rejected} "
        f"rejected: {url}/cameras/{scene.scene_id}/pose"
    )


@app.command()
def demo(
    port: Annotated[int, typer.Option(help="Port to serve on; 0: any free one.")] = 0,
    seed: Annotated[int, typer.Option(help="Seed of the street, the knock and the training.")] = 7,
    stay: Annotated[
        bool | None, typer.Option(help="Keep serving at the end; the default in a terminal.")
    ] = None,
    picture: Annotated[Path | None, typer.Option(help="Save the last screen as SVG.")] = None,
) -> None:
    """Simulate a street, knock its camera, and watch the alert come: half a minute on 2 cores."""
    from service.demo import run_demo

    stays = sys.stdin.isatty() if stay is None else stay
    raise typer.Exit(run_demo(port=port, seed=seed, stay=stays, picture=picture))


@app.command()
def evaluate(
    scenes: Annotated[list[Path], typer.Argument(help="Folders with camera.json and tracks.csv.")],
    seeds: Annotated[int, typer.Option(min=1, help="How many knocks a scene.")] = 12,
    knocks: Annotated[
        str, typer.Option(help="Of still, knock, hard, pan, hard-pan; with commas.")
    ] = "knock",
    regressors: Annotated[
        bool, typer.Option(help="Train regressors too: minutes for each scene.")
    ] = False,
    processes: Annotated[int, typer.Option(min=1, help="Cases at once, a core each.")] = 2,
    output: Annotated[Path, typer.Option(help="Where the JSON goes.")] = Path("evaluation.json"),
    plots: Annotated[Path | None, typer.Option(help="Folder for PNG plots.")] = None,
    alarms: Annotated[
        bool, typer.Option("--alarms", help="Still and delay instead: the drift chart's alarms.")
    ] = False,
    tracks_a_day: Annotated[
        float, typer.Option(min=1, help="With --alarms: how many people a camera sees.")
    ] = 200.0,
    alarms_a_year: Annotated[
        float, typer.Option(min=0.001, help="With --alarms: false ones allowed.")
    ] = 1.0,
) -> None:
    """Knock the cameras of recorded scenes and measure every estimator: the protocol."""
    from models.errors import CalibrationError
    from service.alarm_study import AlarmPlan, run_scene_alarms
    from service.evaluate import run_protocol

    try:
        if alarms:
            plan = AlarmPlan(
                alarms_a_year=alarms_a_year,
                tracks_a_day=tracks_a_day,
                reference_tracks=0,
                days=365,
            )
            run_scene_alarms(scenes, seeds=seeds, plan=plan, processes=processes, output=output)
            return
        run_protocol(
            scenes,
            seeds=seeds,
            knocks=knocks.split(","),
            regressors=regressors,
            processes=processes,
            output=output,
            plots=plots,
        )
    except CalibrationError as error:
        Console(stderr=True).print(f"[red]evaluate failed:[/] {error}")
        raise typer.Exit(1) from error


@app.command()
def flow_study(
    sites: Annotated[int, typer.Option(min=1, help="How many simulated sites.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all of them.")] = 0,
    processes: Annotated[int, typer.Option(min=1, help="Sites at once, a core each.")] = 2,
    output: Annotated[Path, typer.Option(help="Where the JSON goes.")] = Path("flow-study.json"),
) -> None:
    """Simulated sites: how well a flow map tells a knock, and what a new path does to a pose."""
    from service.flow_study import run_flow_study

    run_flow_study(sites=sites, seed=seed, processes=processes, output=output)


@app.command()
def alarm_study(
    sites: Annotated[int, typer.Option(min=1, help="How many simulated cameras.")] = 60,
    days: Annotated[int, typer.Option(min=7, help="How long each lives.")] = 365,
    tracks_a_day: Annotated[float, typer.Option(min=1, help="People it sees.")] = 60.0,
    reference_tracks: Annotated[int, typer.Option(min=20, help="Of its reference.")] = 200,
    alarms_a_year: Annotated[float, typer.Option(min=0.001, help="False ones allowed.")] = 1.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all of them.")] = 0,
    processes: Annotated[int, typer.Option(min=1, help="Cameras at once, a core each.")] = 2,
    output: Annotated[Path, typer.Option(help="Where the JSON goes.")] = Path("alarm-study.json"),
) -> None:
    """Simulated camera-years of people's habits: false alarms, and tracks until true ones."""
    from service.alarm_study import AlarmPlan, run_alarm_study

    plan = AlarmPlan(
        alarms_a_year=alarms_a_year,
        tracks_a_day=tracks_a_day,
        reference_tracks=reference_tracks,
        days=days,
    )
    run_alarm_study(sites=sites, seed=seed, plan=plan, processes=processes, output=output)


@app.command()
def centred(
    scenes: Annotated[list[Path], typer.Argument(help="Folders with camera.json and tracks.csv.")],
    recipe: Annotated[str, typer.Option(help="Recipe: default or paper.")] = "default",
    seeds: Annotated[str, typer.Option(help="Seeds, with commas.")] = "0",
    speeds: Annotated[str, typer.Option(help="Training speeds in m/s, with commas.")] = "1.4",
    epochs: Annotated[int | None, typer.Option(min=1, help="Instead of the recipe's.")] = None,
    processes: Annotated[int, typer.Option(min=1, help="Trainings at once, a core each.")] = 1,
    output: Annotated[Path, typer.Option(help="Where the JSON goes.")] = Path("centred.json"),
    plot: Annotated[Path | None, typer.Option(help="PNG of errors over training speed.")] = None,
) -> None:
    """The paper's own experiment: train around each scene's true pose, average, print errors."""
    from service.centred import run_centred

    run_centred(
        scenes,
        recipe=recipe,
        seeds=[int(seed) for seed in seeds.split(",")],
        speeds_mps=[float(speed) for speed in speeds.split(",")],
        epochs=epochs,
        processes=processes,
        output=output,
        plot=plot,
    )


def _replay_protocol(scene_dir: Path, url: str, seed: int, knock: str) -> None:
    """Put a case of the protocol to a service and print the served pose beside the truth."""
    import httpx
    from rich.progress import Progress

    from models.errors import CalibrationError
    from models.evaluation.protocol import RANGES
    from service.replay_protocol import print_outcome, replay_protocol

    if knock not in RANGES:
        raise typer.BadParameter(f"knock: one of {', '.join(RANGES)}, got {knock!r}")
    console = Console()
    try:
        with Progress(console=console) as bar:
            task = bar.add_task(f"posting {scene_dir.name}", total=None)
            outcome = replay_protocol(
                scene_dir,
                url,
                seed=seed,
                knock=knock,
                on_progress=lambda what, done, total: bar.update(
                    task, description=what, total=total, completed=done
                ),
            )
    except (CalibrationError, httpx.HTTPError, TimeoutError) as error:
        console.print(f"[red]replay failed:[/] {error}")
        raise typer.Exit(1) from error
    print_outcome(outcome, console)


def _settings(**flags: Any) -> Settings:
    """Settings of the environment, with the flags that were given above them."""
    return Settings(**{name: value for name, value in flags.items() if value is not None})


def _knock(text: str) -> "Any":
    from models.evaluation.scenes import Knock

    try:
        tilt_deg, roll_deg, log_height = (float(part) for part in text.split(","))
    except ValueError as error:
        raise typer.BadParameter(f"knock: three numbers with commas, got {text!r}") from error
    return Knock(
        tilt_rad=math.radians(tilt_deg), roll_rad=math.radians(roll_deg), log_height=log_height
    )


def main() -> None:
    """Entry point of the `surefoot` command."""
    app()


if __name__ == "__main__":
    main()
