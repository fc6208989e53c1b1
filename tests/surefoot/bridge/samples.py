"""A small message of each source, made by its specification, and one way to read each."""

from surefoot.bridge import axis, deepstream, frames, frigate, onvif, rows
from surefoot.bridge.onvif import Profile
from surefoot.bridge.rows import Clock

# developer.axis.com, Analytics Data Format, Frame 1.0
AXIS = b"""{"channel_id": 1, "timestamp": "2026-11-20T08:00:00.250000Z",
 "detections": [
  {"object_track_id": "a1b2", 
   "bounding_box": {"left": 0.25, "top": 0.5, "right": 0.3, "bottom": 0.75},
   "class": {"type": "Human", "score": 0.83}},
  {"object_track_id": "radar", "class": {"type": "Human", "score": 0.4}}],
 "track_events": [{"type": "TrackEnded", "object_track_id": "c3"},
  {"type": "Rename", "from_id": "d4", "to_id": "a1b2"}]}"""

# The same, beta: com.axis.analytics_scene_description.v0.beta
AXIS_BETA = b"""{"frame": {"timestamp": "2026-11-20T08:00:00.250000Z", "observations": [
  {"track_id": "7", "timestamp": "2026-11-20T08:00:00.250000Z",
   "bounding_box": {"left": 0.25, "top": 0.5, "right": 0.3, "bottom": 0.75},
   "class": {"type": "Human", "score": 0.6,
    "upper_clothing_colors": [{"name": "White", "score": 0.78}]},
   "image": {"data": "/9j/4AAQSkZJRgABAQAAAQABAAD", "bounding_box":
    {"left": 0.2, "top": 0.4, "right": 0.4, "bottom": 0.8}}}],
 "operations": [{"type": "DeleteOperation", "id": "3"},
  {"type": "RenameOperation", "from": "4", "to": "7"}]}}"""

# Analytics Data Format, Consolidated track: com.axis.consolidated_track.v1.beta
_AXIS_PATH = b"""[{"timestamp": "2026-11-20T08:00:00.250000Z",
   "bounding_box": {"left": 0.25, "top": 0.5, "right": 0.3, "bottom": 0.75}},
  {"timestamp": "2026-11-20T08:00:02.500000Z",
   "bounding_box": {"left": 0.275, "top": 0.5, "right": 0.325, "bottom": 0.8}}]"""
_AXIS_TRACK = b"""{"classes": [{"type": "Vehicle", "score": 0.2}, {"type": "Human", "score": 0.7}],
 "start_time": "2026-11-20T08:00:00.250000Z", "end_time": "2026-11-20T08:00:02.500000Z",
 "duration": 2.25, "image": {"data": "/9j/"}, "id": "7", """
AXIS_CONSOLIDATED = _AXIS_TRACK + b'"observations": ' + _AXIS_PATH + b"}"
# axis.scene.object_track_v1
AXIS_OBJECT_TRACK = _AXIS_TRACK + b'"channel_id": 1, "path": ' + _AXIS_PATH + b"}"

# ONVIF Analytics Service Specification, 5.5.3: pixels of 640 x 480, y up
ONVIF_JSON = b"""{"Frame": [{"@UtcTime": "2021-10-05T15:13:27.321", "@Source": "MyClassifier",
 "@context": {"acme": "http://www.acme.com/schema"},
 "Transformation": {"Translate": {"@x": -1.0, "@y": -1.0},
  "Scale": {"@x": 0.003125, "@y": 0.00416667}},
 "Object": [{"@ObjectId": 15, "Appearance": {
  "Shape": {"BoundingBox": {"@left": 20.0, "@top": 80.0, "@right": 100.0, "@bottom": 30.0},
   "CenterOfGravity": {"@x": 60.0, "@y": 50.0}},
  "Class": {"Type": [{"@Likelihood": 0.8, "#text": "Human"}]}}}]}]}"""

# As Hanwha sends it: pixels of 1920 x 1080, y down, a head of its own beside its person
ONVIF_XML = b"""<?xml version="1.0" encoding="UTF-8"?>
<tt:MetadataStream xmlns:tt="http://www.onvif.org/ver10/schema"><tt:VideoAnalytics>
 <tt:Frame UtcTime="2026-11-20T08:00:00.250Z">
  <tt:Transformation><tt:Translate x="-1" y="1"/>
   <tt:Scale x="0.00104166666" y="-0.00185185185"/></tt:Transformation>
  <tt:Object ObjectId="7"><tt:Appearance>
   <tt:Shape><tt:BoundingBox left="480" top="540" right="576" bottom="810"/>
    <tt:CenterOfGravity x="528" y="675"/></tt:Shape>
   <tt:Class><tt:ClassCandidate><tt:Type>Face</tt:Type><tt:Likelihood>0.1</tt:Likelihood>
    </tt:ClassCandidate><tt:Type Likelihood="0.9">Human</tt:Type></tt:Class>
  </tt:Appearance></tt:Object>
  <tt:Object ObjectId="8" Parent="7"><tt:Appearance>
   <tt:Shape><tt:BoundingBox left="500" top="540" right="540" bottom="580"/></tt:Shape>
  </tt:Appearance></tt:Object>
  <tt:Object ObjectId="9"/>
  <tt:ObjectTree><tt:Delete ObjectId="3"/><tt:Rename><tt:from ObjectId="4"/><tt:to ObjectId="7"/>
   </tt:Rename></tt:ObjectTree>
 </tt:Frame></tt:VideoAnalytics></tt:MetadataStream>"""

# Gst-nvmsgconv's documentation; its tracker off for the second
DEEPSTREAM = b"""{"version": "4.0", "id": "1252", "@timestamp": "2026-11-20T08:00:00.250Z",
 "sensorId": "yard-1", "objects": ["7|480|540|576|810|Person|#|male|adult|#|0.9",
  "18446744073709551615|0|0|10|10|Vehicle"]}"""

# The same, full schema (`msg-conv-payload-type=0`): an object a message
DEEPSTREAM_FULL = b"""{"messageid": "a0e2a0a7", "mdsversion": "1.0",
 "@timestamp": "2026-11-20T08:00:00.250Z",
 "place": {"id": "1", "name": "XYZ", "type": "garage",
  "location": {"lat": 30.32, "lon": -40.55, "alt": 100.0}},
 "sensor": {"id": "yard-1", "type": "Camera", "description": "Entrance",
  "location": {"lat": 45.29, "lon": -75.83, "alt": 48.15},
  "coordinate": {"x": 5.2, "y": 10.1, "z": 11.2}},
 "analyticsModule": {"id": "XYZ", "source": "resnet", "version": "1.0"},
 "object": {"id": "7", "speed": 0.0, "direction": 0.0, "orientation": 0.0,
  "person": {"age": 45, "gender": "male", "confidence": 0.9},
  "bbox": {"topleftx": 480, "toplefty": 540, "bottomrightx": 576, "bottomrighty": 810},
  "location": {"lat": 0.0, "lon": 0.0, "alt": 0.0}, "coordinate": {"x": 0.0, "y": 0.0, "z": 0.0}},
 "event": {"id": "b0e2", "type": "moving"}, "videoPath": ""}"""

# A plain topic's: docs/guides/mqtt.md
FRAME = b"""{"time_s": 1795161600.25, "size": [1920, 1080], "ended": ["3"],
 "detections": [{"id": 7, "box": [480, 540, 576, 810], "class": "person"}]}"""

SUPERVISION_CSV = (
    b"x_min,y_min,x_max,y_max,class_id,confidence,tracker_id,class_name,frame_number\r\n"
    b"480.0,540.0,576.0,810.0,0,0.9,7,person,5\r\n"
    b"1.0,1.0,9.0,9.0,2,0.9,,car,5\r\n"
)
SUPERVISION_JSON = b"""[{"x_min": "480.0", "y_min": 540.0, "x_max": 576.0, "y_max": 810.0,
 "class_id": 0, "confidence": 0.9, "tracker_id": 7, "frame_number": 5},
 {"x_min": 1, "y_min": 1, "x_max": 9, "y_max": 9, "class_id": 2, "tracker_id": "",
  "frame_number": 5}]"""

ULTRALYTICS_TEXT = b"0 0.275 0.625 0.05 0.25 0.9 7\n2 0.5 0.5 0.1 0.1 0.8\n"
ULTRALYTICS_SUMMARY = b"""[{"name": "person", "class": 0, "confidence": 0.9, "track_id": 7,
 "box": {"x1": 480.0, "y1": 540.0, "x2": 576.0, "y2": 810.0}}, {"name": "car", "class": 2}]"""

# Frigate 0.16: an MQTT event, and one of /api/events
_PATH = b"[[[0.275, 0.75], 1795161600.25], [[0.3, 0.8], 1795161602.5]]"
FRIGATE = (
    b'{"type": "end", "before": {}, "after": {"id": "1.5-a", "camera": "yard", "label": "person",'
    b' "false_positive": false, "end_time": 1795161603.0, "path_data": ' + _PATH + b"}}"
)
FRIGATE_STORED = (
    b'[{"id": "1.5-a", "camera": "yard", "label": "person", "start_time": 1795161600.25,'
    b' "end_time": 1795161603.0, "false_positive": null, "data": {"type": "object",'
    b' "path_data": ' + _PATH + b"}}]"
)

_HD = (1920.0, 1080.0)
_FRAMES = Clock("frame_number", rate_hz=20.0, started_at_s=1_795_161_600.0)
T = 1_795_161_600.25
READERS = {
    "axis": (AXIS, lambda message: axis.read_message(message, {1: "yard"})),
    "axis_beta": (AXIS_BETA, lambda message: axis.read_message(message, {1: "yard"})),
    "onvif_json": (
        ONVIF_JSON,
        lambda message: onvif.read_json(message, "yard", Profile.TRANSFORMED),
    ),
    "onvif_xml": (ONVIF_XML, lambda message: onvif.read_xml(message, "yard", Profile.TRANSFORMED)),
    "deepstream": (DEEPSTREAM, lambda m: deepstream.read_message(m, {"yard-1": "yard"}.get, _HD)),
    "deepstream_full": (
        DEEPSTREAM_FULL,
        lambda m: deepstream.read_message(m, {"yard-1": "yard"}.get, _HD),
    ),
    "frames": (FRAME, lambda message: frames.read_frame(message, "yard")),
    "supervision_csv": (
        SUPERVISION_CSV,
        lambda file: list(rows.read_supervision_csv(file, "yard", _FRAMES, _HD)),
    ),
    "supervision_json": (
        SUPERVISION_JSON,
        lambda file: list(rows.read_supervision_json(file, "yard", _FRAMES, _HD)),
    ),
    "ultralytics_text": (
        ULTRALYTICS_TEXT,
        lambda lines: rows.read_ultralytics_text(lines, "yard", T),
    ),
    "ultralytics_summary": (
        ULTRALYTICS_SUMMARY,
        lambda message: rows.read_ultralytics_summary(message, "yard", T, _HD),
    ),
}


def _frigate(message):
    track = frigate.read_event(message, str)
    return [] if track is None else [track]


def _frigate_stored(answer):
    events = (each for each in frigate.read_stored(answer) if isinstance(each, frigate.Stored))
    found = (frigate.track_of(each, str) for each in events)
    return [each for each in found if each is not None]


def _axis(message):
    return axis.read_message(message, {1: "yard"})


# Whole tracks rather than boxes.
TRACK_READERS = {
    "frigate": (FRIGATE, _frigate),
    "frigate_stored": (FRIGATE_STORED, _frigate_stored),
    "axis_consolidated": (AXIS_CONSOLIDATED, _axis),
    "axis_object_track": (AXIS_OBJECT_TRACK, _axis),
}
