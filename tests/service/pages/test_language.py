"""Pages in the language of their reader; and no word on them that no catalogue has."""

import re
from datetime import UTC, datetime, timedelta
from io import BytesIO

import pytest
from fastapi.testclient import TestClient
from PIL import Image

from service.api.middleware.scopes import NEEDS
from service.app import create_app
from service.store import workers
from service.wording import language
from tests.conftest import CAMERA, track
from tests.service.bench import PRIOR, moved
from tests.service.pages.words import Bracketing, outside_brackets

GERMAN = {"Accept-Language": "de-AT,de;q=0.9,en;q=0.5"}
DATA = ("The corner", "corner", "gate", "Ada", "a ladder", "on call", "local-1", "tracker-1")


@pytest.mark.parametrize(
    ("header", "said"),
    [
        ("de", "de"),
        ("de-CH", "de"),
        ("en-GB,de;q=0.8", "en"),
        ("fr;q=1.0, de;q=0.7, en;q=0.3", "de"),
        ("en;q=0.2,de;q=0.9", "de"),
        ("de;q=0", "en"),
        ("nl,da;q=much", "en"),
        ("", "en"),
    ],
)
def test_a_page_is_in_the_language_that_is_wanted_most(corner, header, said):
    answer = corner.get("/", headers={"Accept-Language": header})
    assert answer.headers["content-language"] == said
    assert f'<html lang="{said}">' in answer.text
    assert {"Accept-Language", "Cookie"} <= set(answer.headers["vary"].split(", "))
    assert answer.headers["cache-control"] == "no-store"
    word = {"en": "Unconnected", "de": "Nicht verbunden"}[said]
    assert word in answer.text


def test_who_chose_a_language_keeps_it_and_comes_back(corner):
    here = {"Referer": "http://testserver/ui/alerts?kind=drift"}
    chosen = corner.post(
        "/ui/language", data={"language": "de"}, headers=here, follow_redirects=False
    )
    assert chosen.status_code == 303
    assert chosen.headers["location"] == "/ui/alerts?kind=drift"
    assert re.search(r"surefoot_language=de; Max-Age=31536000; .*SameSite=lax", str(chosen.headers))
    assert '<html lang="de">' in corner.get("/ui/alerts").text
    assert '<html lang="de">' in corner.get("/", headers={"Accept-Language": "en"}).text
    corner.post("/ui/language", data={"language": "en"})
    assert '<html lang="en">' in corner.get("/", headers=GERMAN).text


def test_a_language_that_there_is_not_is_none_and_leads_nowhere_else(corner):
    here = {"Referer": "//elsewhere.example/x"}
    answer = corner.post(
        "/ui/language", data={"language": "../x"}, headers=here, follow_redirects=False
    )
    assert "set-cookie" not in answer.headers
    assert answer.headers["location"] == "/x"
    corner.cookies.set("surefoot_language", "../x")
    assert '<html lang="en">' in corner.get("/").text


def test_what_programs_read_is_english(bench):
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0))
    http = bench.http
    http.cookies.set("surefoot_language", "de")
    for path in ("/alerts", "/cameras/corner/pose", "/alerts?format=csv", "/cameras/nowhere"):
        assert http.get(path, headers=GERMAN).text == http.get(path).text
    assert "against the prior pose" in http.get("/alerts", headers=GERMAN).text
    assert "content-language" not in http.get("/alerts", headers=GERMAN).headers


def test_a_page_says_numbers_and_days_in_german(bench):
    bench.see(PRIOR, paths=True)
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0, heading_deg=-3.0), paths=True)
    text = bench.http.get("/ui/cameras/corner", headers=GERMAN).text
    assert re.search(
        r"Die Kamera ist verstellt: um 5,8° gedreht \(Schwenk −3,0°, Neigung \+5,0°\), etwa "
        r"(gestern )?\d\d:\d\d; genau auf ±0,4°\.",
        text,
    )
    assert "Eine Person in 10 m erscheint jetzt 2,4 m zu weit weg" in text
    assert "Neue Ausrichtung behalten" in text
    with language.speaking("de"):
        assert language._n("{n} person", "{n} people", 1) == "1 Person"
        assert language._("turned {deg:.1f}°", deg=1234.5) == "um 1234,5° gedreht"
        assert language.number(1234.5, ",.1f") == "1.234,5"


def test_a_form_is_answered_in_german(http):
    typed = {"width": "1920", "height": "-3", "fx": "", "height_m": "12 Fuß", "tilt_deg": "20"}
    wrong = http.post("/ui/preview", json={"fields": typed}, headers=GERMAN).json()["errors"]
    assert wrong["height"] == "muss größer als 0 sein (erhalten: -3)"
    assert wrong["height_m"] == "eine Zahl wird gebraucht, nicht '12 Fuß'"
    typed |= {"height": "1080", "fx": "1100", "height_m": "6,5", "tilt_deg": "-20"}
    says = http.post("/ui/preview", json={"fields": typed}, headers=GERMAN).json()["says"]
    assert says[0]["text"].startswith("Die Kamera schaut 20,0° nach oben, also sind nur 12 % des")
    refused = http.post("/ui/register", json=typed | {"fx": ""}, headers=GERMAN).json()["errors"]
    assert refused == [{"pointer": "/fx", "reason": "ist erforderlich"}]
    # A height that R and t make is too much, and not under the ground, in each language.
    turned = {"form": "matrix", "rotation": "1.5707963 0 0", "translation_m": "0 20000 0"}
    for said in (GERMAN, {}):
        high = http.post("/ui/register", json=typed | turned, headers=said).json()["errors"]
        assert high == [
            {"pointer": "/translation_m", "reason": "at most 10000 m are taken, got 20000"}
        ]


@pytest.fixture
def everything(bench, settings):
    """A camera that moved, is silenced, was answered; one that learns; one nobody calibrated."""
    http = bench.http
    now = datetime.now(UTC)
    with bench.store.write() as session:
        workers.add(session, "local-1", 1, now - timedelta(minutes=7))
    labels = {"site": "gate", "tags": ["gate"]}
    http.patch("/cameras/corner", json=labels, headers={"If-Match": "*"}).raise_for_status()
    bench.see(PRIOR, paths=True)
    still = BytesIO()
    Image.new("RGB", (1280, 720)).save(still, "PNG")
    for _ in range(3):
        bench.see(moved(tilt_deg=5.0, height_m=0.5), paths=True)
    (alert,) = bench.alerts()
    path = f"/alerts/{alert['id']}"
    http.post(f"{path}/acknowledge", json={"by": "Ada"}).raise_for_status()
    until = (now + timedelta(hours=4)).isoformat()
    http.post(f"{path}/silence", json={"until": until, "by": "Ada"}).raise_for_status()
    window = {"to": (now + timedelta(hours=2)).isoformat(), "reason": "a ladder", "by": "Ada"}
    http.post("/cameras/corner/maintenance", json=window).raise_for_status()
    zone = {"id": "gate", "on": "ground", "points": [[300, 400], [500, 410], [480, 600]]}
    http.put(
        "/cameras/corner/zones", json={"zones": [zone]}, headers={"If-Match": "*"}
    ).raise_for_status()
    http.post("/tokens", json={"name": "Ada", "scopes": ["read"]}).raise_for_status()
    hook = {"url": "https://1.1.1.1/x", "name": "on call"}
    made = http.post("/webhooks", json=hook).raise_for_status().json()
    http.post(f"/webhooks/{made['id']}/test").raise_for_status()
    bare = {name: value for name, value in CAMERA.items() if name != "prior_pose"}
    http.post("/cameras", json=bare | {"id": "gate", "name": "gate"}).raise_for_status()
    learning = CAMERA | {"id": "gate-2", "name": "gate"}
    http.post("/cameras", json=learning).raise_for_status()
    short = {"id": "1", "points": track("1")["points"][:2]}
    batch = {"source": "tracker-1", "tracks": [short, *(track(str(n)) for n in range(2, 9))]}
    http.post("/cameras/gate-2/tracks", json=batch).raise_for_status()
    return http


@pytest.fixture
def bracketing(monkeypatch):
    """German is English in brackets."""
    monkeypatch.setattr(language, "_translations", lambda code: Bracketing())


PAGES = sorted(
    path for (method, path), _ in NEEDS.items() if method == "GET" and path.startswith("/ui/")
)
IDS = ("corner", "gate", "gate-2")


def test_no_word_of_a_page_is_left_unmarked(everything, bracketing):
    """A text that no catalogue has stands outside of the brackets."""
    looked = 0
    for path in ["/", *PAGES]:
        for camera in IDS if "{camera_id}" in path else IDS[:1]:
            url = path.format(camera_id=camera)
            answer = everything.get(url, headers=GERMAN)
            if "html" not in answer.headers["content-type"]:
                continue
            assert outside_brackets(answer.text, DATA) == [], url
            assert path in ("/ui/login",) or answer.status_code == 200, url
            looked += "⟦" in answer.text
    assert looked > 20
    missing = everything.get("/ui/cameras/nowhere", headers={**GERMAN, "Accept": "text/html"})
    assert missing.status_code == 404
    assert outside_brackets(missing.text, DATA) == []
    wrong = everything.post("/ui/tokens", data={"name": "", "days": "0"}, headers=GERMAN)
    assert wrong.status_code == 422
    assert outside_brackets(wrong.text, DATA) == []


def test_a_login_is_refused_in_german(settings):
    closed = settings.model_copy(update={"auth": "on"})
    with TestClient(create_app(closed)) as http:
        page = http.get("/ui/login", headers=GERMAN).text
        assert "Bei surefoot anmelden" in page
        refused = http.post("/ui/login", data={"token": "sf_a_b"}, headers=GERMAN)
    assert refused.status_code == 401
    assert "damit wird niemand eingelassen" in refused.text


def test_an_unmarked_word_is_found():
    page = '<p title="here">⟦Every <b>word</b>⟧ but <code>one</code><br>one</p><input alt="⟦a⟧">'
    assert outside_brackets(page, ("one",)) == ["here", "but"]
