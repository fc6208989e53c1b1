"""The page of a camera in a real browser: what is decided there."""

import re
from datetime import UTC, datetime, timedelta

import pytest

pytestmark = pytest.mark.slow


def named(page, who):
    """Say a name where it is asked for."""
    page.get_by_label("Kept beside what you do here").fill(who)
    page.get_by_role("button", name="Go on").click()


def only_alert(bench):
    (alert,) = bench.alerts()
    return bench.http.get(f"/alerts/{alert['id']}").json()


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
    assert prior["tilt_deg"] == pytest.approx(27.0, abs=0.02)


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
    expect(seen.locator('[data-part="log"]')).to_contain_text("Ada ended the maintenance")
