"""Acts of several people on the same cameras and alerts at once, on either database."""

import random
import threading
from collections import Counter
from datetime import UTC, datetime, timedelta

from service.store import references

_PEOPLE, _ACTS_EACH = 6, 40
_CAMERAS = [f"c{n}" for n in range(4)]


def act(http, chosen):
    """One act, on a camera or an alert that is drawn; returns its answer."""
    camera = f"/cameras/{chosen.choice(_CAMERAS)}"
    firing = http.get("/alerts", params={"state": "firing"}).json()["items"]
    alert = f"/alerts/{chosen.choice(firing)['id']}" if firing else "/alerts/none"
    until = (datetime.now(UTC) + timedelta(hours=1)).isoformat()
    path, body = chosen.choice(
        [
            (f"{camera}/pose/put-back", None),
            (f"{camera}/pose/accept", None),
            (f"{camera}/pose/undo", None),
            (f"{camera}/reference/reset", None),
            (f"{camera}/maintenance", {"to": until}),
            (f"{alert}/acknowledge", {"acknowledged": chosen.random() < 0.5}),
            (f"{alert}/silence", {"until": until if chosen.random() < 0.5 else None}),
            (f"{alert}/resolve", {"outcome": "false_alarm"}),
            (f"{alert}/resolve", {"outcome": "fixed"}),
            ("/actions", {"ids": _CAMERAS, "action": "put_back"}),
            ("/actions", {"ids": _CAMERAS, "action": "undo"}),
            ("/actions", {"ids": _CAMERAS, "action": "tag", "add": ["a"], "remove": ["b"]}),
            ("/actions", {"ids": [each["id"] for each in firing] or ["none"], "action": "resolve",
                       "outcome": "false_alarm"}),
        ]
    )  # fmt: skip
    return http.post(path, json=body)


def test_acts_at_once_leave_one_alert_of_a_kind_and_no_error(http, fleet):
    for camera_id in _CAMERAS:
        fleet.add(camera_id)
        with fleet.store.write() as session:
            references.newest(session, camera_id).source = "bytetrack"
        fleet.knock(camera_id)
    answers, errors = Counter(), []

    def person(number):
        chosen = random.Random(number)
        for _ in range(_ACTS_EACH):
            try:
                answer = act(http, chosen)
            except Exception as error:
                errors.append(repr(error))
                continue
            answers[answer.status_code] += 1
            if answer.status_code >= 500:
                errors.append(answer.text)

    def estimates():
        chosen = random.Random(99)
        for _ in range(_ACTS_EACH):
            kind = chosen.choice(["drift", "clock", "unsure"])
            try:
                fleet.knock(chosen.choice(_CAMERAS), kind=kind)
            except AssertionError:  # under maintenance nothing opens
                pass
            except Exception as error:
                errors.append(repr(error))

    threads = [threading.Thread(target=person, args=(number,)) for number in range(_PEOPLE)]
    threads.append(threading.Thread(target=estimates))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert errors == []
    assert sum(answers.values()) == _PEOPLE * _ACTS_EACH
    assert answers[200] > _PEOPLE * _ACTS_EACH / 3
    every = http.get("/alerts", params={"limit": 1000}).json()["items"]
    firing = [each for each in every if each["state"] == "firing"]
    pairs = [(each["camera_id"], each["kind"]) for each in firing]
    assert len(pairs) == len(set(pairs))
    over = {each["id"] for each in every if each["state"] == "resolved"}
    assert [each for each in firing if each["group_id"] in over] == []
    assert {each["outcome"] for each in firing} <= {None}
    log = http.get("/activity", params={"limit": 1000}).json()["items"]
    ended = Counter(each["subject_id"] for each in log if each["what"] == "alert.resolved")
    opened = Counter(
        each["subject_id"] for each in log if each["what"] in ("alert.opened", "alert.reopened")
    )
    for each in every:  # opened once more than ended while it fires
        assert opened[each["id"]] - ended[each["id"]] == (each["state"] == "firing")
    for camera_id in _CAMERAS:
        assert http.get(f"/cameras/{camera_id}/pose").status_code == 200
