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
    "axis": (AXIS, lambda message: axis.read_frame(message, {1: "yard"})),
    "onvif_json": (
        ONVIF_JSON,
        lambda message: onvif.read_json(message, "yard", Profile.TRANSFORMED),
    ),
    "onvif_xml": (ONVIF_XML, lambda message: onvif.read_xml(message, "yard", Profile.TRANSFORMED)),
    "deepstream": (DEEPSTREAM, lambda m: deepstream.read_frame(m, {"yard-1": "yard"}.get, _HD)),
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
    found = (frigate.track_of(each, str) for each in frigate.read_stored(answer))
    return [each for each in found if each is not None]


# Whole tracks rather than boxes.
TRACK_READERS = {
    "frigate": (FRIGATE, _frigate),
    "frigate_stored": (FRIGATE_STORED, _frigate_stored),
}
