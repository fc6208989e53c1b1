"""The command line: serve, worker, replay and demo; what asks a service, or its data, is beside."""

import math
import sys
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.markup import escape

from service.commands.asking import LOCAL_URL, Url
from service.commands.data import DATA_COMMANDS, DataDir
from service.commands.remote import REMOTE_COMMANDS
from service.commands.settings_given import WrongSettingsError, begin, warn_of_variables
from service.commands.tokens import app as token_app
from service.data_dir import StartError
from service.workers.processes.collector import importing
from service.workers.processes.process import WorkKind, be_private

if TYPE_CHECKING:
    from models.simulation.poses import PoseOffset

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)

app.add_typer(token_app, name="token")

FollowStdin = Annotated[bool, typer.Option(help="End when stdin ends.")]

Recipe = Annotated[str | None, typer.Option(help="Recipe of new trainings: default or paper.")]


def _tell_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"surefoot {version('surefoot')}")
        raise typer.Exit


@app.callback()
def surefoot(
    _: Annotated[
        bool,
        typer.Option(
            "--version", callback=_tell_version, is_eager=True, help="Print the version and end."
        ),
    ] = False,
) -> None:
    """Tells when a fixed camera has moved, by how much, and its pose now."""


@app.command()
def serve(
    data_dir: DataDir = None,
    host: Annotated[str | None, typer.Option(help="Address to listen on.")] = None,
    port: Annotated[int | None, typer.Option(help="Port to listen on.")] = None,
    workers: Annotated[int | None, typer.Option(min=0, help="Local worker processes.")] = None,
    recipe: Recipe = None,
    follow_stdin: FollowStdin = False,
) -> None:
    """Serve the API and run the local workers, until SIGTERM."""
    settings = begin(data_dir=data_dir, host=host, port=port, workers=workers, recipe=recipe)
    warn_of_variables()
    with importing():
        from service.commands.serve import run_service

    run_service(settings, follow_stdin=follow_stdin)


@app.command()
def worker(
    name: Annotated[
        str, typer.Option(help="Stable and its own: by it a worker finds its unfinished jobs.")
    ] = "standalone",
    data_dir: DataDir = None,
    only: Annotated[
        WorkKind | None, typer.Option(help="Trainings alone, or all but trainings.")
    ] = None,
    follow_stdin: FollowStdin = False,
) -> None:
    """Run a worker alone, beside an API that runs elsewhere: on this machine, with a file."""
    settings = begin(data_dir=data_dir)
    with importing():
        from service.commands.migrate import migrate as run_migrations
        from service.commands.worker import WorkerRunningError, run_worker
        from service.workers.processes import exits

    if not follow_stdin:  # `serve` has warned and migrated already
        warn_of_variables()
        run_migrations(settings)
    try:
        run_worker(settings, name, follow_stdin, only)
    except WorkerRunningError as error:
        Console(stderr=True).print(f"[red]worker refused:[/] {escape(str(error))}")
        raise typer.Exit(exits.REFUSED) from error


@app.command()
def replay(
    scene_dir: Annotated[Path, typer.Argument(help="Folder with camera.json and tracks.csv.")],
    url: Url = LOCAL_URL,
    knock: Annotated[
        str | None,
        typer.Option(help="Move the camera: tilt and roll in degrees, log height ratio."),
    ] = None,
    speed: Annotated[
        float, typer.Option(min=0, help="Times as fast as recorded; 0: as fast as it goes.")
    ] = 0.0,
    token: Annotated[
        str | None,
        typer.Option(envvar="SUREFOOT_TOKEN", help="Of the scopes admin and ingest, if needed."),
    ] = None,
) -> None:
    """Register a recorded camera and post its tracks in time order."""
    import httpx
    from rich.progress import Progress

    from models.errors import CalibrationError
    from service.commands.replay import replay_scene

    console = Console()
    try:
        with Progress(console=console) as bar:
            task = bar.add_task(f"posting {escape(scene_dir.name)}", total=None)
            scene, done = replay_scene(
                scene_dir,
                url,
                knock=_knock(knock or "0,0,0"),
                speed=speed,
                on_progress=lambda now: bar.update(task, total=now.tracks, completed=now.posted),
                token=token,
            )
    except (CalibrationError, httpx.HTTPError) as error:
        console.print(f"[red]replay failed:[/] {escape(str(error))}")
        raise typer.Exit(1) from error
    typer.echo(
        f"{done.accepted} tracks accepted, {done.duplicates} known already, {done.rejected} "
        f"rejected: {url}/cameras/{scene.scene_id}/pose"
    )


@app.command()
def bridge(
    url: Url = LOCAL_URL,
    token: Annotated[
        str | None,
        typer.Option(envvar="SUREFOOT_TOKEN", help="Of the scopes read and ingest, if needed."),
    ] = None,
    data_dir: DataDir = None,
    follow_stdin: FollowStdin = False,
) -> None:
    """Carry tracks from an MQTT broker to a service, states and alerts back, until SIGTERM."""
    from service.commands.bridge import run_bridge

    run_bridge(begin(data_dir=data_dir), url, token, follow_stdin=follow_stdin)


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
    from service.commands.demo import run_demo

    be_private()
    stays = sys.stdin.isatty() if stay is None else stay
    raise typer.Exit(run_demo(port=port, seed=seed, stay=stays, picture=picture))


def _knock(text: str) -> "PoseOffset":
    from models.simulation.poses import PoseOffset

    try:
        tilt_deg, roll_deg, log_height = (float(part) for part in text.split(","))
    except ValueError as error:
        raise typer.BadParameter(f"knock: three numbers with commas, got {text!r}") from error
    return PoseOffset(
        tilt_rad=math.radians(tilt_deg), roll_rad=math.radians(roll_deg), log_height=log_height
    )


for _command in (*REMOTE_COMMANDS, *DATA_COMMANDS):
    app.command()(_command)


def main() -> None:
    """Entry point of the `surefoot` command; what an operator can mend is told in a line."""
    try:
        app()
    except StartError as error:
        typer.echo(f"surefoot: {error}", err=True)
        raise SystemExit(1) from None
    except WrongSettingsError as error:
        for line in error.lines:
            typer.echo(f"surefoot: {line}", err=True)
        raise SystemExit(2) from None


if __name__ == "__main__":
    main()
