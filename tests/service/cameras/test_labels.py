"""Sites and tags of cameras: said, refused, looked for, given to many at once."""

import pytest

from service.store import journal
from service.store.engines.store import Store
from tests.conftest import CAMERA
from tests.service.alerts.test_states import knock
from tests.service.cameras.test_registration import ANGLES, LENS, preview
from tests.service.conftest import problem

ANY = {"If-Match": "*"}


def add(http, camera_id, **labels):
    body = http.post("/cameras", json=CAMERA | {"id": camera_id, **labels})
    assert body.status_code == 201, body.text
    return body.json()


@pytest.fixture
def campus(http):
    """Four cameras at three sites, one of which only begins like another."""
    add(http, "a", site="campus/north", tags=["outdoor", "nvr-east"])
    add(http, "b", site="campus/north/gate", tags=["outdoor"])
    add(http, "c", site="campus/northeast", tags=["outdoor", "nvr-east", "ptz"])
    add(http, "d")
    return http


def found(http, **query):
    answer = http.get("/cameras", params=query)
    assert answer.status_code == 200, answer.text
    return [camera["id"] for camera in answer.json()["items"]]


def test_a_camera_says_where_it_belongs(http):
    made = add(http, "a", site="campus/Gebäude 3", tags=["ptz", "außen", "ptz"])
    assert (made["site"], made["tags"]) == ("campus/Gebäude 3", ["außen", "ptz"])
    bare = add(http, "b")
    assert (bare["site"], bare["tags"]) == (None, [])
    etag = {"If-Match": http.get("/cameras/a").headers["ETag"]}
    changed = http.patch("/cameras/a", json={"site": "", "tags": ["x"]}, headers=etag)
    assert (changed.json()["site"], changed.json()["tags"]) == (None, ["x"])
    assert changed.json()["name"] == "The corner"
    assert changed.headers["ETag"] != etag["If-Match"]
    named = http.patch("/cameras/a", json={"name": ""}, headers=ANY).json()
    assert (named["name"], named["tags"]) == ("a", ["x"])


@pytest.mark.parametrize(
    ("labels", "pointer", "said"),
    [
        ({"site": "campus//gate"}, "/site", "names with / between them are needed"),
        ({"site": "/campus"}, "/site", "got '/campus'"),
        ({"site": "campus/ gate"}, "/site", "such as campus/north"),
        ({"site": "campus/#1"}, "/site", "no #"),
        ({"site": "a\u202eb"}, "/site", "names with /"),
        ({"site": "a" * 201}, "/site", "at most 200 characters"),
        ({"tags": ["out door"]}, "/tags", "which 'out door' is not"),
        ({"tags": [""]}, "/tags", "a tag is letters, digits"),
        ({"tags": ["x" * 41]}, "/tags", "40 at most"),
        ({"tags": [f"t{n}" for n in range(21)]}, "/tags", "at most 20 items"),
    ],
)
def test_what_is_no_site_and_no_tag_is_refused_in_words(corner, labels, pointer, said):
    for answer in (
        corner.post("/cameras", json=CAMERA | {"id": "b"} | labels),
        corner.patch("/cameras/corner", json=labels, headers=ANY),
    ):
        (error,) = problem(answer, 422, "malformed")["errors"]
        assert error["pointer"] == pointer
        assert said in error["reason"]


def test_a_site_is_found_with_what_lies_below_it_and_tags_add_up(campus):
    assert found(campus, site="campus") == ["a", "b", "c"]
    assert found(campus, site="campus/north") == ["a", "b"]  # and not northeast
    assert found(campus, site="Campus") == []
    assert found(campus, site="campus/nort_") == []
    assert found(campus, tag="nvr-east") == ["a", "c"]
    assert found(campus, tag=["nvr-east", "ptz"]) == ["c"]
    assert found(campus, tag="nvr") == []
    assert found(campus, site="campus/north", tag="nvr-east") == ["a"]
    assert found(campus, site="campus", state="unconnected") == ["a", "b", "c"]
    assert found(campus, site="campus", state="ok") == []
    assert found(campus, site="") == ["a", "b", "c", "d"]
    problem(campus.get("/cameras?site=a//b"), 422, "malformed")


def test_what_is_found_comes_in_pages(campus):
    seen, cursor = [], ""
    while cursor is not None:
        query = {"site": "campus", "tag": "outdoor", "limit": 2, "cursor": cursor}
        page = campus.get("/cameras", params=query).json()
        seen.append([camera["id"] for camera in page["items"]])
        cursor = page["next_cursor"]
    assert seen == [["a", "b"], ["c"]]


def test_many_are_tagged_at_once_each_for_itself(campus):
    body = {"ids": ["a", "d", "gone"], "action": "tag", "add": ["night"], "remove": ["outdoor"]}
    items = campus.post("/actions", json=body | {"by": "Ada"}).json()["items"]
    assert [item["problem"] and item["problem"]["status"] for item in items] == [None, None, 404]
    assert campus.get("/cameras/a").json()["tags"] == ["night", "nvr-east"]
    assert campus.get("/cameras/d").json()["tags"] == ["night"]
    kept = [each for each in campus.get("/activity").json()["items"] if each["by"] == "Ada"]
    assert [(each["what"], each["camera_id"]) for each in kept] == [
        ("camera.described", "a"),
        ("camera.described", "d"),
    ]
    full = {"ids": ["a"], "action": "tag", "add": [f"t{n}" for n in range(19)]}
    (refused,) = campus.post("/actions", json=full).json()["items"]
    assert refused["problem"]["detail"] == "tags: at most 20 are taken, it would have 21"
    before = campus.get("/cameras/a").headers["ETag"]
    again = {"ids": ["a"], "action": "tag", "add": ["night"]}
    assert campus.post("/actions", json=again).json()["items"][0]["problem"] is None
    assert campus.get("/cameras/a").headers["ETag"] == before  # nothing was changed
    problem(campus.post("/actions", json={"ids": ["a"], "action": "tag"}), 422, "malformed")


def test_open_pages_are_told_and_the_log_says_who(campus, settings):
    """They stayed wrong for two minutes."""
    store = Store(settings)
    with store.read() as session:
        before = journal.newest_event_id(session)
    body = {"site": "quay", "name": "Crane", "by": "Ada"}
    campus.patch("/cameras/b", json=body, headers=ANY).raise_for_status()
    campus.post("/actions", json={"ids": ["c"], "action": "tag", "add": ["x"]}).raise_for_status()
    campus.delete("/cameras/d", params={"by": "Ines"}, headers=ANY).raise_for_status()
    with store.read() as session:
        events = journal.events_after(session, before, 100)
    store.close()
    told = [(e.type, e.payload["camera_id"], e.payload.get("removed")) for e in events]
    assert told == [("pose", "b", None), ("pose", "c", None), ("pose", "d", True)]
    changed, _, removed = campus.get("/activity").json()["items"][-3:]
    assert (removed["what"], removed["by"]) == ("camera.removed", "Ines")
    assert (changed["what"], changed["by"]) == ("camera.described", "Ada")
    assert changed["details"] == {"fields": ["name", "site"], "name": "Crane", "site": "quay"}
    assert "Ada changed its name, site." in campus.get("/ui/cameras/b").text


def test_another_name_stands_in_the_way_of_no_undo(bench):
    knock(bench)
    http = bench.http
    http.post("/cameras/corner/pose/put-back", json={}).raise_for_status()
    http.patch("/cameras/corner", json={"name": "Gate", "tags": ["a"]}, headers=ANY)
    assert http.post("/cameras/corner/pose/undo", json={}).status_code == 200
    assert len(bench.alerts(state="firing")) == 1
    http.post("/cameras/corner/pose/put-back", json={}).raise_for_status()
    http.patch("/cameras/corner", json={"frame_rate_hz": 12.5}, headers=ANY)
    problem(http.post("/cameras/corner/pose/undo", json={}), 409, "conflict")


def test_site_and_tags_are_typed_and_what_is_none_is_said_beside_its_field(http):
    typed = {**LENS, **ANGLES, "id": "gate", "site": "campus/north", "tags": "outdoor, nvr-east"}
    wrong = preview(http, **{**typed, "site": "campus//", "tags": "out/door", "fx": "{wide}"})
    assert wrong["errors"] == {
        "fx": "a number is needed, got '{wide}'",
        "site": "names with / between them are needed, such as campus/north, and no # (got "
        "'campus//')",
        "tags": "a tag is letters, digits and .:-_, 40 at most, which 'out/door' is not",
    }
    assert http.post("/ui/register", json=typed).status_code == 201
    camera = http.get("/cameras/gate").json()
    assert (camera["site"], camera["tags"]) == ("campus/north", ["nvr-east", "outdoor"])
