"""Layouts of public trackers and data sets: recognised, or asked about."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from surefoot.people import read_classes
from surefoot.tabular.choice import read_layout
from surefoot.tabular.layouts import LAYOUTS, LayoutError
from surefoot.tabular.reader import Options, read_table

# A person, and what else is tracked: walks of 30 frames from frame 1.
BOX = (300.0, 150.0, 60.0, 180.0)  # left, top, width, height; pixels from 0
FOOT = (330.0, 330.0)


def table(line, *others, header=None, frames=30, first=1):
    """Lines of a format; each of `others` is a format of another track, 100 px to the right."""
    lines = [] if header is None else [header]
    for n in range(frames):
        for at, form in enumerate((line, *others)):
            left, top, wide, tall = BOX[0] + 3 * n + 100 * at, *BOX[1:]
            lines.append(
                form.format(
                    f=n + first, i=7 + at, n=len(lines), l=left, t=top, w=wide, h=tall,
                    l1=left + 1, t1=top + 1, r=left + wide, b=top + tall,
                    cx=left + wide / 2, cy=top + tall / 2, s=1.7e9 + n / 25,
                )
            )  # fmt: skip
    return "\n".join(lines).encode()


MOT = "{f},{i},{l1},{t1},{w},{h}"
KITTI = " 0 0 -10 {l} {t} {r} {b} -10 -10 -10 -1000 -1000 -1000 -10"
# By name: the table, people, skipped tracks.
KNOWN = {
    "MOTChallenge 2015, SORT, ByteTrack, OC-SORT, MMTracking": (
        table(MOT + ",0.9,-1,-1,-1"), 1, {},
    ),
    "FairMOT, DeepSORT": (table(MOT + ",1,-1,-1,-1"), 1, {}),
    "Norfair, detections of MOTChallenge": (table(MOT + ",-1,-1,-1,-1"), 1, {}),
    "MOTChallenge with places in the world": (table(MOT + ",1,{cx:.2f},3.25,0"), 1, {}),
    "StrongSORT of yolov5: blanks, an index of the video last": (
        table((MOT + ",-1,-1,-1,0").replace(",", " ") + " "), 1, {},
    ),
    "six columns": (table(MOT), 1, {}),
    "six columns with commas at the ends of lines": (table(MOT + ","), 1, {}),
    "ground truth of MOT17": (
        table(MOT + ",1,1,0.86", MOT + ",0,3,1", MOT + ",0,7,0.2"), 1,
        {"not_a_person": 1, "ignored_by_confidence": 1},
    ),
    "BoxMOT": (table(MOT + ",0.9,0,-1", MOT + ",0.9,1,-1"), 1, {"not_a_person": 1}),
    "BoxMOT by np.savetxt": (
        table("{f:.18e} {i:.18e} {l1:.18e} {t1:.18e} {w:.18e} {h:.18e} 9.0e-01 0.0e+00 -1.0e+00"),
        1, {},
    ),
    "confidence last": (table(MOT + ",1,0,0.5", MOT + ",1,7,0.6"), 1, {"not_a_person": 1}),
    "MCMOT with a score": (table(MOT + ",0.8,0,1", MOT + ",0.8,3,1"), 1, {"not_a_person": 1}),
    "eight columns": (table(MOT + ",0.9,0", MOT + ",0.9,2"), 1, {"not_a_person": 1}),
    "MCMOT": (table(MOT + ",0.9,0,-1,-1", MOT + ",0.9,2,-1,-1"), 1, {"not_a_person": 1}),
    "ground truth of VisDrone": (
        table(MOT + ",1,1,0,0", MOT + ",1,2,1,1", MOT + ",1,4,0,2"), 2, {"not_a_person": 1},
    ),
    "class names in column 8": (
        table(MOT + ",0.9,person", MOT + ",0.9,car"), 1, {"not_a_person": 1},
    ),
    "class names in column 7": (table(MOT + ",pedestrian", MOT + ",bus"), 1, {"not_a_person": 1}),
    "KITTI tracking, FairMOT's other format": (
        table("{f} {i} Pedestrian" + KITTI, "{f} {i} Cyclist" + KITTI, "{f} -1 DontCare" + KITTI),
        1, {"not_a_person": 1, "no_track_id": 1},
    ),
    "Stanford Drone Dataset": (
        table('{i} {l} {t} {r} {b} {f} 0 0 0 "Pedestrian"', '{i} {l} {t} {r} {b} {f} 0 0 0 "Biker"',
              '{i} {l} {t} {r} {b} {f} 1 0 0 "Pedestrian"'),
        1, {"not_a_person": 1, "ignored_by_confidence": 1},
    ),
    "Oxford Town Centre": (
        table("{i},{f},1,1,{l},{t},{r},{t},{l},{t},{r},{b}"), 1, {},
    ),
    "AI City Challenge": (table("3 {i} {f} {l} {t} {w} {h} 1.25 -7.5"), 1, {}),
    "corners, then sides": (table("{f},{i},{l},{t},{r},{b},{w},{h}"), 1, {}),
    "supervision": (
        table("{l},{t},{r},{b},0,0.9,{i},{f}", "{l},{t},{r},{b},2,0.9,{i},{f}",
              "{l},{t},{r},{b},0,0.9,,{f}",
              header="x_min,y_min,x_max,y_max,class_id,confidence,tracker_id,frame_index"),
        1, {"not_a_person": 1, "no_track_id": 1},
    ),
    "a data frame with its index": (
        table("{n},{f},{i},{l1},{t1},{w},{h},0.9,person",
              header=",frame,track_id,bb_left,bb_top,bb_width,bb_height,conf,class_name"), 1, {},
    ),
    "R's write.table": (
        table('"{n}" {f} {i} {l1} {t1} {w} {h}', header='"frame" "id" "l" "t" "w" "h"'),
        1, {},
    ),
    "an index without a header": (
        table(*["{n},{f},{i},{l1},{t1},{w},{h},0.9,-1,-1,-1"] * 3),
        3, {},
    ),
    "a header of CVAT's names": (
        table("{f},{i},{l},{t},{r},{b},pedestrian", header="frame,track,xtl,ytl,xbr,ybr,label"),
        1, {},
    ),
    "a header in another order": (
        table("{b};{r};{t};{l};{i};{s:.3f}", header="Bottom;Right;Top;Left;Object ID;Time (s)"),
        1, {},
    ),
    "a header with commas for points": (
        table("{f};{i};300,0;150,0;360,0;330,0", header="frame;id;x1;y1;x2;y2"), 1, {},
    ),
    "a header of corners from 0": (
        table("{f}\t{i}\t{l}\t{t}\t{r}\t{b}", header="frame\tid\tx0\ty0\tx1\ty1"), 1, {},
    ),
    "a header of centres": (
        table("{f},{i},{cx},{cy},{w},{h}", header="frame,id,x_center,y_center,width,height"), 1, {},
    ),
    "a header of corners and sides": (
        table("{f},{i},{l},{t},{r},{b},{w},{h}", header="frame,id,x1,y1,x2,y2,w,h"), 1, {},
    ),
    "feet": (table("{s:.3f},{i},{cx},{b}", header="time_s,id,foot_x,foot_y"), 1, {}),
    "milliseconds by their name": (
        table("{s:.3f}e3,{i},{cx},{b}", header="timestamp_ms,track_id,u_px,v_px"), 1, {},
    ),
    "a comment above": (table(MOT + ",1", header="# frame,id,left,top,width,height,conf"), 1, {}),
}  # fmt: skip


def read(body, **options):
    return read_table(body, Options(frame_rate_hz=25.0, started_at_s=1.7e9, **options))


def foot(rows):
    return ((rows[0, 1] + rows[0, 3]) / 2, rows[0, 4]) if rows.shape[1] == 5 else rows[0, 1:]


@pytest.mark.parametrize("name", KNOWN, ids=str)
def test_public_layout_is_recognised_with_right_feet(name):
    body, people, skipped = KNOWN[name]
    found = read(body)
    assert (len(found.rows), dict(found.skipped)) == (people, skipped)
    assert found.broken == {}
    rows = found.rows["7"]
    np.testing.assert_allclose(foot(rows), FOOT, atol=1e-6)
    assert len(rows) == 30
    np.testing.assert_allclose(np.diff(rows[:, 0]), 1 / 25, atol=1e-6)


# Tables with several readings: for each choice, people and the first foot.
UNCLEAR = {
    "ground truth of DanceTrack and SportsMOT, or an export of CVAT": (
        table(MOT + ",1,1,1"),
        {"mot-gt": {"layout": "mot-gt"}, "cvat": {"layout": "cvat", "classes": "1"}}, 1, FOOT,
    ),
    "ground truth, or a confidence last": (
        table(MOT + ",1,1,0.5", MOT + ",1,7,0.6"),
        {"mot-gt": {"layout": "mot-gt"}, "conf-last": {"layout": "conf-last", "classes": "1,7"}},
        2, FOOT,
    ),
    "MCMOT, or results of VisDrone": (
        table(MOT + ",0.9,1,-1,-1", MOT + ",0.9,2,-1,-1"),
        {"mcmot": {"layout": "mcmot", "classes": "1,2"}, "visdrone": {"layout": "visdrone"}},
        2, FOOT,
    ),
    "corners without a header": (
        table("{f},{i},{l},{t},{r},{b},0.9"),
        {"corners": {"layout": "corners"}, "layout=": {"layout": "frame,id,x1,y1,x2,y2,conf"}},
        1, FOOT,
    ),
    "corners in MOTChallenge's ten columns": (
        table("{f},{i},{l},{t},{r},{b},0.9,-1,-1,-1"),
        {"frame,id,left,top,right,bottom,conf,-,-,-":
         {"layout": "frame,id,left,top,right,bottom,conf,-,-,-"}}, 1, FOOT,
    ),
    "a class in column 7": (
        table(MOT + ",0,-1,-1,-1", MOT + ",2,-1,-1,-1"),
        {"column 7 is the class": {"layout": "frame,id,left,top,width,height,class,-,-,-"}},
        1, FOOT,
    ),
    "x and y beside width and height": (
        table("{f},{i},{cx},{cy},{w},{h}", header="frame,id,x,y,w,h"),
        {"centre_u": {"layout": "frame,id,xc,yc,w,h"},
         "left,top": {"layout": "frame,id,centre_u,centre_v,width,height"}}, 1, FOOT,
    ),
    "an export of CVAT with many labels": (
        table(MOT + ",1,14,1", MOT + ",1,15,0"), {"classes=1": {"classes": "14"}}, 1, FOOT,
    ),
    "the id before the frame": (
        table("{i},{f},{l1},{t1},{w},{h},1", "{i},{f},{l1},{t1},{w},{h},1"),
        {"column 2 is the frame": {"layout": "id,frame,left,top,width,height,conf"}}, 2, FOOT,
    ),
    "class numbers from 1": (
        table(MOT + ",0.9,1", MOT + ",0.9,3"),
        {"classes=0 or classes=1": {"classes": "1"}}, 1, FOOT,
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", UNCLEAR, ids=str)
def test_table_with_two_readings_names_both_and_takes_the_choice(name):
    body, choices, people, first = UNCLEAR[name]
    with pytest.raises(LayoutError) as asked:
        read(body)
    for named, chosen in choices.items():
        assert named in asked.value.reason
        classes = read_classes(chosen["classes"]) if "classes" in chosen else None
        found = read(body, layout=chosen.get("layout"), classes=classes)
        assert len(found.rows) == people
        np.testing.assert_allclose(foot(found.rows["7"]), first, atol=1e-6)


@pytest.mark.parametrize(
    ("layout", "line", "reason"),
    [
        ("mot-gt", MOT + ",0.9,0,-1", "mot-gt (MOTChallenge ground truth"),
        ("mot", MOT + ",0.9,0", "does not fit the values"),
        ("boxmot", MOT + ",0.9", "boxmot has 8 to 9 columns; the table has 7"),
        ("visdrone", MOT + ",0.9,50,-1,-1", "does not fit the values"),
        ("corners", MOT + ",0.9", "corners (columns 5 and 6"),
        ("kitti", MOT + ",0.9", "kitti has 17 to 18 columns; the table has 7"),
        ("frame,id,x1,y1,x2,y2", MOT + ",0.9", "has 6 columns; the table has 7"),
        ("frame,id,x1,y1,x2", MOT + ",0.9", "missing left,top,width,height or x1,y1"),
        ("frame,id,id,x1,y1,x2,y2", MOT, "column id comes twice"),
        ("frame,id,x1,y1,x2,y2,colour", MOT + ",1", "unknown column 'colour'"),
        ("yolo", MOT, "must be one of mot, mot-gt"),
    ],
)
def test_given_layout_that_does_not_fit_is_refused(layout, line, reason):
    with pytest.raises(LayoutError, match="^.") as refused:
        read(table(line), layout=layout)
    assert refused.value.field == "layout"
    assert reason in refused.value.reason


def test_given_layout_that_contradicts_the_header_is_refused():
    body = table("{f},{i},{l},{t},{r},{b}", header="frame,id,x1,y1,x2,y2")
    with pytest.raises(LayoutError, match="column 5 is right by the header and width by"):
        read(body, layout="mot")


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (b"1 7 300 300\n2 7 300 300\n", "line 1 has 4 columns separated by blanks; at least 6"),
        (table("{f},{i},{l},{t},oops,{h}"), "line 1: column 5 must be a number; got '1,7,300.0"),
        (table(MOT + ",1,0.5"), "the 8 columns fit no known layout"),
        (table(MOT + ",1,2,3,4,5"), "the 11 columns fit no known layout"),
        (table("{f},{i},{l},{t}", header="frame,id,u,v,w"), "the header has 5 columns, the lines"),
        (table("{f},{i}", header="frame,id"), "header: missing left,top,width,height or"),
        (table("{l},{t},{r},{b},0", header="x1,y1,x2,y2,conf"), "missing id and frame or time_s"),
    ],
)  # fmt: skip
def test_table_that_cannot_be_read_is_answered_with_what_is_missing(body, reason):
    with pytest.raises(LayoutError) as refused:
        read(body)
    assert reason in refused.value.reason


def test_frames_need_a_rate_and_a_start():
    with pytest.raises(LayoutError) as refused:
        read_table(table(MOT), Options(started_at_s=0.0))
    assert (refused.value.field, refused.value.reason) == (
        "frame_rate_hz", "is needed, because the table has frame numbers, not times",
    )  # fmt: skip


@pytest.mark.parametrize(
    "body", [b"", b"\r" * 64, b"\n\n", b" \t\n \r\n", b"\xef\xbb\xbf\n", b"#\n"]
)
def test_text_without_lines_has_no_tracks(body):
    found = read(body)
    assert (len(found.rows), len(found.broken)) == (0, 0)


def test_line_with_another_number_of_columns_costs_its_own_track():
    body = table(MOT + ",1", MOT + ",1") + b"\n31,8,1,1"
    found = read(body)
    assert list(found.broken) == ["8"]
    assert "7 columns separated by commas" in found.broken["8"]
    assert len(found.rows["7"]) == 30


def test_every_layout_has_a_name_that_reads_it():
    for layout in LAYOUTS:
        assert read_layout(layout.name) is layout
        assert layout.fewest <= max(len(layout.columns), 18)


@given(st.data())
def test_bytes_that_were_changed_are_read_or_refused(data):
    body = data.draw(st.sampled_from([*KNOWN.values(), *UNCLEAR.values()]))[0][:600]
    for _ in range(data.draw(st.integers(1, 5))):
        at, length = data.draw(st.integers(0, len(body))), data.draw(st.integers(0, 4))
        odd = [b",", b";", b"\t", b" ", b"\n", b"\r", b"nan", b"inf", b"1e999", b'"', b"\xff", b"#"]
        body = body[:at] + data.draw(st.sampled_from(odd)) + body[at + length :]
    layout = data.draw(st.sampled_from([None, *(each.name for each in LAYOUTS)]))
    try:
        found = read(body, layout=layout)
    except LayoutError:
        return
    assert all(len(rows) or name in found.broken for name, rows in found.rows.items())
