"""The same detections through every door: equal counts, and equal feet."""

import csv
import io
import json
from email.message import Message
from typing import Any

import numpy as np
import pytest
from sqlalchemy import select

import surefoot
from service.store.engines.store import Store
from service.store.tracks import TrackRecord, unpack
from surefoot import client as client_module
from surefoot.bridge.assembler import Assembler
from surefoot.bridge.feeds import Topics
from surefoot.bridge.rows import Clock, read_supervision_csv
from surefoot.bridge.values import body_of
from surefoot.client import Client
from tests.conftest import SCENES

T0 = 1_700_000_000.0
SIZE = (1280.0, 720.0)
FIELD = SCENES.parent / "field"
NO_CLASS: dict[str, Any] = {}


def walk(name, label=NO_CLASS, confidence=NO_CLASS, count=6, start=0.0, left=300.0, **changes):
    """Detections of one person: a dict for each, with the class and confidence as given."""
    rows = []
    for n in range(count):
        x = left + 9.0 * n
        row = {"time_s": T0 + start + 0.5 * n, "id": name, "box": [x, 100.0, x + 60.0, 300.0 + n]}
        for key, value in (("class", label), ("confidence", confidence)):
            if value is not NO_CLASS:
                row[key] = value
        rows.append(row | changes.get(f"at_{n}", {}))
    return rows


def beside(*rows, label=NO_CLASS):
    """The detections, and a person's; `label` is that person's class."""
    return [*(row for part in rows for row in part), *walk("p", label, left=700.0)]


PERSONS = [0, 0.0, "0", "0.0", "person", "Person", "PEDESTRIAN", "human", " people ", "woman", -1]
OTHERS = [2, "2", 7.0, "car", "Rider", "cyclist", "bicycle", "truck", "dog", "face", "head", 16]
NONE = [None, "", "none"]


def of_kind(label):
    return "person" if isinstance(label, str) and not label.strip()[:1].isdigit() else 0


PERSON_CASES = {
    f"class {label!r}": (beside(walk("a", label), label=of_kind(label)), 2, {}, 0)
    for label in (*PERSONS, *NONE)
}
OTHER_CASES = {
    f"class {label!r}": (
        beside(walk("a", label), label=of_kind(label)), 1, {"not_a_person": 1}, 0,
    )
    for label in OTHERS
}  # fmt: skip
CAR = {"class": "car"}
CASES = {
    **PERSON_CASES,
    **OTHER_CASES,
    "no class": (beside(walk("a")), 2, {}, 0),
    "cars only": (walk("a", 2), 0, {"not_a_person": 1}, 0),
    "two cars": (beside(walk("a", "car"), walk("b", "bus")), 1, {"not_a_person": 2}, 0),
    "confidence 0": (
        beside(walk("a", 0, 0), label=0), 1, {"ignored_by_confidence": 1}, 0,
    ),
    "confidence 0.0 of no class": (
        beside(walk("a", confidence=0.0)), 1, {"ignored_by_confidence": 1}, 0,
    ),
    "confidence 0 of a car": (
        beside(walk("a", 2, 0), label=0), 1, {"not_a_person": 1}, 0,
    ),
    "confidence 0.01": (beside(walk("a", 0, 0.01), label=0), 2, {}, 0),
    "confidence -1": (beside(walk("a", 0, -1), label=0), 2, {}, 0),
    "too short": (beside(walk("a", count=3)), 1, {}, 1),
    "too brief": (beside(walk("a", count=4)), 1, {}, 1),
    "a short car": (beside(walk("a", "car", count=2), label="person"), 1, {"not_a_person": 1}, 0),
    "a name as an id": (beside(walk("b c")), 2, {}, 0),
    "out of order": (beside(list(reversed(walk("a")))), 2, {}, 0),
    "a long walk": (beside(walk("a", count=50)), 2, {}, 0),
    "a detector that changes its mind": (
        beside(walk("a", "person", count=9, at_4=CAR), label="person"), 2, {}, 0,
    ),
}  # fmt: skip


def stored(settings, source):
    with Store(settings).read() as session:
        query = select(TrackRecord).where(TrackRecord.source == source)
        return {each.track_id: unpack(each.points, 3) for each in session.scalars(query)}


def answered(answer):
    document = answer.json()
    if document.get("code") == "nothing_taken":
        return 0, {}, len(document["errors"])
    assert answer.status_code == 202, answer.text
    return document["accepted"], document.get("skipped", {}), len(document["rejected"])


def as_json(rows):
    """The bodies' tracks: the class of a track is that of its first person, if it has one."""
    tracks: dict[str, Any] = {}
    for row in sorted(rows, key=lambda row: row["time_s"]):
        track = tracks.setdefault(row["id"], {"id": row["id"], "boxes": []})
        if row.get("class") == "car" and track.get("class") == "person":
            continue
        track["boxes"].append([row["time_s"], *row["box"]])
        track |= {key: row[key] for key in ("class", "confidence") if key in row}
    return list(tracks.values())


def as_table(rows):
    text = io.StringIO()
    out = csv.writer(text)
    out.writerow(["time_s", "track_id", "x1", "y1", "x2", "y2", "class", "confidence"])
    for row in rows:
        label = "" if row.get("class") is None else row["class"]
        confidence = "" if row.get("confidence") is None else row["confidence"]
        out.writerow([f"{row['time_s']:.3f}", row["id"], *row["box"], label, confidence])
    return text.getvalue().encode()


def as_sink(rows):
    """A CSVSink's file of supervision; its detector's names are in `class_name`."""
    names = any(isinstance(row.get("class"), str) for row in rows)
    text = io.StringIO()
    out = csv.writer(text)
    kind = "class_name" if names else "class_id"
    head = ["x_min", "y_min", "x_max", "y_max", kind, "confidence", "tracker_id", "time_s"]
    out.writerow(head)
    for row in rows:
        label = "" if row.get("class") is None else row["class"]
        confidence = "" if row.get("confidence") is None else row["confidence"]
        out.writerow([*row["box"], label, confidence, row["id"], f"{row['time_s']:.3f}"])
    return text.getvalue().encode()


def post(http, source, body, kind="application/json"):
    return http.post(
        "/cameras/corner/tracks", params={"source": source}, content=body,
        headers={"Content-Type": kind},
    )  # fmt: skip


def post_found(http, source, found):
    """What the bridge posts of detections."""
    assembler = Assembler()
    for each in found:
        assembler.add(each, each.time_s)
    assembler.finish_all()
    tracks = assembler.take()
    assert len({track.head(source) for track in tracks}) == 1
    return post(http, source, body_of(tracks[0].head(source), [one.to_json() for one in tracks]))


def through_json(http, source, rows, _):
    return answered(
        post(http, source, json.dumps({"source": source, "tracks": as_json(rows)}).encode())
    )


def through_lines(http, source, rows, _):
    body = "\n".join(map(json.dumps, as_json(rows))).encode()
    return answered(post(http, source, body, "application/x-ndjson"))


def through_topic(http, source, rows, _):
    topics = Topics(prefix="surefoot", frigate=None, cameras={})
    message = json.dumps({"source": source, "tracks": as_json(rows)}).encode()
    body = topics.read("surefoot/corner/tracks", message)
    assert body.camera == "corner"
    return answered(post(http, source, body.content))


def through_frames(http, source, rows, _):
    topics = Topics(prefix="surefoot", frigate=None, cameras={})
    found = []
    for row in sorted(rows, key=lambda row: row["time_s"]):
        seen = {key: row[key] for key in ("id", "box", "class", "confidence") if key in row}
        message = {"time_s": row["time_s"], "size": SIZE, "detections": [seen]}
        found += topics.read("surefoot/corner/frames", json.dumps(message).encode())[1]
    return answered(post_found(http, source, found))


def through_sink(http, source, rows, _):
    clock = Clock(column="time_s")
    found = read_supervision_csv(as_sink(rows), "corner", clock, SIZE)
    return answered(post_found(http, source, sorted(found, key=lambda one: one.time_s)))


def through_client(http, source, rows, tmp_path):
    asked = []

    def ask(_, content):
        answer = post(http, source, content)
        asked.append(answer)
        return answer.status_code, Message(), answer.content

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(client_module, "_TICK_S", 0.01)
        patch.setattr(Client, "_ask", ask)
        with Client("http://x", "corner", source=source, spool=tmp_path / source) as client:
            for row in sorted(rows, key=lambda row: row["time_s"]):
                client.add(row["id"], row["box"], row["time_s"], label=row.get("class"))
    counts = [answered(answer) for answer in asked]
    if all(answer.status_code == 202 for answer in asked):
        assert client.posted["accepted"] == sum(one[0] for one in counts)
        assert dict(client.skipped) == {k: v for one in counts for k, v in one[1].items()}
    (count,) = counts
    return count


def through_table(http, source, rows, _):
    return answered(post(http, source, as_table(rows), "text/csv"))


def through_posted_sink(http, source, rows, _):
    return answered(post(http, source, as_sink(rows), "text/csv"))


DOORS = {
    "json": through_json,
    "ndjson": through_lines,
    "topic": through_topic,
    "frames": through_frames,
    "sink": through_sink,
    "table": through_table,
    "posted-sink": through_posted_sink,
}


def in_python(body, tmp_path, **given):
    path = tmp_path / "tracks.csv"
    path.write_bytes(body)
    found = surefoot.read_tracks(path, **given)
    counts = (len(found), found.skipped, sum(found.rejected.values()))
    feet = sorted(each.uv.round(6).tolist() for each in found)
    return counts, feet


def feet_of(settings, source):
    return sorted(points[:, 1:].round(6).tolist() for points in stored(settings, source).values())


@pytest.mark.parametrize("case", CASES, ids=str)
def test_same_detections_have_same_answer_through_every_door(corner, settings, tmp_path, case):
    rows, accepted, skipped, rejected = CASES[case]
    expected = (accepted, skipped, rejected)
    feet = None
    for door, through in DOORS.items():
        assert through(corner, door, rows, tmp_path) == expected, door
        found = feet_of(settings, door)
        assert feet is None or found == feet, door
        feet = found
    for body in (as_table(rows), as_sink(rows)):
        assert in_python(body, tmp_path) == (expected, feet)
    # The client takes no confidences, and a track has the class of most of its detections.
    if not any("confidence" in row for row in rows) and "mind" not in case and "order" not in case:
        assert through_client(corner, "client", rows, tmp_path) == expected
        assert feet_of(settings, "client") == feet


WALK = [(1 + 12 * n, 300 + 9 * n, 100, 60, 200 + n) for n in range(6)]


def text(line, others=(), header=None):
    """A table of a person, by a format of frame, left, top, width and height, and of others."""
    lines = [] if header is None else [header]
    for frame, left, top, width, height in WALK:
        for form, track, shift in ((line, 7, 0), *others):
            lines.append(
                form.format(
                    f=frame, i=track, l=left + shift, t=top, w=width, h=height,
                    r=left + shift + width, b=top + height,
                )
            )  # fmt: skip
    return "\n".join(lines).encode()


BOX = "{f},{i},{l},{t},{w},{h}"
TEXTS = {
    "six columns": text(BOX),
    "confidence": text(BOX + ",0.9"),
    "ten columns": text(BOX + ",0.9,-1,-1,-1"),
    "boxmot": text(BOX + ",0.9,0,-1", [(BOX + ",0.9,2,-1", 8, 50)]),
    "confidence last": text(BOX + ",1,0,0.5", [(BOX + ",1,7,0.6", 8, 50)]),
    "ground truth": text(BOX + ",1,1,0.5", [(BOX + ",0,3,0.6", 8, 50)]),
    "mcmot": text(BOX + ",0.9,0,-1,-1", [(BOX + ",0.9,1,-1,-1", 8, 50)]),
    "visdrone": text(BOX + ",1,1,0,0", [(BOX + ",1,4,1,2", 8, 50)]),
    "tabs": text(BOX.replace(",", "\t") + "\t0.9"),
    "blanks": text(BOX.replace(",", "  ") + " 0.9"),
    "ignored": text(BOX + ",1,-1,-1,-1", [(BOX + ",0,-1,-1,-1", 8, 50)]),
    "broken": text(BOX + ",1,-1,-1,-1", [("{f},8,oops,{t},{w},{h},1,-1,-1,-1", 8, 50)]),
    "header of corners": text("{f},{i},{l},{t},{r},{b}", header="frame,id,x1,y1,x2,y2"),
}


def test_texts_and_cases_are_thirty_and_more():
    assert len(TEXTS) + len(CASES) > 50


@pytest.mark.parametrize("name", TEXTS, ids=str)
def test_text_has_same_answer_by_http_and_in_python(corner, settings, tmp_path, name):
    answer = corner.post(
        "/cameras/corner/tracks",
        params={"started_at": "2023-11-14T22:13:20Z", "frame_rate_hz": 25, "source": "t"},
        content=TEXTS[name],
        headers={"Content-Type": "text/csv"},
    )
    counts, feet = in_python(TEXTS[name], tmp_path, frame_rate_hz=25, started_at_s=T0)
    assert answered(answer) == counts
    assert counts[0] == 1
    assert feet_of(settings, "t") == feet
    first = 0.0 if "corners" in name else 1.0
    np.testing.assert_allclose(feet[0][0], [330.0 - first, 300.0 - first])
