"""The page of a camera in a real browser: what is decided there."""

import re
from datetime import UTC, datetime, timedelta

import pytest

from tests.browser.conftest import axe, shoot

pytestmark = pytest.mark.slow


def named(page, who):
    """Say a name where it is asked for."""
    page.get_by_label("Kept beside what you do here").fill(who)
    page.get_by_role("button", name="Go on").click()


def only_alert(bench):
    (alert,) = bench.alerts()
    return bench.http.get(f"/alerts/{alert['id']}").json()


@pytest.mark.nightly
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


def test_what_is_refused_is_said_beside_its_field_and_what_was_typed_stays(seen, knocked):
    """The form closed and lost it, and said: until: a time after now, 2026-11-24T21:21:59.4…"""
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="Silence…").click()
    seen.get_by_label("until a time").check()
    until = seen.get_by_label("Silent until")
    until.fill("2099-01-01T08:00")
    seen.get_by_label("Why (optional)").fill("the fair")
    seen.get_by_role("button", name="Silence", exact=True).click()
    named(seen, "Ada")
    said = seen.locator("#silence-until-error")
    expect(said).to_have_text("At most 30 days from now are taken.")
    expect(until).to_be_focused()
    until.fill("2020-01-01T08:00")
    seen.get_by_role("button", name="Silence", exact=True).click()
    expect(said).to_have_text(
        re.compile(r"^A time after now, \d+ \w+ \d{4}, \d\d:\d\d, is needed\.$")
    )
    assert seen.get_by_label("Why (optional)").input_value() == "the fair"
    assert axe(seen) == []
    seen.keyboard.press("Escape")
    expect(seen.get_by_role("button", name="Silence…")).to_be_focused()
    assert only_alert(knocked)["silenced_until"] is None


def test_one_question_is_answered_by_one_click_and_taken_back_by_another(seen, knocked):
    """On a phone, too: the answers stood at y = 807 of 844 behind a dialog."""
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.set_viewport_size({"width": 390, "height": 844})
    seen.evaluate("document.getElementById('health').remove()")  # that no worker runs here
    for label in ("It was put back", "Keep the new aim", "False alarm"):
        box = seen.get_by_role("button", name=label).bounding_box()
        assert box["y"] + box["height"] <= 844, label
    shoot(seen, "decision-phone")
    expect(seen.locator(".why")).to_contain_text("fits a camera that has moved")
    seen.get_by_text("Say more with the answer").click()
    seen.get_by_placeholder("a ladder had leant").fill("new mast")
    seen.get_by_role("button", name="Keep the new aim").click()
    named(seen, "Ada")
    expect(seen.locator(".headline")).to_have_text("Learning: 0 of 200 people.")
    expect(seen.locator(".undo")).to_contain_text("You kept the new aim just now.")
    expect(seen.locator(".log")).to_contain_text("Ada kept the new aim. new mast")
    alert = only_alert(knocked)
    assert (alert["outcome"], alert["resolved_by"]) == ("accepted", "Ada")
    prior = knocked.http.get("/cameras/corner").json()["prior_pose"]
    assert prior["tilt_deg"] == pytest.approx(27.0, abs=0.02)
    seen.get_by_role("button", name="Undo").click()
    expect(seen.get_by_role("heading", name="The camera moved")).to_be_visible()
    assert only_alert(knocked)["state"] == "firing"
    assert knocked.http.get("/cameras/corner").json()["prior_pose"]["tilt_deg"] == 22.0


def test_the_camera_was_put_back(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="It was put back").click()
    named(seen, "")  # a name is asked for, not demanded
    expect(seen.locator(".headline")).to_contain_text("Waiting for people")
    assert only_alert(knocked)["outcome"] == "put_back"
    body = knocked.pose()
    assert (body["reference"]["state"], body["pose"]["tilt_deg"]) == ("ready", pytest.approx(22.0))


def test_the_camera_is_learned_anew(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.locator("#more > summary").click()
    seen.get_by_role("button", name="Learn anew at the old aim").click()
    named(seen, "Ada")
    expect(seen.locator(".headline")).to_have_text("Learning: 0 of 200 people.")
    expect(seen.locator(".log")).to_contain_text("Ada had it learned anew")


def test_an_alert_is_a_false_alarm_by_keyboard_alone(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.get_by_role("button", name="False alarm").focus()
    seen.keyboard.press("Enter")
    expect(seen.get_by_label("Kept beside what you do here")).to_be_focused()
    seen.keyboard.type("Ada")
    seen.keyboard.press("Enter")
    expect(seen.locator("section.alert")).to_have_count(0)
    expect(seen.locator("#main")).to_be_focused()  # the button is gone, the focus is not lost
    alert = only_alert(knocked)
    assert (alert["outcome"], alert["resolved_by"]) == ("false_alarm", "Ada")


def test_maintenance_and_trainings(seen, knocked):
    expect = pytest.importorskip("playwright.sync_api").expect
    seen.locator("#more > summary").click()
    seen.get_by_role("button", name="Train now").click()
    seen.get_by_role("button", name=re.compile("Cancel the training")).first.click()
    seen.locator("#confirm-yes").click()
    expect(seen.locator('[data-part="reference"]')).to_contain_text("Cancelled")
    seen.get_by_role("button", name="Plan maintenance…").click()
    to = datetime.now(UTC) + timedelta(hours=2)  # by the service's zone, not the device's
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
    expect(seen.locator('[data-part="log"]')).to_contain_text("Ada ended the maintenance")
