"""The service as it is asked: lists to their end, and answers that cannot be read are for later."""

import httpx
import pytest

from surefoot.bridge import service as module
from surefoot.bridge.service import LaterError, Service


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
