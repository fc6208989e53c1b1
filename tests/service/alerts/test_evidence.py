"""What stands behind an alert, what the tracks would tell, and what else explains them."""

from dataclasses import replace

import numpy as np
import pytest

from models.geometry.pose import array_of
from models.pose import Alternative
from service.estimation import estimates
from tests.service.bench import PRIOR, made_up, moved


def see_with(bench, pose, **fused):
    """Store an estimate with more in it than the bench makes up."""
    bench.post(20)
    evidence = bench.refresh()
    found = made_up(evidence, pose, paths=True)
    estimated = found.assessment.estimated
    estimated = replace(estimated, fused=replace(estimated.fused, **fused))
    found = replace(found, assessment=replace(found.assessment, estimated=estimated))
    with bench.store.write() as session:
        estimates.save_estimate(session, bench.queue, bench.settings, evidence, found)


def test_an_alert_keeps_what_it_was_by(bench):
    bench.see(moved(tilt_deg=3.0, heading_deg=-4.0), paths=True)
    (alert,) = bench.alerts(state="firing")
    body = bench.http.get(f"/alerts/{alert['id']}/evidence").raise_for_status().json()
    weights = [each["weight"] for each in body["hypotheses"]]
    assert weights == sorted(weights, reverse=True)
    best = body["hypotheses"][0]
    assert {"tilt_deg", "heading_deg"} <= set(best["moved"])
    assert best["offset"]["tilt_deg"] == pytest.approx(3.0, abs=0.1)
    assert best["offset"]["heading_deg"] == pytest.approx(-4.0, abs=0.1)
    assert body["offset"]["tilt_deg"] == pytest.approx(3.0, abs=1e-6)
    assert body["offset_sd"]["tilt_deg"] == pytest.approx(0.2, abs=1e-6)
    assert body["moved"] == bench.pose()["moved"]
    assert (body["registered"], body["chart"], body["alternatives"]) == (True, None, [])
    assert body["tracks"] == bench.pose()["tracks"]
    assert body["from"] < body["to"]


def test_the_evidence_is_of_the_newest_look_and_outlives_the_alert(bench):
    bench.see(moved(tilt_deg=3.0))
    (alert,) = bench.alerts(state="firing")
    bench.see(moved(tilt_deg=5.0))
    url = f"/alerts/{alert['id']}/evidence"
    assert bench.http.get(url).json()["offset"]["tilt_deg"] == pytest.approx(5.0)
    bench.see(moved())
    assert bench.alerts(state="firing") == []
    assert bench.http.get(url).json()["offset"]["tilt_deg"] == pytest.approx(5.0)


def test_an_alert_that_no_estimate_stands_behind_has_none(bench):
    answer = bench.http.get("/alerts/nothing/evidence")
    assert answer.status_code == 404
    assert "there is no alert 'nothing'" in answer.text


def test_the_page_draws_what_was_weighed(bench):
    bench.see(moved(tilt_deg=3.0))
    page = bench.http.get("/ui/cameras/corner").text
    assert "The numbers behind it" in page
    assert "<label>Tilt moved <meter" in page


def test_a_pose_says_what_would_be_noticed_of_so_many_people(bench):
    bench.see(moved(), paths=True)
    notice = bench.pose()["detectable"]
    for field in ("tilt_deg", "roll_deg", "heading_deg", "height_m"):
        smallest = [notice[field][people] for people in ("60", "250", "800")]
        assert smallest == sorted(smallest, reverse=True)
        assert 0 < smallest[-1] < 3
    page = bench.http.get("/ui/cameras/corner").text
    assert f"{notice['tilt_deg']['250']:.1f}°</td></tr>" in page
    assert "A pan would not be told" not in page


def test_a_site_that_is_deaf_to_a_pan_says_so_and_what_would_help(bench):
    bench.see(moved())
    pose = bench.pose()
    assert pose["detectable"]["heading_deg"] is None
    assert pose["detectable"]["tilt_deg"]["60"] > 0
    page = bench.http.get("/ui/cameras/corner").text
    assert "A pan would not be told: where people walk does not tell the heading." in page


def test_learning_camera_has_no_detectable_move(bench):
    bench.http.post("/cameras/corner/reference/reset", json={}).raise_for_status()
    pose = bench.pose()
    assert set(pose["detectable"].values()) == {None}
    assert pose["alternatives"] == []


def test_other_poses_that_explain_the_tracks_are_served_with_their_weights(bench):
    other = array_of(PRIOR) + np.radians([0, 0, 0, 60])
    see_with(bench, moved(), alternatives=(Alternative(values=other, weight=0.3),))
    (alternative,) = bench.pose()["alternatives"]
    assert alternative["weight"] == 0.3
    assert alternative["heading_deg"] == pytest.approx(np.degrees(PRIOR.heading_rad) + 60)
    assert alternative["height_m"] == pytest.approx(PRIOR.height_m)
