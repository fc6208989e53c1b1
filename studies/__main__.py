"""`python -m studies`: evaluate, protocol, http, flow-, alarm- and creep-study, centred, paper."""

import ast
import importlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from models.errors import CalibrationError


@contextmanager
def _or_one_line(study: str, failure: type[ValueError] = CalibrationError) -> Iterator[None]:
    """End with 1 where a study cannot be made, and say why in one line."""
    try:
        yield
    except failure as error:
        Console(stderr=True).print(f"[red]{study} failed:[/] {error}")
        raise typer.Exit(1) from error


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
    """Measure every estimator on recorded scenes whose cameras are knocked: the protocol."""
    from studies.alarms.run import AlarmPlan, run_scene_alarms
    from studies.protocol.run import run_protocol

    with _or_one_line("evaluate"):
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


def protocol(
    recordings: Annotated[
        list[Path], typer.Argument(help="Folders of scenes and of long recordings.")
    ],
    tables: Annotated[
        str,
        typer.Option(
            help="Of time, people, midway, faults, replays, few, far, names; with commas."
        ),
    ] = "time,people,midway,faults,replays,few,far,names",
    seeds: Annotated[int, typer.Option(min=1, help="How many of each.")] = 2,
    seed: Annotated[int, typer.Option(min=0, help="The first of them.")] = 0,
    faults: Annotated[str, typer.Option(help="Which faults, with commas; all unless said.")] = "",
    batch: Annotated[
        int, typer.Option(min=0, help="Tracks that come at once; 0: all of them.")
    ] = 50,
    processes: Annotated[int, typer.Option(min=1, help="Cases at once, a core each.")] = 2,
    output: Annotated[
        Path, typer.Option(help="Where outcomes are kept; what is there is not done again.")
    ] = Path("protocol.jsonl"),
    write: Annotated[
        Path | None, typer.Option(help="A page with markers to write the tables into.")
    ] = None,
) -> None:
    """Measure what is served in the order of time, with faults, and over long recordings."""
    from studies.faults.catalogue import FAULTS
    from studies.served.run import run_served
    from studies.served.tasks import Table

    with _or_one_line("protocol", ValueError):
        run_served(
            recordings,
            tables=[Table(name) for name in tables.split(",")],
            seeds=range(seed, seed + seeds),
            faults=faults.split(",") if faults else list(FAULTS),
            batch=batch,
            processes=processes,
            output=output,
            page=write,
        )


def parts(
    scenes: Annotated[list[Path], typer.Argument(help="Folders of scenes and recordings.")],
    seeds: Annotated[int, typer.Option(min=1, help="How many of each case.")] = 2,
    processes: Annotated[int, typer.Option(min=1, help="Parts at once, a core each.")] = 2,
    output: Annotated[Path, typer.Option(help="Where figures are kept.")] = Path("parts.jsonl"),
    write: Annotated[Path | None, typer.Option(help="A page with markers for the table.")] = None,
    part: Annotated[list[str] | None, typer.Option(help="Only this one, or these.")] = None,
) -> None:
    """Measure what each part of the estimator is worth: the protocol with one off at a time."""
    from studies.served.parts import run_parts

    only = part or ()
    with _or_one_line("parts"):
        run_parts(scenes, seeds=seeds, processes=processes, output=output, page=write, only=only)


def flow_study(
    sites: Annotated[int, typer.Option(min=1, help="How many simulated sites.")] = 20,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all of them.")] = 0,
    processes: Annotated[int, typer.Option(min=1, help="Sites at once, a core each.")] = 2,
    output: Annotated[Path, typer.Option(help="Where the JSON goes.")] = Path("flow-study.json"),
) -> None:
    """Simulated sites: how well a flow map tells a knock, and what a new path does to a pose."""
    from studies.paths.flow_tables import run_flow_study

    run_flow_study(sites=sites, seed=seed, processes=processes, output=output)


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
    from studies.alarms.run import AlarmPlan, run_alarm_study

    plan = AlarmPlan(
        alarms_a_year=alarms_a_year,
        tracks_a_day=tracks_a_day,
        reference_tracks=reference_tracks,
        days=days,
    )
    run_alarm_study(sites=sites, seed=seed, plan=plan, processes=processes, output=output)


def slow_drift_study(
    sites: Annotated[int, typer.Option(min=1, help="How many simulated cameras.")] = 20,
    still_days: Annotated[
        int, typer.Option(min=0, help="How long each stands, beside its creeps; 0: not at all.")
    ] = 730,
    tracks_a_day: Annotated[float, typer.Option(min=1, help="People it sees.")] = 18.0,
    reference_tracks: Annotated[int, typer.Option(min=20, help="Of its reference.")] = 200,
    alarms_a_year: Annotated[
        float, typer.Option(min=0.001, help="False ones allowed, of which a tenth may be these.")
    ] = 1.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all of them.")] = 0,
    processes: Annotated[int, typer.Option(min=1, help="Cameras at once, a core each.")] = 2,
    output: Annotated[Path, typer.Option(help="Where the JSON goes.")] = Path("creep-study.json"),
) -> None:
    """Simulated cameras that creep in tilt, roll or heading, or stand: when the anchor tells it."""
    from studies.alarms.slow_drift_run import run_slow_drift_study
    from studies.alarms.slow_drift_years import SlowDriftPlan

    plan = SlowDriftPlan(
        tracks_a_day=tracks_a_day,
        reference_tracks=reference_tracks,
        alarms_a_year=alarms_a_year,
        days=730,
        still_days=still_days,
    )
    run_slow_drift_study(sites=sites, seed=seed, plan=plan, processes=processes, output=output)


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
    from studies.paper.centred import run_centred

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


def paper(
    scenes: Annotated[list[Path], typer.Argument(help="Folders with camera.json and tracks.csv.")],
    out: Annotated[Path, typer.Option(help="Folder of results, tables and the manifest.")],
    parts: Annotated[str, typer.Option(help="Parts by name, with commas; all unless said.")] = "",
    seeds: Annotated[
        int | None, typer.Option(min=1, help="At most so many seeds for now; all unless said.")
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(help="Cases alone that match, as 'paper* on town_centre'; may be repeated."),
    ] = None,
    processes: Annotated[int, typer.Option(min=1, help="Cases at once, a core each.")] = 2,
    tables: Annotated[
        bool, typer.Option("--tables", help="Run nothing: tables of what the folder has.")
    ] = False,
    write: Annotated[
        Path | None, typer.Option(help="A page with markers to write the tables into.")
    ] = None,
) -> None:
    """The paper's tables beside ours; goes on where it was ended."""
    from studies.paper.run import run_paper

    with _or_one_line("paper"):
        run_paper(
            scenes,
            parts=[name for name in parts.split(",") if name],
            most_seeds=seeds,
            only=only or [],
            processes=0 if tables else processes,
            out=out,
            page=write,
        )


def http(
    scene_dir: Annotated[Path, typer.Argument(help="Folder with camera.json and tracks.csv.")],
    seed: Annotated[int, typer.Option(min=0, help="Of who walks before the knock, and of it.")],
    url: Annotated[str, typer.Option(help="The running service.")] = "http://127.0.0.1:8080",
    knock: Annotated[
        str, typer.Option(help="How far it may go: still, knock, hard, pan, pan-alone ...")
    ] = "knock",
    by_time: Annotated[
        bool, typer.Option("--by-time", help="The earlier half is the reference.")
    ] = False,
    batch: Annotated[int | None, typer.Option(min=1, help="So many tracks at once.")] = None,
    token: Annotated[
        str | None,
        typer.Option(envvar="SUREFOOT_TOKEN", help="Of the scopes admin and ingest, if needed."),
    ] = None,
) -> None:
    """A case of the protocol put to a running service; the served pose beside the truth."""
    import httpx
    from rich.progress import Progress

    from studies.protocol.cases import RANGES
    from studies.served.replay_protocol import print_outcome, replay_protocol

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
                by_time=by_time,
                batch=batch,
                on_progress=lambda what, done, total: bar.update(
                    task, description=what, total=total, completed=done
                ),
                token=token,
            )
    except (CalibrationError, httpx.HTTPError, TimeoutError) as error:
        console.print(f"[red]http failed:[/] {error}")
        raise typer.Exit(1) from error
    print_outcome(outcome, console)


app = typer.Typer(
    help="Measurements of surefoot, on recorded scenes and simulated sites.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
for _command in (
    evaluate, protocol, parts, http, flow_study, alarm_study, slow_drift_study, centred, paper,
):  # fmt: skip
    app.command()(_command)

# Studies with arguments of their own: `python -m studies NAME --help`.
_OTHERS = {
    "still-days": "studies.alarms.still_days",
    "cuts": "studies.alarms.cut_study",
    "heads": "studies.paths.heads_study",
    "lens": "studies.lens_study",
    "self-calibration": "studies.self_calibration_study",
    "arrivals": "studies.alarms.arrivals_study",
    "base-study": "studies.base_model.base_study",
    "base-model": "studies.base_model.making",
    "pictures": "studies.pictures.run",
    "zones": "studies.protocol.zones_study",
    "start-weights": "studies.regressors.start_weights",
}


def _first_line(module: str) -> str:
    """The first line of a module's docstring, without importing what it needs."""
    source = Path(__file__).parent.parent.joinpath(*module.split(".")).with_suffix(".py")
    return (ast.get_docstring(ast.parse(source.read_text())) or "").splitlines()[0]


def _run(context: typer.Context) -> None:
    importlib.import_module(_OTHERS[str(context.info_name)]).main(context.args)


for _name, _module in _OTHERS.items():
    app.command(
        _name,
        help=_first_line(_module),
        add_help_option=False,
        context_settings={"ignore_unknown_options": True, "allow_extra_args": True},
    )(_run)

if __name__ == "__main__":
    app()
