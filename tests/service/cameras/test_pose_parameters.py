"""The numbers of a pose as API, events, messages and pages tell them, to their twelfth digit.

`tests/golden/pose_parameters.json` is what was told when degrees were kept in the store; `told`
made it, of what `lived` went through.
"""

import html
import json
import re
from pathlib import Path

from tests.service.bench import moved

GOLDEN = Path(__file__).parent.parent.parent / "golden" / "pose_parameters.json"
POSE = ("state", "pose", "estimated", "sd", "drift", "estimates")
POINT = ("height_m", "tilt_deg", "roll_deg", "heading_deg", "sd", "drift")


def lived(bench):
    """Still, knocked with paths, knocked so that height and roll are not told, and still again."""
    bench.http.post("/webhooks", json={"url": "http://1.1.1.1/"}).raise_for_status()
    for _ in range(2):
        bench.see(moved(roll_deg=0.1, heading_deg=0.2), paths=True)
    for _ in range(2):
        bench.see(moved(tilt_deg=5.3, roll_deg=-1.7, height_m=0.42, heading_deg=2.2), paths=True)
    yield "knocked"
    bench.see(moved(tilt_deg=4.9, height_m=-0.3), unidentifiable=("roll", "height"))
    yield "weak"
    bench.see(moved(height_m=0.9))
    yield "raised"
    for _ in range(2):
        bench.see(moved(), paths=True)
    yield "still"
    bench.see(moved(), unidentifiable=("tilt", "roll", "height"))
    yield "untold"


def told(bench):
    """All that has numbers in it."""
    pose, history = bench.pose(), bench.http.get("/cameras/corner/pose/history").json()
    hooks = bench.http.get("/webhooks").json()["items"]
    deliveries = bench.http.get(f"/webhooks/{hooks[0]['id']}/deliveries").json()["items"]
    page = bench.http.get("/ui/cameras/corner").text
    rows = re.findall(r'<tr><th scope="row">.*?</tr>', page)
    text = bench.http.get("/metrics").text
    return {
        "pose": {name: pose[name] for name in POSE},
        "history": [{name: point[name] for name in POINT} for point in history["items"]],
        "alerts": [alert["drift"] for alert in bench.alerts()],
        "events": [
            e["drift"] for kind in ("pose", "alert") for e in bench.events(kind) if e["state"]
        ],
        "messages": [each["payload"]["data"]["drift"] for each in deliveries],
        "metrics": [line for line in text.splitlines() if line.startswith("surefoot_camera_drift")],
        "rows": [html.unescape(re.sub(r"<[^>]*>", " ", row)) for row in rows],
    }


def read(text):
    """What is told, without the digits that a sum in another order changes."""
    return json.loads(text, parse_float=lambda number: float(f"{float(number):.12g}"))


def test_all_numbers_are_told_as_before(bench):
    golden = read(GOLDEN.read_text())
    for when in lived(bench):
        assert read(json.dumps(told(bench))) == golden[when], when
