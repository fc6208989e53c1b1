"""The service as it is asked: lists to their end, and answers that cannot be read are for later."""

from types import SimpleNamespace

import httpx
import pytest

from surefoot.bridge import service as module
from surefoot.bridge.service import LaterError, Service
from surefoot.bridge.spool import Group
from tests.surefoot.bridge.halves import posting_of


def asking(monkeypatch, answer):
    """A client of a service that answers so."""
    plain = httpx.Client
    transport = httpx.MockTransport(answer)
    monkeypatch.setattr(module.httpx, "Client", lambda **given: plain(**given, transport=transport))
    return Service("http://surefoot", None)


def test_a_list_is_read_to_its_end(monkeypatch):
    asked = []

    def answer(request):
        asked.append(dict(request.url.params))
        number = int(asked[-1].get("cursor", 0))
        after = str(number + 1) if number < 2 else None
        return httpx.Response(200, json={"items": [{"id": number}], "next_cursor": after})

    service = asking(monkeypatch, answer)
    assert [each["id"] for each in service.items("/alerts", state="firing")] == [0, 1, 2]
    assert [each.get("cursor") for each in asked] == [None, "1", "2"]
    assert {each["state"] for each in asked} == {"firing"}


def test_an_answer_that_a_proxy_has_broken_is_asked_for_again(monkeypatch):
    headers = {"content-type": "application/json", "content-encoding": "gzip"}

    def answer(_):
        return httpx.Response(200, headers=headers, stream=httpx.ByteStream(b"no gzip"))

    service = asking(monkeypatch, answer)
    with pytest.raises(LaterError, match="DecodingError"):
        service.get("/cameras")
    with pytest.raises(LaterError, match="DecodingError"):
        list(service.events(None))


def test_skipped_tracks_are_counted_and_a_reason_is_logged_once_a_camera(monkeypatch, caplog):
    caplog.set_level("INFO", "surefoot.bridge")
    receipt = {"accepted": 0, "duplicates": 0, "rejected": [], "skipped": {"not_a_person": 2}}
    service = asking(monkeypatch, lambda _: httpx.Response(202, json=receipt))
    dropped = []
    posting = posting_of(SimpleNamespace(drop=dropped.append), service)
    for camera in ("yard", "yard", "gate"):
        posting._post(Group(camera, b'{"source":"frames"}', {1: b"{}"}))
    assert posting.tally.report()["counts"]["tracks_skipped"] == 6
    logged = [(each.camera_id, each.reason, each.tracks) for each in caplog.records]
    assert logged == [("yard", "not_a_person", 2), ("gate", "not_a_person", 2)]
    assert len(dropped) == 3
