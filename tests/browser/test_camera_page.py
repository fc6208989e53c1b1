"""The page of a camera in a real browser: what it says, what it does, and that it stays live."""

import contextlib
import math
import re
import shutil
import sqlite3
from datetime import UTC, datetime, timedelta

import pytest
from PIL import Image

from service.access.activity import note
from service.data_dir import DATABASE
from service.kinds import Activity
from service.settings import Settings
from service.store.sqlite.database import Store
from tests.browser.conftest import axe, served, shoot, too_wide, watched
from tests.conftest import CAMERA, RunningService, free_port
from tests.service.bench import PRIOR, Bench, moved
from tests.service.street import KNOCKED, Street
from tests.service.street import PRIOR as STREET_PRIOR

pytestmark = pytest.mark.slow
URL = "/ui/cameras/corner"


@pytest.fixture(scope="module")
def server(tmp_path_factory, migrated):
    yield from served(tmp_path_factory.mktemp("camera"), migrated)


@pytest.fixture(scope="module")
def tab(browser, server):
    with watched(browser, server) as made:
        yield made


@pytest.fixture
def page(tab, server):
    """The one tab of this file, as if it was new: each new one would read the charts' code anew.

    That takes 2 s, more than most of these tests.
    """
    made, wrong = tab
    made.goto("/healthz")
    made.evaluate("localStorage.clear(); sessionStorage.clear()")
    made.emulate_media(color_scheme="light")
    made.set_viewport_size({"width": 1280, "height": 800})
    yield made
    made.goto("about:blank")
    said = wrong.copy()
    wrong.clear()
    assert said == []


@pytest.fixture(scope="module")
def databases(server, tmp_path_factory):
    """Where databases lie that the service can be put back to, by name."""
    folder = tmp_path_factory.mktemp("databases")
    copy_database(server.settings.data_dir / DATABASE, folder / "empty")
    return folder


def copy_database(source, target):
    """Make one database the same as another, which a service may have open."""
    with (
        contextlib.closing(sqlite3.connect(source)) as given,
        contextlib.closing(sqlite3.connect(target)) as made,
    ):
        given.backup(made)


@pytest.fixture
def empty(server, databases):
    """The service as if it was new, whatever tests before this one did there.

    To delete the camera would leave the log of what was done to it, which is for good.
    """
    copy_database(databases / "empty", server.settings.data_dir / DATABASE)


def new_bench(server):
    server.http.post("/cameras", json=CAMERA).raise_for_status()
    return Bench(server.http, server.settings.model_copy(update={"window_tracks": 20}))


@pytest.fixture
def bench(server, empty):
    return new_bench(server)


@pytest.fixture(scope="module")
def once_knocked(server, databases):
    """A camera that was knocked, and its database: how it came to that is the same every time."""
    copy_database(databases / "empty", server.settings.data_dir / DATABASE)
    bench = new_bench(server)
    for tilt_deg in (0.0, 0.1, 5.0, 5.0, 5.0):
        bench.see(moved(tilt_deg=tilt_deg, heading_deg=-0.6 * tilt_deg), paths=True)
    copy_database(server.settings.data_dir / DATABASE, databases / "knocked")
    return bench


@pytest.fixture
def knocked(server, databases, once_knocked):
    copy_database(databases / "knocked", server.settings.data_dir / DATABASE)
    return once_knocked


@pytest.fixture
def seen(page, knocked):
    """The page of a knocked camera, as it is once its charts are there."""
    page.goto(URL)
    page.wait_for_selector("#charts[data-points]")
    return page


def named(page, who):
    """Say a name where it is asked for."""
    page.get_by_label("Kept beside what you do here").fill(who)
    page.get_by_role("button", name="Go on").click()


def only_alert(bench):
    (alert,) = bench.alerts()
    return bench.http.get(f"/alerts/{alert['id']}").json()


def test_a_knock_arrives_without_a_reload(page, bench):
    expect = pytest.importorskip("playwright.sync_api").expect
    bench.see(PRIOR, paths=True)
    page.goto(URL)
    expect(page.locator(".headline")).to_contain_text("Standing where it should")
    expect(page.locator("#live")).to_have_attribute("data-state", "on")
    page.evaluate("window.untouched = true")
    page.locator("#charts-table summary").click()
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0, heading_deg=-3.0), paths=True)
    expect(page.get_by_role("heading", name="The camera moved")).to_be_visible()
    expect(page.locator(".headline")).to_contain_text("turned 5.8° (pan −3.0°, tilt +5.0°)")
    expect(page.locator(".picture path.grid.served")).to_have_count(1)
    expect(page.locator("#announce")).to_contain_text("turned")
    expect(page).to_have_title(re.compile("^Moved: The corner"))
    expect(page.locator("#charts-values tbody tr")).to_have_count(4)
    assert page.evaluate("window.untouched")


def test_an_alert_is_acknowledged_with_a_name_that_is_asked_for_once(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="Acknowledge").click()
    named(seen, "Ada")
    expect(seen.locator(".summary .flag")).to_have_text("Acknowledged by Ada")
    expect(seen.locator("#announce")).to_have_text("Acknowledged.")
    assert only_alert(knocked)["acknowledged_by"] == "Ada"
    seen.get_by_role("button", name="Silence…").click()
    seen.get_by_label("8 hours").check()
    seen.get_by_label("Why (optional)").fill("the fair")
    seen.get_by_role("button", name="Silence", exact=True).click()
    expect(seen.locator(".summary .flag").nth(1)).to_contain_text("Silenced until")
    alert = only_alert(knocked)
    until = datetime.fromisoformat(alert["silenced_until"])
    assert abs(until - datetime.now(UTC) - timedelta(hours=8)) < timedelta(minutes=2)
    assert (alert["silenced_by"], alert["silence_reason"]) == ("Ada", "the fair")
    expect(seen.locator(".log")).to_contain_text("Ada silenced the alert")
    seen.get_by_role("button", name="End the silence").click()
    expect(seen.locator(".summary .flag")).to_have_count(1)
    assert only_alert(knocked)["silenced_until"] is None


def test_what_is_refused_is_said(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="Silence…").click()
    seen.get_by_label("until a time").check()
    seen.get_by_label("Silent until").fill("2099-01-01T08:00")
    seen.get_by_role("button", name="Silence", exact=True).click()
    named(seen, "Ada")
    expect(seen.locator("#problem-detail")).to_contain_text("at most 30 days")
    seen.keyboard.press("Escape")
    assert only_alert(knocked)["silenced_until"] is None


def test_the_new_pose_is_accepted_after_one_question(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    accept = seen.get_by_role("button", name="Accept the new pose")
    accept.first.click()
    expect(seen.locator("#confirm")).to_contain_text("cannot be undone")
    seen.get_by_role("button", name="Cancel").click()
    assert only_alert(knocked)["state"] == "firing"
    accept.first.click()
    seen.locator("#confirm-yes").click()
    named(seen, "Ada")
    expect(seen.locator(".headline")).to_have_text("Learning: 0 of 200 people.")
    expect(seen.locator(".log")).to_contain_text("Ada accepted the new pose as the prior pose.")
    alert = only_alert(knocked)
    assert (alert["outcome"], alert["resolved_by"]) == ("accepted", "Ada")
    prior = knocked.http.get("/cameras/corner").json()["prior_pose"]
    assert prior["tilt_deg"] == pytest.approx(27.0)


def test_the_camera_was_put_back(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="The camera was put back").click()
    seen.get_by_role("button", name="It was put back").click()
    named(seen, "")  # a name is asked for, not demanded
    expect(seen.locator(".headline")).to_contain_text("Waiting for people")
    assert only_alert(knocked)["outcome"] == "put_back"
    body = knocked.pose()
    assert (body["reference"]["state"], body["pose"]["tilt_deg"]) == ("ready", pytest.approx(22.0))


def test_the_camera_is_learned_anew(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="Learn it anew").click()
    seen.locator("#confirm-yes").click()
    named(seen, "Ada")
    expect(seen.locator(".headline")).to_have_text("Learning: 0 of 200 people.")
    expect(seen.locator(".log")).to_contain_text("Ada had the camera learned anew")


def test_a_new_pose_that_is_accepted_by_resolving_keeps_its_note(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="Resolve…").click()
    seen.get_by_role("radio", name="New pose accepted").check()
    seen.get_by_label("Note (optional)").fill("new mast")
    seen.get_by_role("button", name="Resolve", exact=True).click()
    seen.locator("#confirm-yes").click()
    named(seen, "Ada")
    expect(seen.locator(".log")).to_contain_text("as the prior pose. new mast")


def test_an_alert_is_resolved_as_a_false_alarm_by_keyboard_alone(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="Resolve…").focus()
    seen.keyboard.press("Enter")
    seen.get_by_role("radio", name="False alarm").focus()
    seen.keyboard.press("Space")
    seen.get_by_label("Note (optional)").focus()
    seen.keyboard.type("a truck")
    seen.keyboard.press("Enter")
    expect(seen.get_by_label("Kept beside what you do here")).to_be_focused()
    seen.keyboard.type("Ada")
    seen.keyboard.press("Enter")
    expect(seen.locator("section.alert")).to_have_count(0)
    alert = only_alert(knocked)
    assert (alert["outcome"], alert["note"], alert["resolved_by"]) == (
        "false_alarm",
        "a truck",
        "Ada",
    )


def test_maintenance_and_trainings(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="Train now").click()
    seen.get_by_role("button", name=re.compile("Cancel the training")).first.click()
    seen.locator("#confirm-yes").click()
    expect(seen.locator('[data-part="reference"]')).to_contain_text("Cancelled")
    seen.get_by_role("button", name="Plan maintenance…").click()
    to = datetime.now() + timedelta(hours=2)
    seen.get_by_label("To", exact=True).fill(to.strftime("%Y-%m-%dT%H:%M"))
    seen.get_by_label("What for (optional)").fill("lens cleaned")
    seen.get_by_role("button", name="Plan it").click()
    named(seen, "Ada")
    expect(seen.locator(".summary .flag").first).to_contain_text("Maintenance until")
    (window,) = knocked.http.get("/cameras/corner/maintenance").json()["items"]
    assert (window["state"], window["by"], window["reason"]) == ("under_way", "Ada", "lens cleaned")
    seen.get_by_role("button", name="End it now").click()
    seen.locator("#confirm-yes").click()
    expect(seen.locator('[data-part="maintenance"]')).to_contain_text("Over")


def test_the_charts_have_points_and_zoom_by_buttons(seen):
    expect = pytest.importorskip("playwright.sync_api").expect
    assert seen.locator("#charts").get_attribute("data-points") == "5"
    assert seen.locator("#charts .scatterlayer .point").count() >= 4 * 5
    seen.get_by_role("button", name="24 hours").click()
    expect(seen.get_by_role("button", name="24 hours")).to_have_attribute("aria-pressed", "true")
    seen.locator("#charts-table summary").click()
    expect(seen.locator("#charts-values")).to_contain_text("27.00° ±0.33")


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_page_is_sound(page, knocked, server, scheme):
    with contextlib.closing(Store(server.settings)) as store, store.write() as session:
        for _ in range(40):  # a log that is longer than its place
            note(session, Activity.CAMERA_CHANGED, by="Ada", camera_id="corner")
    page.emulate_media(color_scheme=scheme)
    page.goto(URL)
    page.wait_for_selector("#charts[data-points]")
    assert axe(page) == []
    for dialog in ("name", "silence", "resolve", "maintain"):
        page.evaluate(f"document.getElementById('{dialog}-dialog').showModal()")
        assert axe(page) == [], dialog
        page.keyboard.press("Escape")
    for width in (360, 2560):
        page.set_viewport_size({"width": width, "height": 800})
        assert too_wide(page) <= 0, width
        assert axe(page) == [], width


def test_a_still_image_is_put_behind_the_drawing_and_taken_away(browser, tmp_path, migrated):
    expect = pytest.importorskip("playwright.sync_api").expect
    settings = Settings(
        data_dir=tmp_path / "data", workers=0, port=free_port(), snapshots=True, window_tracks=20
    )
    shutil.copytree(migrated, settings.data_dir)
    Image.linear_gradient("L").resize((1280, 720)).save(tmp_path / "still.png")
    Image.new("L", (720, 1280)).save(tmp_path / "upright.png")
    server = RunningService(settings)
    server.start()
    try:
        server.http.post("/cameras", json=CAMERA).raise_for_status()
        bench = Bench(server.http, settings)
        for _ in range(3):
            bench.see(moved(tilt_deg=5.0))
        page = browser.new_context(base_url=server.url).new_page()
        page.goto(URL)
        page.locator("#still-file").set_input_files(tmp_path / "upright.png")
        expect(page.locator("#problem-detail")).to_contain_text("1280 x 720")
        page.keyboard.press("Escape")
        page.locator("#still-file").set_input_files(tmp_path / "still.png")
        expect(page.locator(".picture image")).to_have_count(1)
        assert axe(page) == []
        shoot(page, "camera-still-image")
        page.get_by_role("button", name="Remove it").click()
        expect(page.locator(".picture image")).to_have_count(0)
        assert server.http.get("/cameras/corner/snapshot").status_code == 404
        page.context.close()  # a service that stops waits 3 s for streams of events
    finally:
        server.stop()


def test_a_knocked_street_is_seen_to_be_knocked(page, server, empty):
    """The whole way, with the real estimator: the two grids part, the page says how far."""
    expect = pytest.importorskip("playwright.sync_api").expect
    server.http.post("/cameras", json={**CAMERA, "reference_tracks": 150}).raise_for_status()
    street = Street(server.http, server.settings.model_copy(update={"window_tracks": 100}))
    page.goto(URL)
    expect(page.locator(".headline")).to_have_text("Learning: 0 of 150 people.")
    shoot(page, "camera-new")
    street.keep_to_lanes(STREET_PRIOR, 150)
    street.look()
    for _ in range(4):
        street.keep_to_lanes(STREET_PRIOR, 25)
        street.look()
    expect(page.locator(".headline")).to_contain_text("Standing where it should", timeout=30_000)
    expect(page.locator("#charts")).to_have_attribute("data-points", re.compile("^[4-9]"))
    shoot(page, "camera-still")
    for _ in range(4):
        street.keep_to_lanes(KNOCKED, 15)
        street.look()
    expect(page.get_by_role("heading", name="The camera moved")).to_be_visible(timeout=30_000)
    expect(page.locator(".headline")).to_contain_text("turned", timeout=30_000)
    page.evaluate("document.getElementById('announce').textContent = ''")
    told = page.locator(".headline").inner_text()
    angle = float(re.search(r"turned (\d+\.\d)°", told)[1])
    assert angle == pytest.approx(math.hypot(5, 4), abs=1.0), told
    expect(page.locator(".meaning")).to_contain_text("A person at 10 m is now placed")
    shoot(page, "camera-knocked")
    page.emulate_media(color_scheme="dark")
    shoot(page, "camera-knocked-dark")
    page.set_viewport_size({"width": 390, "height": 844})
    shoot(page, "camera-phone-dark")
    page.emulate_media(color_scheme="light")
    shoot(page, "camera-phone")
