"""Logging in, and pages of strangers in an operator's browser: a real service, a real browser."""

import io
import re
import shutil

import pytest
from PIL import Image

from service.access import tokens
from service.access.tokens import TokenSpec
from service.settings import Settings
from service.store.engines.store import Store
from tests.browser.conftest import axe, shoot, too_wide
from tests.browser.hostile import hostile_page
from tests.conftest import CAMERA
from tests.running import RunningService, free_port

pytestmark = pytest.mark.slow


def make_token(settings, *scopes, name="ada"):
    with Store(settings).write() as session:
        return tokens.make_token(session, TokenSpec(name=name, scopes=scopes), None).text


def started(folder, migrated, **changes):
    made = Settings(
        data_dir=folder / "data",
        workers=0,
        port=free_port(),
        snapshots="pictures",
        allowed_hosts="cameras.test",
        caller_rate=0,
        **changes,
    )
    shutil.copytree(migrated, made.data_dir)
    return RunningService(made)


@pytest.fixture(scope="module")
def closed(tmp_path_factory, migrated):
    """A service with access on, asked by an administrator's token."""
    running = started(tmp_path_factory.mktemp("closed"), migrated, auth="on")
    running.token = make_token(running.settings, "admin", "ingest")
    running.http.headers["Authorization"] = f"Bearer {running.token}"
    running.start()
    yield running
    running.stop()


@pytest.fixture(scope="module")
def open_(tmp_path_factory, migrated):
    """A service with access off, as it is on loopback."""
    running = started(tmp_path_factory.mktemp("open"), migrated)
    running.start()
    yield running
    running.stop()


def log_in(page, url, token):
    page.goto(url)
    page.get_by_label("Your token").fill(token)
    page.get_by_role("button", name="Log in").click()


@pytest.fixture(scope="module")
def turned_out(closed, browser):
    """A page whose session ends: until it knows, which takes 7 s, other tests can be done."""
    context = browser.new_context(base_url=closed.url)
    page = context.new_page()
    guest = make_token(closed.settings, "read", name="guest")
    log_in(page, "/", guest)
    page.get_by_text("Live").wait_for()
    closed.http.delete(f"/tokens/{guest.split('_')[1]}").raise_for_status()
    yield page
    context.close()


@pytest.mark.usefixtures("turned_out")
def test_a_person_logs_in_makes_a_token_and_logs_out(closed, browser):
    context = browser.new_context(base_url=closed.url, viewport={"width": 1280, "height": 800})
    page = context.new_page()
    said = []
    page.on("pageerror", lambda error: said.append(str(error)))
    page.on("console", lambda line: "Security Policy" in line.text and said.append(line.text))
    page.goto("/ui/tokens")
    assert axe(page) == []
    shoot(page, "login")
    log_in(page, "/ui/tokens", "sf_0_0")
    assert "nobody is let in" in page.get_by_role("alert").text_content()
    log_in(page, "/ui/tokens", closed.token)
    page.wait_for_url("**/ui/tokens")
    page.get_by_label("For whom").fill("gate")
    page.get_by_label("ingest").check()
    page.get_by_role("button", name="Make it").click()
    assert re.fullmatch(r"sf_[0-9a-f]{12}_\S{43}", page.locator("#made").text_content())
    assert axe(page) == []
    shoot(page, "tokens")
    page.set_viewport_size({"width": 360, "height": 700})
    assert too_wide(page) <= 0
    gate = page.get_by_role("row").filter(has_text="gate")
    gate.get_by_text("Revoke…").click()  # it asks before it does
    gate.get_by_role("button", name="Revoke it").click()
    gate.get_by_text("revoked 20").wait_for()
    page.goto("/")
    page.get_by_text("Live").wait_for()  # the stream of events takes the cookie
    page.get_by_role("button", name="Log out").click()
    page.wait_for_url("**/ui/login")
    page.goto("/")
    page.wait_for_url("**/ui/login")
    context.close()
    assert said == []


def test_who_may_only_look_is_offered_no_acts(closed, browser):
    assert closed.http.post("/cameras", json=CAMERA).status_code in (201, 409)
    offered = {}
    context = browser.new_context(base_url=closed.url)
    page = context.new_page()
    for scope in ("read", "operate"):
        context.clear_cookies()
        log_in(page, "/", make_token(closed.settings, scope, name=scope))
        page.get_by_text("Live").wait_for()
        page.goto("/ui/cameras/corner")
        page.locator("#more > summary").click()
        page.get_by_role("heading", name="What can be done").wait_for()
        buttons = page.locator("[data-action]:visible").evaluate_all(
            "all => all.map(b => b.dataset.action)"
        )
        offered[scope] = set(buttons)
        if scope == "read":
            assert page.get_by_text("Your token lets you look").is_visible()
            assert axe(page) == []
    context.close()
    assert offered["read"] == set()
    assert {"put-back", "relearn", "train", "maintain"} <= offered["operate"]
    assert not {"edit", "remove"} & offered["operate"]


def test_a_page_whose_session_is_over_leads_to_the_login(turned_out):
    turned_out.wait_for_url("**/ui/login", timeout=30_000)


def seeded(http):
    """What is there to be changed or read, and how that is looked at from outside."""
    assert http.post("/cameras", json=CAMERA).status_code in (201, 409)
    picture = io.BytesIO()
    Image.new("RGB", (64, 36), "red").save(picture, "PNG")
    png = {"Content-Type": "image/png"}
    http.put("/cameras/corner/snapshot", content=picture.getvalue(), headers=png).raise_for_status()
    hook = http.post("/webhooks", json={"url": "https://8.8.8.8/"}).json()["id"]
    return hook, lambda: [
        re.sub('"used_at":[^,]*', "", http.get(path, params={"limit": 1000}).text)
        for path in ("/activity", "/cameras", "/cameras/corner/trainings", "/tokens", "/webhooks")
    ]


def refusals(http):
    """How many requests were answered with 403."""
    counts = re.findall(
        r'surefoot_http_requests_total{.*status="403"} (\d+)', http.get("/metrics").text
    )
    return sum(map(int, counts))


@pytest.mark.parametrize(
    ("here", "attacker"),
    [
        ("127.0.0.1", "127.0.0.1"),  # another port: the same site, and the cookie comes along
        ("127.0.0.1", "localhost"),
        ("127.0.0.1", "evil.test"),
        ("cameras.test", "evil.test"),
    ],
)
@pytest.mark.parametrize("access", ["on", "off"])
def test_a_page_of_strangers_changes_and_reads_nothing(request, browser, attacker, here, access):
    service = request.getfixturevalue("closed" if access == "on" else "open_")
    hook, look = seeded(service.http)
    context = browser.new_context()
    page = context.new_page()
    target = f"http://{here}:{service.settings.port}"
    if access == "on":
        log_in(page, target, service.token)
        page.wait_for_url(f"{target}/")
    before, refused = look(), refusals(service.http)
    posts = [
        ("/cameras/corner/reference/reset", {}),
        ("/cameras/corner/trainings", {}),
        (f"/webhooks/{hook}/secret", {}),
        ("/cameras", {'{"id": "': 'x"}'}),
        ("/ui/tokens", {"name": "evil", "scopes": "admin"}),
        ("/ui/login", {"token": "sf_0_0"}),
        ("/ui/logout", {}),
        ("/ui/calibration", {"K": "["}),
    ]
    gets = ["/cameras", "/tokens", "/cameras/corner/snapshot", "/", "/activity"]
    image = "/cameras/corner/snapshot"
    with hostile_page(target, posts=posts, gets=gets, image=image) as port:
        page.goto(f"http://{attacker}:{port}/")
        page.wait_for_function("window.done", timeout=60_000)
        assert page.evaluate("window.tried") > 40
        assert page.evaluate("window.loot") == []
    assert look() == before
    assert refusals(service.http) - refused > 30  # all of that came to the service
    if access == "on":
        page.goto(target)  # nobody was logged out either
        page.get_by_role("button", name="Log out").wait_for()
    context.close()


def test_a_name_that_was_made_to_lead_here_is_not_served(open_, browser):
    context = browser.new_context()
    page = context.new_page()
    answer = page.goto(f"http://rebound.test:{open_.settings.port}/cameras")
    assert answer.status == 421
    assert page.goto(f"http://cameras.test:{open_.settings.port}/cameras").status == 200
    context.close()
