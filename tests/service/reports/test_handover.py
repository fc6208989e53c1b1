"""A shift is handed over: what was told and done by whom, what is open, and a note to the next."""

import html
import re
from datetime import UTC, datetime, timedelta

from service.reports import handover
from tests.service.conftest import problem


def hours(count):
    return (datetime.now(UTC) + timedelta(hours=count)).isoformat()


def plain(text):
    return re.sub(r"\s+", " ", html.unescape(re.sub(r"<[^>]*>", " ", text)))


def section(http, title, **query):
    page = http.get("/ui/handover", params=query).text
    (found,) = [each for each in page.split("<h2>")[1:] if each.startswith(title)]
    return plain(found.split("</section>")[0])


def test_a_shift_has_what_was_told_done_and_is_open(http, fleet):
    for n in range(4):
        fleet.add(f"c{n}", f"Corner {n}", tilt_deg=3.0)
    ids = [fleet.knock(f"c{n}") for n in range(4)]
    http.post(
        "/actions", json={"ids": ids[:2], "action": "resolve", "outcome": "put_back", "by": "Ada"}
    ).raise_for_status()
    http.post(f"/alerts/{ids[2]}/acknowledge", json={"by": "Ada"}).raise_for_status()
    silence = {"until": hours(3), "by": "Bo", "reason": "the fair"}
    http.post(f"/alerts/{ids[3]}/silence", json=silence).raise_for_status()
    window = {"to": hours(2), "reason": "a lens", "by": "Bo"}
    http.post("/cameras/c0/maintenance", json=window).raise_for_status()
    assert "4 alerts were told since then" in http.get("/ui/handover?hours=8").text
    told = section(http, "Told", hours=8)
    assert told.startswith("Told and ended 2 ")
    assert "Corner 0 Moved: tilt +3.0°" in told
    assert "put back by Ada after" in told
    still = section(http, "Still open", hours=8)
    assert still.startswith("Still open 2 ")
    assert "acknowledged by Ada after" in still
    assert "silenced by Bo" in still
    assert "; silenced until" in still
    assert "Corner 0 until" in section(http, "Maintenance under way", hours=8)
    done = section(http, "Done", hours=8)
    assert "Ada said that it was put back. Corner 0 , Corner 1" in done  # one deed, and its ends
    assert "closed" not in done
    assert "Bo silenced the alert “the camera moved” until" in done
    assert "Bo planned maintenance until" in done
    # A shift that begins now has what is open, and nothing that was before it.
    later = {"from": datetime.now(UTC).isoformat()}
    assert section(http, "Told", **later).startswith("Told and ended none")
    assert section(http, "Done", **later).startswith("Done nothing")
    assert section(http, "Still open", **later).startswith("Still open 2 ")


def test_of_more_acts_than_are_shown_the_last_ones_are(http, fleet, monkeypatch):
    monkeypatch.setattr(handover, "_MOST_ACTIONS", 2)
    fleet.add("c0", "Corner 0", tilt_deg=3.0)
    alert_id = fleet.knock("c0")
    for name in ("Ada", "Bo", "Cy"):
        silence = {"until": hours(3), "by": name}
        http.post(f"/alerts/{alert_id}/silence", json=silence).raise_for_status()
    done = section(http, "Done", hours=8)
    assert done.index("Cy silenced") < done.index("Bo silenced")
    assert "Ada silenced" not in done
    assert "There is more than is shown" in http.get("/ui/handover", params={"hours": 8}).text


def test_a_note_is_shown_to_the_next_until_somebody_takes_it_over(http):
    said = {"since": hours(-8), "note": "<b>gate 3</b> is repaired", "by": "Ada"}
    given = http.post("/handovers", json=said).json()
    assert (given["by"], given["note"], given["taken_at"]) == ("Ada", said["note"], None)
    fleet = http.get("/").text
    assert "Handover by Ada" in fleet
    assert "&lt;b&gt;gate 3&lt;/b&gt; is repaired" in fleet
    assert "Handover by Ada" in http.get("/ui/fleet/banners").text
    # The next one's shift begins with it.
    assert "Since Ada handed over" in http.get("/ui/handover").text
    take = f"/handovers/{given['id']}/take"
    assert http.post(take, json={"by": "Bo"}).json()["taken_by"] == "Bo"
    assert "Handover by" not in http.get("/").text
    problem(http.post(take, json={"by": "Cy"}), 409, "conflict")
    problem(http.post("/handovers/none/take"), 404, "not_found")
    (kept,) = http.get("/handovers").json()["items"]
    assert (kept["id"], kept["taken_by"]) == (given["id"], "Bo")
    log = [(e["what"], e["by"], e["note"]) for e in http.get("/activity").json()["items"]]
    assert log == [("handover.given", "Ada", said["note"]), ("handover.taken", "Bo", None)]


def test_a_shift_of_another_time_is_asked_for_by_a_time_of_the_past(http):
    problem(http.get("/ui/handover", params={"from": hours(1)}), 422, "malformed")
    problem(http.get("/ui/handover", params={"hours": 0}), 422, "malformed")
