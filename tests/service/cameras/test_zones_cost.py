"""CPU time of zones of generated shapes: every PUT and every GET has a bound."""

import json
import time

import numpy as np
import pytest

from service.formats.zone_formats import GEOJSON_TYPE, YAML_TYPE
from service.formats.zones import MOST_CORNERS, MOST_ZONES
from tests.service.bench import moved

URL = "/cameras/corner/zones"
PUT_CPU_S, GET_CPU_S = 1.0, 0.3  # three times what a quiet core needs
N = MOST_CORNERS
AROUND = np.linspace(0, 2 * np.pi, N, endpoint=False)
EACH = np.linspace(0, 2 * np.pi, N // MOST_ZONES, endpoint=False)


def ring(angle, radius, at=(640, 450)):
    return np.column_stack([at[0] + radius * np.cos(angle), at[1] + radius * np.sin(angle)])


def along(*ends):
    """`N` corners along a way through points."""
    ends = np.array(ends, float)
    at = np.linspace(0, len(ends) - 1, N)
    return np.column_stack([np.interp(at, range(len(ends)), ends[:, axis]) for axis in (0, 1)])


SHAPES = {
    "circle": [ring(AROUND, 200)],
    "spiral": [ring(20 * AROUND, np.linspace(0, 250, N))],
    "star": [ring(2.4 * np.arange(N), 250)],
    "comb": [np.column_stack([100 + np.arange(N) / 2, 300 + 300.0 * (np.arange(N) % 2)])],
    "random": [np.random.default_rng(0).uniform([0, 100], [1280, 720], (N, 2))],
    "level needle": [along((100, 400), (1100, 401), (1100, 402.5), (100, 402))],
    "slanting needle": [along((100, 100), (1100, 700), (1100, 704), (100, 104))],
    "one spot and a corner": [np.r_[np.full((N - 2, 2), 500.0), [[900, 300], [900, 340]]]],
    "outside the image": [ring(AROUND, 300, (1600, 1000))],
    "above the horizon": [ring(AROUND, 90, (640, -300))],
    "across the horizon": [along((-1000, -200), (2300, -200), (2300, 1400), (-1000, 1400))],
    "many small ones": [ring(EACH, 3, (100 + 8 * n, 400)) for n in range(MOST_ZONES)],
    "many large ones": [ring(EACH, 250 + n, (640, 450)) for n in range(MOST_ZONES)],
    "many lines": [np.array([[100.0 + n, 400], [900, 600 - n]]) for n in range(MOST_ZONES)],
}


def own(zones, on):
    return "application/json", json.dumps(
        {"zones": [{"id": str(n), "on": on, "points": z.tolist()} for n, z in enumerate(zones)]}
    )


def geojson(zones, on):
    features = [
        {
            "id": str(n),
            "properties": {"on": on},
            "geometry": {"type": "LineString", "coordinates": zone.tolist()}
            if len(zone) == 2
            else {"type": "Polygon", "coordinates": [[*zone.tolist(), zone[0].tolist()]]},
        }
        for n, zone in enumerate(zones)
    ]
    return GEOJSON_TYPE, json.dumps({"features": features})


def frigate(zones, on):
    shares = [np.clip((zone + 0.5) / (1280, 720), 0, 1).round(5) for zone in zones]
    parts = (
        f"  z{n}:\n    coordinates: {','.join(map(str, share.ravel().tolist()))}\n"
        for n, share in enumerate(shares)
    )
    return YAML_TYPE, "zones:\n" + "".join(parts)


@pytest.fixture
def timed(bench):
    """Requests about zones of a camera that has moved, with the CPU seconds of each."""
    bench.see(moved(tilt_deg=4), change=5)

    def ask(method, body=None, **query):
        headers = {"If-Match": "*"} | ({} if body is None else {"Content-Type": body[0]})
        content = None if body is None else body[1].encode()
        began = time.process_time()
        answer = bench.http.request(method, URL, content=content, headers=headers, params=query)
        return answer, time.process_time() - began

    ask("GET")  # what is loaded once
    return ask


@pytest.mark.parametrize("form", [own, geojson, frigate])
@pytest.mark.parametrize("on", ["ground", "scene"])
def test_cost_of_generated_zones_is_bounded(timed, form, on):
    before = "2023-11-14T22:13:20Z"  # drawn before the move: corners differ from those now
    too_long = []
    for name, zones in SHAPES.items():
        body = form([np.round(zone, 2) for zone in zones], on)
        answer, put_s = timed("PUT", body, on=on, drawn_at=before)
        assert answer.status_code in (200, 422), answer.text
        gets = [timed("GET")[1] for _ in range(2)]
        gets += [timed("GET", format=kind)[1] for kind in ("frigate", "geojson", "axis")]
        if put_s > PUT_CPU_S or max(gets) > GET_CPU_S:
            too_long.append((name, answer.status_code, round(put_s, 3), round(max(gets), 3)))
    assert too_long == []
