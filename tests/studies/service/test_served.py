"""`python -m studies protocol`: outcomes outlive an end, tables say what they come to."""

import json
import math
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from models.errors import ShapeError
from models.simulation.poses import PoseOffset
from studies.pages import write_between
from studies.served import tasks
from studies.served.outcome_file import OutcomeFile
from studies.served.outcomes import ParameterOutcome, ServedOutcome
from studies.served.replays import ReplayOutcome, Stretch
from studies.served.tables import BETWEEN, all_tables
from studies.served.tasks import CaseId, CaseResult, Table, Task, tasks_of, work
from tests.studies.test_partings import scene_of

NUMBER = ParameterOutcome(moved=2.0, error=0.25, sd=0.5, identifiable=True, covered=True)
SERVED = ServedOutcome(
    reference_tracks=100,
    seen_tracks=50,
    used_tracks=45,
    parameters=(
        NUMBER,
        replace(NUMBER, error=1.0, covered=False),
        replace(NUMBER, error=0.01, sd=0.02),
        NUMBER,
    ),
    rotation_deg=0.75,
    height_error=0.0123,
    cuts=1,
    mapped=True,
    reason="",
    seconds=1.5,
)
STRETCH = Stretch(
    tracks=300, looks=6, alarm_after=None, mapped=0.5, paths_changed=1 / 3,
    identifiable=(6, 6, 6, 3), covered=(6, 3, 6, 3), worst_sd=2.25, cuts=1,
)  # fmt: skip
REPLAYED = ReplayOutcome(
    reference_tracks=1000,
    charted=True,
    before=STRETCH,
    after=replace(STRETCH, alarm_after=50),
    measured=SERVED.parameters,
    seconds=9.0,
)
CASE = CaseId(table=Table.TIME, scene="made-up", seed=0, knock="still", batch=50, seen=400)
REPLAY = replace(CASE, table=Table.REPLAYS, knock="pan-2", reference=1000, seen=None)


def test_outcomes_are_read_again_as_they_were(tmp_path):
    path = tmp_path / "p.jsonl"
    kept = OutcomeFile(path)
    kept.add(
        [CaseResult(case_id=CASE, outcome=SERVED), CaseResult(case_id=REPLAY, outcome=REPLAYED)]
    )
    kept.add([CaseResult(case_id=replace(CASE, seed=1), outcome=None, failure="LinAlgError()")])
    again = OutcomeFile(path)
    assert again.found == {
        CASE: CaseResult(case_id=CASE, outcome=SERVED),
        REPLAY: CaseResult(case_id=REPLAY, outcome=REPLAYED),
    }
    assert again.heading == kept.heading


def test_a_line_that_was_cut_off_is_forgotten_and_the_next_is_whole(tmp_path):
    path = tmp_path / "p.jsonl"
    OutcomeFile(path).add([CaseResult(case_id=CASE, outcome=SERVED)])
    with path.open("a") as file:
        file.write('{"asked": {"table": "ti')
    kept = OutcomeFile(path)
    assert set(kept.found) == {CASE}
    kept.add([CaseResult(case_id=REPLAY, outcome=REPLAYED)])
    assert set(OutcomeFile(path).found) == {CASE, REPLAY}


def test_outcomes_of_other_code_and_other_files_are_refused(tmp_path):
    path = tmp_path / "p.jsonl"
    OutcomeFile(path)
    heading = json.loads(path.read_text())
    path.write_text(json.dumps({**heading, "code": "0123456789ab"}) + "\n")
    with pytest.raises(ShapeError, match="by other code of models/ .0123456789ab, now "):
        OutcomeFile(path)
    path.write_text("{}\n")
    with pytest.raises(ShapeError, match="no file of outcomes"):
        OutcomeFile(path)


def test_tables_say_what_outcomes_come_to(tmp_path):
    kept = OutcomeFile(tmp_path / "p.jsonl")
    fault = replace(CASE, table=Table.FAULTS, fault="fragments")
    rows = [
        CaseResult(case_id=CASE, outcome=SERVED),
        CaseResult(case_id=fault, outcome=SERVED),
        CaseResult(case_id=REPLAY, outcome=REPLAYED),
    ]
    said = all_tables(kept.heading, rows)
    cells = "0.75 (0.8) | 1.2 % (1) | 0.25, 1.00, 0.25 | 100, 0, 100, 100 % | all | 0 | 100% |"
    assert f"| still; later people | 1 | {cells} -, -, -, - |" in said
    assert f"| made-up (100, 50) | still; later | 1 | {cells}" in said
    assert f"| fragments (pieces of 2 to 4 s) | still | 1 | {cells} 75% |" in said
    assert (
        "| made-up | pan by 2 deg | 0 | 1000 | 300 | 50% | 33% | 1 | none | 100, 50, 100, 100 | "
        "2.2 | 300 | 50 | 50% | +0.25 (0.50), +1.00 (0.50), +0.25 (0.50) |" in said
    )


def test_few_tracks_far_pans_and_how_reliable_moved_was(tmp_path):
    kept = OutcomeFile(tmp_path / "p.jsonl")
    few = replace(CASE, table=Table.FEW, seen=15)
    far = replace(CASE, table=Table.FAR, knock="pan-45")
    told = replace(SERVED, state="drifting", moved=0.95)
    unsure = replace(SERVED, state="unsure", moved=0.93)
    steady = replace(SERVED, state="ok", moved=0.91)
    rows = [
        CaseResult(case_id=few, outcome=steady),
        CaseResult(case_id=far, outcome=told),
        CaseResult(case_id=replace(far, knock="pan+45"), outcome=unsure),
        CaseResult(case_id=replace(far, seed=1), outcome=replace(told, used_tracks=29)),
    ]
    said = all_tables(kept.heading, rows)
    assert "| 15 | still | 1 | 0.75 (0.8) | 1.2 % (1) | 0.25, 1.00, 0.25 |" in said
    assert "| 2.0 | 0 | 1 | 0 | 0 | 0 |" in said  # worst sd; learning, ok, ...
    # Of 45 people each; a window of 29 is not counted.
    assert "| ±45 | 2 | 0 | 0 | 0 | 1 | 1 | 0.2 (0.2, 0) |" in said
    # Three had moved, one had not: 0.2 of the weight is the three's.
    mean = (0.2 * (0.95 + 0.93 + 0.95) / 3) + 0.8 * 0.91
    # That many would not have: of 0.2 that had, as the mean has it, each of 0.8.
    would = 0.2 * (1 - mean) / mean / 0.8
    assert f"| 0.9 to 1.0 | 3 | 1 | {would:.1f} | 0.20 | {mean:.2f} |" in said


def test_far_pans_of_which_none_was_told_have_a_row(tmp_path):
    """The quantile of nothing ended the study after all of its cases."""
    far = replace(CASE, table=Table.FAR, knock="pan+90")
    rows = [CaseResult(case_id=far, outcome=replace(SERVED, state="unsure", moved=0.93))]
    said = all_tables(OutcomeFile(tmp_path / "p.jsonl").heading, rows)
    assert "| ±90 | 1 | 0 | 0 | 0 | 1 | 0 | - |" in said


def test_names_are_counted_beside_the_right_ones(tmp_path):
    kept = OutcomeFile(tmp_path / "p.jsonl")
    slow = replace(CASE, table=Table.NAMES, fault="slow-clock-later")
    told = replace(SERVED, state="drifting", moved=0.99)
    clock = replace(told, cause="scale_changed")
    rows = [
        CaseResult(case_id=replace(CASE, knock="tilt-alone"), outcome=told),
        CaseResult(case_id=replace(CASE, knock="tilt-alone", seed=1), outcome=clock),
        CaseResult(case_id=replace(CASE, table=Table.FAR, knock="pan-45"), outcome=told),
        CaseResult(case_id=slow, outcome=clock),
        CaseResult(case_id=replace(slow, seed=1), outcome=replace(SERVED, state="suspected")),
        CaseResult(case_id=replace(slow, fault="zoom-later"), outcome=told),
    ]
    said = all_tables(kept.heading, rows)
    assert "| tilt alone | 2 | drift | 1 | 1 | 0 | 0 | 0 | 0 | 0 |" in said
    assert "| pan, far | 1 | drift | 1 | 0 | 0 | 0 | 0 | 0 | 0 |" in said
    assert "after the reference) | 2 | clock | 0 | 1 | 0 | 0 | 1 | 0 | 0 |" in said
    assert (
        "| zoom-later (by 15 %, after the reference) | 1 | lens | 1 | 0 | 0 | 0 | 0 | 0 | 0 |"
        in said
    )
    assert "The right name in 3 of 5 that are told of and have one" in said
    assert "the clock's or the lens's in 1 of 3 that moved" in said


def test_tables_are_put_between_the_markers_of_a_page(tmp_path):
    page = tmp_path / "README.md"
    begin, end = BETWEEN
    page.write_text(f"before\n{begin}old\n{end}after\n")
    write_between(page, BETWEEN, "new\n")
    write_between(page, BETWEEN, "newer\n")
    assert page.read_text() == f"before\n{begin}\nnewer\n\n{end}after\n"
    page.write_text("nothing here\n")
    with pytest.raises(ShapeError, match="once each"):
        write_between(page, BETWEEN, "new\n")


def write_street(folder: Path) -> Path:
    """A scene folder of 40 people on one street."""
    scene = scene_of([15.0 * n for n in range(40)])
    folder.mkdir()
    lens, pose = scene.intrinsics, scene.true_pose
    camera = {
        "id": "street", "frame_rate_hz": 2.5,
        "intrinsics": {
            "width": lens.width, "height": lens.height, "fx": lens.fx, "fy": lens.fy,
            "cx": lens.cx, "cy": lens.cy, "distortion": list(lens.distortion),
        },
        "true_pose": {
            "x_m": 0.0, "y_m": 0.0, "height_m": pose.height_m, "tilt_deg": 18.0, "roll_deg": 1.0,
            "heading_deg": 0.0,
        },
    }  # fmt: skip
    (folder / "camera.json").write_text(json.dumps(camera))
    lines = ["track_id,frame,time_s,u_px,v_px"]
    for n, track in enumerate(scene.tracks):
        walk = track.trajectory
        lines += [
            f"{n},{k},{t},{u + (n * k) % 3},{v + 4 * (n % 7)}"
            for k, (t, (u, v)) in enumerate(zip(walk.time_s, walk.uv, strict=True))
        ]
    (folder / "tracks.csv").write_text("\n".join(lines) + "\n")
    return folder


def test_tasks_share_their_reference_and_name_what_is_unknown(tmp_path):
    folder = write_street(tmp_path / "street")
    ask = {"tables": [Table.TIME], "seeds": [0, 1], "batch": 50, "faults": []}
    tasks = tasks_of([folder], **ask)
    # Halves in time are the same with every seed: a still camera is one case, not two.
    assert [len(task.case_ids) for task in tasks] == [7, 6]
    assert {each.seed for each in tasks[1].case_ids} == {1}
    assert len({each for task in tasks for each in task.case_ids}) == 13
    assert tasks_of([folder], **{**ask, "tables": [Table.REPLAYS]}) == []  # too short
    few = tasks_of([folder], **{**ask, "tables": [Table.FEW]})
    assert [task.case_ids[0].seen for task in few] == [8, 15, 20, 40] * 2
    (far,) = tasks_of([folder], **{**ask, "tables": [Table.FAR]})
    assert [c.knock for c in far.case_ids][:3] == ["pan+12", "pan-12", "pan+20"]
    assert len(far.case_ids) == 17  # half a turn is the same both ways
    with pytest.raises(ShapeError, match="got 'rain'"):
        tasks_of([folder], **{**ask, "faults": ["rain"]})


@pytest.mark.slow
def test_a_study_that_was_ended_goes_on_and_writes_its_page(tmp_path):
    folder = write_street(tmp_path / "street")
    page, output = tmp_path / "page.md", tmp_path / "p.jsonl"
    page.write_text("".join(BETWEEN))
    command = [
        sys.executable, "-m", "studies", "protocol", str(folder), "--tables", "people",
        "--seeds", "4", "--processes", "1", "--output", str(output), "--write", str(page),
    ]  # fmt: skip
    with (tmp_path / "log").open("w") as log:
        first = subprocess.Popen(command, stdout=log, stderr=log, env=os.environ.copy())
        end = time.monotonic() + 120
        while time.monotonic() < end and not (output.exists() and _lines(output) > 1):
            assert first.poll() is None, (tmp_path / "log").read_text()
            time.sleep(0.05)
        first.send_signal(signal.SIGTERM)
        first.wait(60)
    kept = _lines(output)
    assert 1 < kept <= 17
    second = subprocess.run(command, capture_output=True, text=True, check=False)
    assert second.returncode == 0, second.stderr
    rows = [json.loads(line) for line in output.read_text().splitlines()]
    assert len(rows) == 1 + 4 * 4
    asked = [json.dumps(row["asked"]) for row in rows[1:]]
    assert len(set(asked)) == 16  # none twice
    assert "random people" in page.read_text()


def _lines(path: Path) -> int:
    return path.read_text().count("\n")


@pytest.mark.parametrize(
    ("knock", "turned"), [("tilt-2", "tilt_rad"), ("roll-2", "roll_rad"), ("pan-2", "heading_rad")]
)
def test_a_long_replay_turns_one_angle_by_two_degrees_either_way(monkeypatch, knock, turned):
    knocks: list[PoseOffset] = []

    def replayed(scene, offset, *_):
        knocks.append(offset)
        return REPLAYED

    monkeypatch.setattr(tasks, "_cameras", lambda _: [None])
    monkeypatch.setattr(tasks, "replay", replayed)
    asked = tuple(replace(REPLAY, knock=knock, seed=seed) for seed in range(8))
    found = work(Task(folder=Path(), camera=0, case_ids=asked), plan=None)
    assert [each.outcome for each in found] == [REPLAYED] * 8
    sizes = {getattr(each, turned) for each in knocks}
    assert sizes == {math.radians(2), -math.radians(2)}
    assert all(replace(each, **{turned: 0.0}) == PoseOffset() for each in knocks)
