"""Bodies have limits by what they are for."""

from tests.service.conftest import problem


def test_bodies_have_limits_by_their_kind(corner, settings):
    large = b" " * (1024 * 1024 + 1)
    chunks = (b" " * 65536 for _ in range(20))  # whose length nobody declares
    problem(corner.post("/cameras", content=large), 413, "too_large")
    problem(corner.post("/cameras", content=chunks), 413, "too_large")
    problem(corner.post("/ui/preview", content=large), 413, "too_large")
    problem(corner.request("GET", "/cameras", content=large), 413, "too_large")
    json_type = {"Content-Type": "application/json"}
    answer = corner.post("/cameras/corner/tracks", content=large, headers=json_type)
    problem(answer, 422, "malformed")
    held = (b" " * 2**20 for _ in range(33))
    problem(
        corner.post("/cameras/corner/tracks", content=held, headers=json_type), 413, "too_large"
    )
    assert 'surefoot_http_refusals_total{code="too_large"} 5.0' in corner.get("/metrics").text
