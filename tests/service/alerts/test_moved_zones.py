"""What a move is to zones, on the alert: shares, people by the lines, and where they are mended."""

import html

import pytest

from service.notifications.messages import postable_alerts
from service.store.engines.store import Store
from service.store.webhooks import DeliveryRecord
from service.wording.zones import count_words
from tests.service.bench import PRIOR, moved

ZONES = "/cameras/corner/zones"
LINE = {"id": "gate", "points": [[600, 500], [900, 500]]}
AREA = {"id": "yard", "points": [[400, 350], [800, 361], [900, 600]]}
FRIGATE = "zones: {yard: {coordinates: '0.3,0.5,0.6,0.5,0.7,0.8'}}"
# Once the camera looks 4 deg lower, what was at v = 500 is at 359.5 + 1100 tan(atan(140.5 / 1100) -
# 4 deg) = 423 (fy 1100, cy 359.5): who passes the one but not the other is counted wrong.
BOTH, MISSED, BY_MISTAKE, NEITHER = (380, 600), (470, 380), (600, 465), (520, 600)
CROWD = [BOTH] * 5 + [MISSED] * 4 + [BY_MISTAKE] * 3 + [NEITHER] * 2


def draw(http, *zones):
    http.put(ZONES, json={"zones": list(zones)}, headers={"If-Match": "*"}).raise_for_status()


def cross(bench):
    """People who walk straight up or down at u = 750, a second apart."""
    bench.clock_s += 60
    batch = [
        {
            "id": f"walker {n}",
            "points": [[bench.clock_s + n + 0.4 * k, 750, v + (to - v) * k / 9] for k in range(10)],
        }
        for n, (v, to) in enumerate(CROWD)
    ]
    bench.http.post("/cameras/corner/tracks", json={"tracks": batch}).raise_for_status()


def knock(bench, tilt_deg=4):
    cross(bench)
    bench.see(moved(tilt_deg=tilt_deg), people=6)
    (alert,) = bench.alerts(state="firing")
    return bench.http.get(f"/alerts/{alert['id']}").raise_for_status().json()


def section(text, name):
    return " ".join(
        html.unescape(text.split(f'data-part="{name}">')[1].split("</section>")[0]).split()
    )


def test_people_who_crossed_a_line_and_who_were_missed(bench):
    draw(bench.http, LINE, AREA)
    hook = bench.http.post("/webhooks", json={"url": "https://8.8.8.8/hook"}).json()
    alert = knock(bench)
    gate, yard = alert["zones"]
    assert (gate["crossed"], gate["missed"], gate["false_counts"]) == (9, 4, 3)
    assert (yard["crossed"], yard["missed"], yard["false_counts"]) == (None, None, None)
    shown = bench.http.get(ZONES).json()["zones"]
    for zone, told in zip(shown, alert["zones"], strict=True):
        for name in ("id", "on", "overlap", "in_view"):
            assert told[name] == pytest.approx(zone[name], abs=1e-6)
    assert (alert["corrected_zones"]["path"], alert["corrected_zones"]["format"]) == (ZONES, None)
    with Store(bench.settings).read() as session:
        (delivery,) = session.query(DeliveryRecord).filter_by(webhook_id=hook["id"])
        assert delivery.payload["data"]["zones"] == alert["zones"]
    (posted,) = postable_alerts(alert, "https://here", changed=False)
    words = "of the last 9 who crossed it, 4 were missed, 3 were counted who did not cross it"
    assert posted["annotations"]["zones"].startswith("gate: ")
    assert f"{words}\nyard: " in posted["annotations"]["zones"]
    assert posted["annotations"]["corrected_zones"].startswith(f"https://here{ZONES} Have them")
    page = bench.http.get("/ui/cameras/corner").text
    assert f"; {words}</li>" in section(page, "alerts")
    assert words in page.split('data-part="zones">')[1]
    assert "download>Corrected zones" not in page
    draw(bench.http, AREA | {"id": "gate"})  # what was counted was of another line
    assert words not in bench.http.get("/ui/cameras/corner").text


def test_an_alert_that_has_ended_keeps_what_was_told(bench):
    draw(bench.http, LINE)
    before = knock(bench)
    bench.see(PRIOR)
    after = bench.http.get(f"/alerts/{before['id']}").json()
    assert after["state"] == "resolved"
    assert after["zones"] == before["zones"]


def test_frigates_zones_are_mended_by_a_person(bench, settings, monkeypatch):
    headers = {"If-Match": "*", "Content-Type": "application/yaml"}
    bench.http.put(ZONES, content=FRIGATE, headers=headers).raise_for_status()
    how = "Have them in place of this camera's in Frigate's configuration, and restart Frigate."
    path = f"{ZONES}?format=frigate"
    assert knock(bench)["corrected_zones"] == {"path": path, "format": "frigate", "how": how}
    said = section(bench.http.get("/ui/cameras/corner").text, "alerts")
    assert f'<a href="{path}" download>Corrected zones</a>. {how}' in said
    assert "Frigate’s configuration</a>" not in said
    monkeypatch.setitem(vars(settings), "mqtt_frigate_url", "http://frigate:5000/")
    said = section(bench.http.get("/ui/cameras/corner").text, "alerts")
    assert f'{how} <a href="http://frigate:5000/config">Frigate’s configuration</a>' in said


def test_without_zones_nothing_is_said(bench):
    alert = knock(bench)
    assert (alert["zones"], alert["corrected_zones"]) == (None, None)


def test_a_clock_moves_no_zone(bench):
    draw(bench.http, LINE)
    bench.see(moved(height_m=1.5))
    (alert,) = bench.alerts(state="firing")
    assert alert["kind"] == "clock"
    assert bench.http.get(f"/alerts/{alert['id']}").json()["zones"] is None


@pytest.mark.parametrize(
    ("counts", "words"),
    [
        ((None, None, None), ""),
        ((0, 0, 0), ""),
        ((40, 11, 0), "of the last 40 who crossed it, 11 were missed"),
        (
            (40, 1, 1),
            "of the last 40 who crossed it, 1 was missed, 1 was counted who did not cross it",
        ),
        ((4, 4, 0), "of the last 4 who crossed it, all were missed"),
        ((4, 0, 0), "of the last 4 who crossed it, none were missed"),
        ((0, 0, 3), "3 were counted who did not cross it"),
    ],
)
def test_counts_in_words(counts, words):
    assert count_words(*counts) == words
