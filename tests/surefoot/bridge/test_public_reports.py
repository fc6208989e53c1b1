"""Messages of the shapes that public projects and reports show, with the values to be read."""

import json

import pytest

from surefoot.bridge import axis, deepstream, onvif
from surefoot.bridge.feeds import read_feeds
from surefoot.bridge.onvif import Profile
from surefoot.bridge.values import Detection, MessageError, SkippedRow


def onvif_xml(box, more="", kind='<tt:Type Likelihood="0.89">person</tt:Type>'):
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<tt:MetadataStream xmlns:tt="http://www.onvif.org/ver10/schema">\r\n<tt:VideoAnalytics>'
        f'<tt:Frame UtcTime="2026-11-20T08:00:00Z">{more}<tt:Object ObjectId="1"><tt:Appearance>'
        f"<tt:Class>{kind}</tt:Class><tt:Shape><tt:BoundingBox {box}/></tt:Shape>"
        "</tt:Appearance></tt:Object></tt:Frame></tt:VideoAnalytics></tt:MetadataStream>"
    ).encode()


UP = 'left="-0.5" top="0.2" right="-0.4" bottom="-0.3"'
DOWN = 'left="-0.5" top="-0.2" right="-0.4" bottom="0.3"'
SHARES = 'left="0.25" top="0.4" right="0.3" bottom="0.65"'
PLACE = (0.25, 0.4, 0.3, 0.65)


@pytest.mark.parametrize(
    ("profile", "box"),
    [
        (Profile.NORMALISED, UP),
        # A camera's open firmware documents -1, -1 as the upper left corner.
        (Profile.NORMALISED_DOWN, DOWN),
        (Profile.SHARES, SHARES),
    ],
)
def test_onvif_box_is_placed_by_its_profile(profile, box):
    (found,) = onvif.read_xml(onvif_xml(box), "yard", profile)
    assert found.box == pytest.approx(PLACE)


@pytest.mark.parametrize(
    ("profile", "box"),
    [
        (Profile.NORMALISED, DOWN),
        (Profile.NORMALISED, SHARES),
        (Profile.NORMALISED_DOWN, UP),
        (Profile.SHARES, UP),
    ],
)
def test_onvif_box_of_another_profile_is_skipped_and_not_turned_upside_down(profile, box):
    """Specifications before 20.12 swapped top and bottom in their examples (onvif/specs#33)."""
    (found,) = onvif.read_xml(onvif_xml(box), "yard", profile)
    assert isinstance(found, SkippedRow)
    assert "top above bottom are needed" in found.detail


def test_onvif_of_a_hanwha_camera_in_pixels_of_its_sensor():
    more = (
        '<tt:Transformation><tt:Translate x="-1.0" y="1.0"/>'
        '<tt:Scale x="0.000772" y="-0.001316"/></tt:Transformation>'
    )
    kind = (
        "<tt:ClassCandidate><tt:Type>Face</tt:Type><tt:Likelihood>0.41</tt:Likelihood>"
        '</tt:ClassCandidate><tt:Type Likelihood="0.41">Face</tt:Type>'
    )
    box = 'left="891.0" top="196.0" right="1361.0" bottom="716.0"'
    (found,) = onvif.read_xml(onvif_xml(box, more, kind), "yard", Profile.TRANSFORMED)
    assert found.box == pytest.approx((0.3439, 0.1290, 0.5253, 0.4711), abs=1e-4)
    assert found.label == "Face"


def test_onvif_class_with_its_likelihood_as_an_element():
    kind = "<tt:Type>Car</tt:Type><tt:Likelihood>0.92</tt:Likelihood>"
    (found,) = onvif.read_xml(onvif_xml(UP, kind=kind), "yard", Profile.NORMALISED)
    assert found.label == "Car"


def test_onvif_json_without_marks_of_attributes():
    kind = {"Type": [{"$": "Human", "Likelihood": 0.8}, {"$": "Vehicle", "Likelihood": 0.2}]}
    box = {"left": -0.5, "top": 0.2, "right": -0.4, "bottom": -0.3}
    seen = {"ObjectId": 0, "Appearance": {"Shape": {"BoundingBox": box}, "Class": kind}}
    head = {"ObjectId": 1, "Parent": 0, "Appearance": {"Shape": {"BoundingBox": box}}}
    frame = {"UtcTime": "2026-11-20T08:00:00Z", "Object": [seen, head], "Source": "m"}
    message = json.dumps({"Frame": [frame]}).encode()
    (found,) = onvif.read_json(message, "yard", Profile.NORMALISED)
    assert (found.track_id, found.label) == ("0", "Human")
    assert found.box == pytest.approx(PLACE)


def test_onvif_event_of_a_rule_is_rejected_by_name():
    """Topics of Bosch's `onvif-ej` have counters and rules, no frames."""
    event = b'{"UtcTime": "2026-11-20T08:00:00Z", "Source": {"Rule": "1"}, "Data": {"Count": "4"}}'
    with pytest.raises(MessageError, match="a Frame is needed, got Count, Data, Rule, Source"):
        onvif.read_json(event, "yard", Profile.NORMALISED)


@pytest.mark.parametrize("wrapped", [True, False])
def test_axis_beta_frame_with_and_without_its_wrapper(wrapped):
    """The documentation of Metadata Broker 0.23 has `data`, devices have not."""
    observation = {
        "track_id": "1",
        "bounding_box": {"bottom": 0.9, "left": 0.1, "right": 0.8, "top": 0.6},
        "class": {"type": "Face", "score": 0.6},
    }
    frame = {"timestamp": "2026-11-20T08:00:00.5Z", "observations": [observation]}
    document = {"frame": frame | {"operations": []}}
    message = json.dumps({"data": document} if wrapped else document).encode()
    (found,) = axis.read_message(message, {1: "yard"})
    assert (found.box, found.label) == ((0.1, 0.6, 0.8, 0.9), "Face")
    assert found.time_s == 1_795_161_600.5


def test_axis_detection_without_a_class_and_frame_without_detections():
    box = {"bottom": 0.9853, "left": 0.4499, "right": 0.7473, "top": 0.2365}
    document = {
        "channel_id": 1,
        "timestamp": "2026-11-20T08:00:00.369150Z",
        "detections": [{"bounding_box": box, "object_track_id": "8e653185-8e54"}],
    }
    (found,) = axis.read_message(json.dumps(document).encode(), {1: "yard"})
    assert found.label is None
    document |= {"detections": [], "synthetic": True}
    assert axis.read_message(json.dumps(document).encode(), {1: "yard"}) == []


@pytest.mark.parametrize(
    ("message", "needed"),
    [
        # A camera's status, by the same broker (home-assistant/core#167194).
        ({"timestamp": 1775115420, "host": "h", "temperature": {"temp_main": 23.5}}, "got the fie"),
        # Paths of an application of its own, in thousandths, with times in milliseconds.
        (
            {"class": "Human", "path": [{"x": 512, "y": 900, "d": 1.2}], "timestamp": 1.7e12},
            "channel_id of axis.scene.object_track_v1: a number is needed",
        ),
    ],
)
def test_axis_message_of_another_kind_is_rejected_by_name(message, needed):
    with pytest.raises(MessageError, match=needed):
        axis.read_message(json.dumps(message).encode(), {1: "yard"})


def deepstream_full(**changes):
    box = {"topleftx": 100, "toplefty": 200, "bottomrightx": 300, "bottomrighty": 400}
    seen = {"id": "1", "speed": 0, "vehicle": {"type": "car"}, "bbox": box, "location": {}}
    document = {
        "@timestamp": "2026-11-20T08:00:00.000Z",
        "sensor": {"id": "CAMERA_001"},
        "object": seen | changes,
    }
    return deepstream.read_message(
        json.dumps(document).encode(), lambda name: name.lower().replace("_", "-"), (1920, 1080)
    )


def test_deepstream_full_schema_of_a_vehicle():
    (found,) = deepstream_full()
    assert isinstance(found, Detection)
    assert (found.camera, found.label, found.box) == ("camera-001", "vehicle", (100, 200, 300, 400))


def test_deepstream_box_without_an_area_is_rejected():
    """Its converter without the object's metadata (deepstream-occupancy-analytics#31)."""
    zeros = {"topleftx": 0, "toplefty": 0, "bottomrightx": 0, "bottomrighty": 0}
    with pytest.raises(MessageError, match=r"object/bbox: .* got 0, 0, 0, 0"):
        deepstream_full(bbox=zeros)


@pytest.mark.parametrize("profile", Profile)
def test_feed_of_each_onvif_profile_can_be_set(profile):
    (feed,) = read_feeds(f"onvif-{profile}:cams/+/meta")
    assert feed.source == "onvif"
