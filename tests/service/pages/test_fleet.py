"""The fleet page and its parts, over a real store."""

import html as html_of
import json
import re
from datetime import UTC, datetime, timedelta

import pytest
from sqlalchemy import event

from models.monitoring.drift import DriftLimits
from service.cameras.poses import view_pose
from service.pages import fleet as use_cases
from service.references import drift_limits
from service.store import fleet as statements
from service.store.estimates import EstimateRecord
from service.wording.moves import height_change
from service.wording.times import Clock, duration
from tests.service.bench import moved
from tests.service.fleet_bench import afternoon
from tests.stores.databases import only_sqlite


def rows(html):
    return re.findall(r'<li class="row (\w+)" id="row-([\w-]+)"', html)


def words(html, camera_id):
    row = html.split(f'id="row-{camera_id}"')[1].split("</li>")[0]
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", row))


def test_what_needs_a_person_comes_first(http, fleet):
    fleet.add("steady")
    fleet.add("learns", state="learning", tracks=120)
    fleet.add("silent", state="no_data")
    fleet.add("seen", state="drifting", tilt_deg=2.0)
    fleet.knock("seen", by="Ines")
    fleet.add("knocked", state="drifting", tilt_deg=3.0)
    fleet.knock("knocked", severity="critical")
    fleet.add("nudged", state="drifting", tilt_deg=1.5)
    fleet.knock("nudged", severity="warning")
    html = http.get("/").text
    assert rows(html) == [
        ("drifting", "knocked"),
        ("drifting", "nudged"),
        ("drifting", "seen"),
        ("no_data", "silent"),
        ("learning", "learns"),
        ("ok", "steady"),
    ]
    # The script sorts as the service does: by rank, then the newest, then by name.
    told = [json.loads(html_of.unescape(each)) for each in re.findall(r'data-line="([^"]+)"', html)]
    index = json.loads(re.search(r'id="index">(.*?)</script>', html)[1])
    assert told == [[*line[:-1], index["places"][line[-1]]] for line in index["cameras"]]
    assert [each[3] for each in told] == sorted(each[3] for each in told)
    assert index == http.get("/ui/fleet/index").json()
    assert "turned 3.1° (tilt +3.0°, pan −0.8°), " in words(html, "knocked")
    assert "cm lower" in words(html, "knocked")
    assert "acknowledged by Ines" in words(html, "seen")
    assert "learning what is usual: 120 of 200 people" in words(html, "learns")
    assert "no people seen for 26 h" in words(html, "silent")
    assert "standing still" in words(html, "steady")
    assert "<title>(2) Cameras" in html  # one of the three is seen to
    assert re.search(r"<b>3</b> Moved", html)


def test_a_page_of_many_has_as_many_rows_as_are_looked_at(http, fleet):
    """2,000 cameras were 38,100 nodes, and on a phone 258,482 px tall."""
    for n in range(70):
        fleet.add(f"c{n:02}", f"Camera {n}", "learning" if n % 2 else "ok", tracks=1, estimates=1)
    html = http.get("/").text
    assert len(rows(html)) == 50
    index = re.search(r'id="index">(.*?)</script>', html)[1]
    assert len(json.loads(index)["cameras"]) == 70
    assert len(index) < 70 * 90  # 2,000: 180 KB
    assert len(html) - len(index) < 110_000
    asked = http.get("/?state=ok&state=drifting&q=camera+c4").text
    assert {camera_id for _, camera_id in rows(asked)} == {"c40", "c42", "c44", "c46", "c48"}
    assert [i for _, i in rows(http.get("/?q=cam-c07").text)] == ["c07"]  # by its tracker
    assert len(rows(http.get("/?q=steady").text)) == 35  # by its state


def test_sites_and_tags_are_shown_and_asked_for_in_the_address(http, fleet):
    for n in range(60):
        site = f"campus/{'north' if n % 2 else 'northeast'}/gate-{n % 5}"
        fleet.add(f"c{n:02}", site=site, tags=("outdoor",), tracks=1, estimates=1)
    fleet.add("quay", "Quay", tags=("outdoor", "ptz"))
    fleet.add("bare")
    html = http.get("/").text
    index = re.search(r'id="index">(.*?)</script>', html)[1]
    places = json.loads(index)["places"]
    assert sorted(places)[:3] == ["", "#outdoor #ptz", "campus/north/gate-0 #outdoor"]
    assert len(places) == 12  # each once: a camera names its own by a number
    assert "c01 campus/north/gate-1 #outdoor" in words(http.get("/?q=c01").text, "c01")
    assert "quay · #outdoor #ptz" in words(http.get("/?q=quay").text, "quay")
    found = {i for _, i in rows(http.get("/?site=campus/north&q=gate-1").text)}
    assert found == {f"c{n:02}" for n in range(1, 60, 2) if n % 5 == 1}
    assert {i for _, i in rows(http.get("/?tag=outdoor&tag=ptz").text)} == {"quay"}
    assert {i for _, i in rows(http.get("/?q=%23ptz").text)} == {"quay"}
    assert rows(http.get("/?site=campus/nor").text) == []


def test_flags_say_what_is_under_way(http, fleet):
    for name in ("trained", "attended", "hushed"):
        fleet.add(name, state="drifting" if name == "hushed" else "ok", tilt_deg=3.0)
    fleet.train("trained", share=0.37)
    fleet.attend("attended", hours=2)
    alert = fleet.knock("hushed")
    until = (datetime.now(UTC) + timedelta(hours=3)).isoformat()
    http.post(f"/alerts/{alert}/silence", json={"until": until}).raise_for_status()
    html = http.get("/").text
    assert "training 37 %" in words(html, "trained")
    assert "maintenance for 2 hours more" in words(html, "attended")
    assert "silenced for 3 hours more" in words(html, "hushed")


def test_a_tracker_that_is_to_blame_has_one_banner(http, fleet, settings):
    for n in range(4):
        fleet.add(f"cam-{n}", state="drifting", tilt_deg=3.0)
    with fleet.store.write() as session:
        for table in (statements.TrackRecord, statements.SiteReferenceRecord):
            for record in session.query(table):
                record.source = "bytetrack"
    for n in range(4):
        fleet.knock(f"cam-{n}")
    html = http.get("/").text
    assert html.count('class="banner ') == 1
    assert "Tracker bytetrack:" in html
    assert "4 cameras" in http.get("/ui/fleet/banners").text
    assert all("with its tracker" in words(html, f"cam-{n}") for n in range(3))


def test_only_the_rows_that_are_asked_for(http, fleet):
    for name in ("a", "b", "c"):
        fleet.add(name)
    assert [name for _, name in rows(http.get("/ui/fleet/rows?ids=c,a,gone").text)] == ["a", "c"]
    assert len(rows(http.get("/ui/fleet/rows").text)) == 3


def test_who_walked_while_somebody_was_there_is_not_learned_of(http, fleet, settings):
    fleet.add("never", state="learning", tracks=60)
    fleet.add("once", state="learning", tracks=60)
    fleet.attend("once", hours=-0.2, began_h=0.4)
    fleet.add("twice", state="learning", tracks=60)
    fleet.attend("twice", hours=-0.3, began_h=0.4)
    fleet.attend("twice", hours=-0.1, began_h=0.2)
    with fleet.store.read() as session:
        found = {each.id: each.learned for each in use_cases.list_fleet(session, settings)}
        for camera_id, learned in found.items():
            assert learned == view_pose(session, settings, camera_id).reference.tracks
    assert found["never"] == 60
    assert 30 < found["once"] < 50  # 20 tracks walk in 12 minutes and 8 s
    assert 30 < found["twice"] < 50


def test_names_are_text_and_never_run(http, fleet):
    fleet.add("bad", name="<script>alert(1)</script>\"'")
    answer = http.get("/")
    assert "<script>alert" not in answer.text
    assert "&lt;script&gt;alert(1)" in answer.text
    policy = answer.headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "unsafe" not in policy


@only_sqlite("explains its plans")
def test_no_statement_reads_through_what_grows(http, fleet, settings):
    """Tracks and estimates are millions: of each camera, a few are looked up."""
    afternoon(fleet, 12)
    plans = []

    def note(_conn, cursor, statement, parameters, *_):
        if statement.startswith("SELECT"):
            explain = cursor.connection.execute(f"EXPLAIN QUERY PLAN {statement}", parameters)
            plans.extend(row[3] for row in explain)

    event.listen(fleet.store.engine, "before_cursor_execute", note)
    with fleet.store.read() as session:
        use_cases.list_fleet(session, settings)
        use_cases.list_groups(session)
    assert plans
    assert not [plan for plan in plans if re.match(r"SCAN (tracks|estimates|events)", plan)]


def test_the_page_and_the_api_say_the_same_state(bench):
    def both():
        with bench.store.read() as session:
            (camera,) = use_cases.list_fleet(session, bench.settings)
        return camera.state, bench.pose()["state"]

    assert both() == ("learning", "learning")
    bench.see(moved())
    assert both() == ("ok", "ok")
    for _ in range(3):
        bench.see(moved(tilt_deg=5))
    assert both() == ("drifting", "drifting")
    bench.http.post("/cameras/corner/reference/reset").raise_for_status()
    assert both() == ("learning", "learning")


def test_the_history_is_in_units_of_the_limits(bench):
    bench.see(moved(), unidentifiable=("roll",))
    for _ in range(3):
        bench.see(moved(tilt_deg=5, height_m=0.1))
    limits: DriftLimits = drift_limits(bench.settings)
    with bench.store.read() as session:
        history = statements.drift_history(session, None, 3, limits)["corner"]
        records = session.query(EstimateRecord).order_by(EstimateRecord.id).all()[-3:]
        expected = []
        for e in records:
            drift = {"tilt": e.drift_tilt_rad, "roll": e.drift_roll_rad, "height": e.drift_height_m}
            expected.append(max(abs(drift[n]) / limits.floor(n) for n in e.identifiable))
    assert history == pytest.approx(expected)
    assert history[-1] > 3


def test_a_large_page_is_packed_for_who_takes_it(http, fleet):
    afternoon(fleet, 20)
    packed = http.get("/")
    plain = http.get("/", headers={"Accept-Encoding": "identity"})
    assert packed.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in plain.headers
    assert rows(packed.text) == rows(plain.text)


def test_who_looks_for_a_page_that_is_not_there_gets_one(http):
    page = http.get("/ui/nothing", headers={"Accept": "text/html,*/*"})
    assert page.status_code == 404
    assert page.headers["content-type"].startswith("text/html")
    assert "All cameras" in page.text
    assert http.get("/ui/nothing").headers["content-type"] == "application/problem+json"


def test_words_are_made_without_a_store():
    assert [duration(s) for s in (-1, 89, 100, 5390, 5400, 2e5)] == [
        "0 seconds", "89 seconds", "2 minutes", "90 minutes", "2 hours", "2 days"
    ]  # fmt: skip
    now = datetime.now(UTC)
    said = {-61: "in 1 minute", -60: "just now", 29.9: "just now", 30: "1 minute ago",
            91: "2 minutes ago", 3000: "50 minutes ago",
            -7200: "in 2 hours", 11 * 86_400: "2 weeks ago"}  # fmt: skip
    for seconds, words in said.items():
        assert Clock(now=now, zone=UTC).ago(now - timedelta(seconds=seconds)) == words
    assert [height_change(m) for m in (-0.12, 1.34)] == ["12 cm lower", "1.3 m higher"]


def test_static_files_are_kept_and_pages_are_not(http):
    html = http.get("/").text
    (style,) = re.findall(r'href="(/ui/static/\w+/style.css)"', html)
    answer = http.get(style)
    assert answer.status_code == 200
    assert "immutable" in answer.headers["cache-control"]
    assert http.get("/").headers["cache-control"] == "no-store"
    assert "style=" not in html
    assert not re.search(r"\son\w+=", html)
