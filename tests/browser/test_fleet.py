"""The fleet page in a browser: live, sifted by keyboard, on a phone."""

import re
from datetime import UTC, datetime, timedelta

import pytest

from service.wording.times import Clock
from tests.browser.conftest import axe, shoot, too_wide, watched
from tests.running import served
from tests.service.fleet_bench import Fleet, afternoon

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def server(tmp_path_factory, migrated):
    with served(tmp_path_factory.mktemp("fleet"), migrated) as running:
        yield running


@pytest.fixture
def fleet(server):
    """A fleet that is empty, whatever tests before this one had in theirs."""
    made = Fleet(server.settings)
    yield made
    made.close()
    for camera in server.http.get("/cameras", params={"limit": 1000}).json()["items"]:
        url = f"/cameras/{camera['id']}"
        server.http.delete(url, headers={"If-Match": "*"}).raise_for_status()


def shown(page):
    # Not the texts as they are laid out: a row that was hidden is laid out with the next frame.
    return page.locator("li.row:not([hidden]) .who a").all_text_contents()


@pytest.mark.parametrize("width", [390, 1280])
def test_a_row_that_is_read_aloud_says_what_its_times_are(page, fleet, width):
    fleet.add("alpha", "Alpha")
    page.set_viewport_size({"width": width, "height": 844})
    page.goto("/")
    read = page.locator("#row-alpha").aria_snapshot()
    assert "Steady" in read
    assert "changed" in read
    assert "last person" in read
    overflow = page.evaluate("document.documentElement.scrollWidth - innerWidth")
    assert overflow <= 0


def test_an_alert_comes_up_by_itself(page, fleet, server):
    for name in ("Alpha", "Beta", "Gamma"):
        fleet.add(name.lower(), name)
    page.goto("/")
    page.get_by_text("Live").wait_for()
    assert shown(page) == ["Alpha", "Beta", "Gamma"]
    page.evaluate("window.same = true")
    fetched = []
    page.on("request", lambda request: fetched.append(request.url.split("/", 3)[3]))
    fleet.knock("beta", tilt_deg=4.0)
    page.locator("#row-beta.drifting").wait_for()
    assert shown(page) == ["Beta", "Alpha", "Gamma"]
    assert "turned 4.1° (tilt +4." in page.locator("#row-beta .words").inner_text()
    assert "Beta: turned" in page.locator("#announce").inner_text()
    assert page.title().startswith("(1) ")
    assert page.locator('.chip[data-state="drifting"] b').inner_text() == "1"
    assert page.evaluate("window.same")  # not loaded anew
    assert fetched == ["ui/fleet/rows?ids=beta"]
    page.evaluate("document.getElementById('announce').textContent = ''")
    (alert,) = server.http.get("/alerts").json()["items"]
    server.http.post(f"/alerts/{alert['id']}/acknowledge", json={"by": "Ada"}).raise_for_status()
    page.get_by_text("acknowledged by Ada").wait_for()
    assert page.title().startswith("Cameras")  # the number fell, and nothing was called out
    assert page.locator("#announce").inner_text() == ""


@pytest.mark.parametrize("width", [981, 1280])
def test_cells_stand_under_their_heads_and_keep_to_themselves(page, fleet, width):
    fleet.add("alpha", "Alpha")
    fleet.now -= timedelta(minutes=20)  # "29 minutes ago" is as wide as such words become
    fleet.knock("alpha", tilt_deg=4.0)
    fleet.add("beta", "Beta")
    fleet.knock("beta", kind="unsure", severity="warning")
    fleet.add("gamma", "Gamma", state="suspected", tilt_deg=1.5)
    page.set_viewport_size({"width": width, "height": 700})
    page.goto("/")
    page.locator("#row-alpha.drifting").wait_for()
    heads, rights, texts = page.evaluate(
        """() => {
          const inner = (cell) => {
            const range = document.createRange();
            range.selectNodeContents(cell);
            return range.getBoundingClientRect();
          };
          const cells = [...document.querySelectorAll("#row-alpha > span")];
          return [
            [...document.querySelectorAll(".heads > span")].map((cell) => inner(cell).left),
            cells.map((cell) => cell.getBoundingClientRect().right),
            cells.map((cell) => [inner(cell).left, inner(cell).right]),
          ];
        }"""
    )
    edge = page.locator("#row-alpha").bounding_box()
    assert rights[-1] <= edge["x"] + edge["width"]  # at 920 px the last column was cut off
    for column in (1, 2, 4, 5):  # a badge and a drawing have edges of their own
        assert texts[column][0] == pytest.approx(heads[column], abs=1)
        assert texts[column][1] <= rights[column] + 1
    apart = page.evaluate(
        """() => [...document.querySelectorAll("li.row")].map((row) =>
          row.querySelector(".who").getBoundingClientRect().left
          - row.querySelector(".badge").getBoundingClientRect().right)"""
    )
    assert len(apart) == 3  # a word of each state that asks for somebody
    assert min(apart) > 0
    shoot(page, f"fleet-states-{width}")


def test_a_camera_that_comes_and_one_that_goes(page, fleet, server):
    fleet.add("alpha", "Alpha")
    page.goto("/")
    page.get_by_text("Live").wait_for()
    fleet.add("beta", "Beta", state="learning")
    page.locator("#row-beta").wait_for()
    assert shown(page) == ["Beta", "Alpha"]


def test_open_pages_follow_what_is_changed_and_removed(page, fleet, server, browser):
    """They were wrong for two minutes: no event told of it."""
    fleet.add("alpha", "Alpha")
    fleet.add("beta", "Beta")
    page.goto("/")
    page.get_by_text("Live").wait_for()
    with watched(browser, server) as (its_page, wrong):
        its_page.goto("/ui/cameras/beta")
        its_page.get_by_text("Live", exact=True).wait_for()
        path, any_version = "/cameras/beta", {"If-Match": "*"}
        server.http.patch(path, json={"name": "Bravo"}, headers=any_version).raise_for_status()
        page.get_by_text("Bravo").wait_for()
        its_page.get_by_role("heading", name="Bravo").wait_for()
        server.http.delete(path, headers=any_version).raise_for_status()
        page.locator("#row-beta").wait_for(state="detached")
        its_page.get_by_text("This camera was removed.").wait_for()
        assert its_page.locator("#camera").is_hidden()
        wrong.clear()  # the browser says of the page's 404
    assert shown(page) == ["Alpha"]


def test_it_comes_back_by_itself_and_has_missed_nothing(page, fleet, server):
    fleet.add("alpha", "Alpha")
    page.goto("/")
    page.get_by_text("Live").wait_for()
    server.process.kill()
    server.process.wait(10)
    page.get_by_text("Reconnecting").wait_for()
    page.get_by_text("does not answer. What you see is as of").wait_for()
    fleet.knock("alpha")
    server.start()
    page.locator("#row-alpha.drifting").wait_for()
    page.get_by_text("Live").wait_for()
    page.get_by_text("does not answer").wait_for(state="detached")


def test_a_page_that_is_being_left_asks_nothing_more(page, fleet):
    """It told of a lost connection and asked why: 50 ms before the next page was begun."""
    expect = pytest.importorskip("playwright.sync_api").expect
    page.add_init_script(
        """const fetched = window.fetch;
        window.fetch = (url, given) => {
            sessionStorage.asked = `${sessionStorage.asked ?? ""} ${url}`;
            return fetched(url, given);
        };"""
    )
    for _ in range(4):
        page.goto("/")
        expect(page.locator("#live")).to_have_text("Live")
        page.wait_for_timeout(300)
    assert "limit=1" not in page.evaluate("sessionStorage.asked")


def test_what_happened_while_the_page_was_made_is_not_lost(page, fleet, server):
    fleet.add("alpha", "Alpha")
    page.goto("/")
    newest = page.locator('meta[name="newest-event"]').get_attribute("content")
    fleet.knock("alpha")
    stream = server.http.stream("GET", f"/events?after={newest}")
    with stream as answer:
        line = next(line for line in answer.iter_lines() if line.startswith("event:"))
    assert line == "event: alert"


def test_it_is_sifted_by_keyboard_and_the_address_keeps_it(page, fleet):
    fleet.add("north-1", "North stairs")
    fleet.add("north-2", "North door", state="learning")
    fleet.add("quay", "Quay", state="learning")
    page.goto("/")
    page.keyboard.press("/")
    page.keyboard.type("nor")
    assert shown(page) == ["North door", "North stairs"]
    assert page.locator("#found").inner_text() == "2 cameras"
    # the chips of moved, clock, lens, unsure, maybe moved, no people, uncalibrated, unconnected,
    # learning
    for _ in range(9):
        page.keyboard.press("Tab")
    page.keyboard.press("Space")
    assert shown(page) == ["North door"]
    assert page.url.endswith("/?q=nor&state=learning")
    page.reload()
    assert shown(page) == ["North door"]
    assert page.locator(".chip.learning").get_attribute("aria-pressed") == "true"
    page.locator("#search").focus()
    page.keyboard.press("Escape")
    page.locator("#row-quay").wait_for()  # it was not asked for before
    assert shown(page) == ["North door", "Quay"]


@pytest.mark.nightly
def test_many_are_paged_sorted_and_chosen_across_pages(page, fleet, server):
    expect = pytest.importorskip("playwright.sync_api").expect
    for n in range(60):
        fleet.add(f"c{n:02}", f"Camera {n:02}", tracks=1, estimates=1)
    for n in (57, 58):
        fleet.knock(f"c{n}")
    page.goto("/?sort=name")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_text("Live").wait_for()
    expect(page.locator("li.row")).to_have_count(50)
    page.get_by_role("button", name="Next").click()
    expect(page.locator("#shown")).to_have_text("51 to 60 of 60")
    expect(page.locator("li.row")).to_have_count(10)
    assert shown(page) == [f"Camera {n}" for n in range(50, 60)]
    assert page.url.endswith("/?sort=name&page=2")
    page.reload()
    expect(page.locator("li.row")).to_have_count(10)
    page.locator(".chip.drifting").click()
    expect(page.locator("li.row")).to_have_count(2)
    assert shown(page) == ["Camera 57", "Camera 58"]
    page.locator(".chip.clock").click()  # chips add up
    assert page.url.endswith("/?state=drifting&state=clock&sort=name")
    page.get_by_label("Choose all that are found").check()
    expect(page.locator("#chosen")).to_have_text("2 cameras")
    shoot(page, "fleet-chosen")
    assert axe(page) == []
    page.get_by_role("button", name="They were put back").click()
    page.locator(".chip.drifting[aria-pressed=true] b", has_text="0").wait_for()
    expect(page.locator("#bulk")).to_be_hidden()
    found = server.http.get("/alerts").json()["items"]
    assert {(a["outcome"], a["resolved_by"]) for a in found} == {("put_back", "Ada")}


def test_what_is_alike_stands_together_moves_first(page, fleet, server):
    """Of one rank clocks and lesser moves stood as they came, which read as unsorted."""
    expect = pytest.importorskip("playwright.sync_api").expect
    for name, kind in (("A", "clock"), ("B", "drift"), ("C", "clock"), ("D", "drift")):
        fleet.add(name.lower(), name, state="drifting" if kind == "drift" else "ok")
        fleet.knock(name.lower(), kind=kind, severity="warning")
    told = re.findall(r'id="row-(.)"', server.http.get("/", headers={"Accept": "text/html"}).text)
    assert told == ["b", "d", "a", "c"]
    page.goto("/?sort=name")
    page.get_by_text("Live").wait_for()
    names = page.locator("li.row .who a")
    expect(names).to_have_text(["A", "B", "C", "D"])
    page.locator("#sort").select_option("")
    expect(names).to_have_text(["B", "D", "A", "C"])


def test_a_name_is_never_run(page, fleet):
    name = "<script>alert(1)</script><img src=x onerror=alert(1)>"
    fleet.add("bad", name)
    page.on("dialog", lambda dialog: pytest.fail(dialog.message))
    page.goto("/")
    page.get_by_text("Live").wait_for()
    fleet.knock("bad")
    page.locator("#row-bad.drifting").wait_for()
    assert shown(page) == [name]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_everybody_can_read_it(page, fleet, scheme):
    afternoon(fleet, 30)
    page.emulate_media(color_scheme=scheme)
    page.goto("/")
    page.get_by_text("Live").wait_for()
    assert axe(page) == []
    shoot(page, f"fleet-{scheme}")
    for width in (360, 768, 2560):
        page.set_viewport_size({"width": width, "height": 800})
        assert too_wide(page) <= 0, width


def test_the_browser_says_ages_as_the_service_does(page, fleet):
    page.goto("/")
    now = datetime.now(UTC)
    said = """async ages => {
        const {ago} = await import(
            document.querySelector('script[src*="fleet.js"]').src.replace("fleet.js", "times.js"));
        return ages.map(age => ago(new Date(Date.now() - 1000 * age).toISOString()));
    }"""
    # Not at the edge of a rounding: the browser's clock goes on.
    ages = [-7e6, -7200, -70.8, -30, 5, 40.2, 80, 100, 5000, 8900, 1e5, 3e5, 11e5, 5e6, 4e7, 9e7]
    clock = Clock(now=now, zone=UTC)
    words = [clock.ago(now - timedelta(seconds=age)) for age in ages]
    assert page.evaluate(said, ages) == words
    assert "2 hours ago" in words


def test_cameras_that_nobody_posts_for_are_found_by_their_own_filter(page, fleet):
    fleet.add("alpha", "Alpha", state="learning")
    fleet.add("beta", "Beta", state="unconnected", tracks=0)
    page.goto("/")
    assert shown(page) == ["Beta", "Alpha"]  # who must do something before who must wait
    page.locator(".chip.unconnected").click()
    assert shown(page) == ["Beta"]
    row = page.locator("#row-beta")
    assert "nobody has posted tracks for it yet" in row.inner_text()
    assert row.locator("progress").count() == 0
    assert axe(page) == []
    shoot(page, "fleet-unconnected")


def test_many_are_answered_at_once_said_how_many_and_undone(page, fleet, server):
    """The toast said "Noted." and had no way back; two clock faults were offered "put back"."""
    expect = pytest.importorskip("playwright.sync_api").expect
    for n in range(6):
        fleet.add(f"c{n}", f"Corner {n}", tilt_deg=3.0)
        fleet.knock(f"c{n}")
    for n in range(2):
        fleet.add(f"clock{n}", f"Clock {n}", tilt_deg=3.0)
        fleet.knock(f"clock{n}", kind="clock")
    fleet.add("still", "Still")
    page.goto("/")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_text("Live").wait_for()
    put_back = page.get_by_role("button", name="They were put back")
    mixed, undo = page.locator("#mixed"), page.locator("#undo")
    for n in range(2):
        page.get_by_label(f"Choose Clock {n}").check()
    expect(put_back).to_be_hidden()
    expect(page.get_by_role("button", name="Fixed", exact=True)).to_be_visible()
    expect(mixed).to_have_text("")
    page.get_by_label("Choose all that are found").check()
    expect(put_back).to_be_hidden()
    expect(mixed).to_have_text(
        "Not every answer fits all: 2 of 9 are clock faults (Clock 0, Clock 1), "
        "1 has no open alert (Still)."
    )
    expect(page.get_by_role("button", name="Plan maintenance…")).to_be_visible()
    shoot(page, "fleet-mixed")
    for name in ("Clock 0", "Clock 1", "Still"):
        page.get_by_label(f"Choose {name}").uncheck()
    expect(mixed).to_have_text("")
    # Two of them are answered by somebody else before the click.
    page.route("**/ui/fleet/**", lambda route: route.abort())
    ids = [
        a["id"]
        for a in server.http.get("/alerts").json()["items"]
        if a["camera_id"] in ("c0", "c1")
    ]
    body = {"ids": ids, "action": "resolve", "outcome": "false_alarm", "by": "Bo"}
    server.http.post("/actions", json=body).raise_for_status()
    put_back.click()
    expect(undo).to_contain_text("Put back: 4 of 6 cameras; 2 were answered meanwhile.")
    page.unroute("**/ui/fleet/**")
    assert axe(page) == []
    shoot(page, "fleet-undo")
    page.set_viewport_size({"width": 390, "height": 844})
    shoot(page, "fleet-undo-phone")
    page.set_viewport_size({"width": 1280, "height": 800})
    undo.get_by_role("button", name="Undo").click()
    expect(page.locator("#announce")).to_have_text("Undone: 4 cameras.")
    expect(undo).to_have_text("")
    found = server.http.get("/alerts", params={"state": "firing", "kind": "drift"}).json()["items"]
    assert {a["camera_id"] for a in found} == {"c2", "c3", "c4", "c5"}


def test_choosing_moves_no_row_and_what_was_acknowledged_is_not_asked_again(page, fleet, server):
    """The bar pushed the rows down by its height, under a pointer that was about to choose more."""
    expect = pytest.importorskip("playwright.sync_api").expect
    for n in (2, 10, 1):
        fleet.add(f"g{n}", f"Gate {n}", tilt_deg=3.0)
        fleet.knock(f"g{n}")
    page.goto("/")
    page.evaluate("localStorage.setItem('surefoot.by', 'Ada')")
    page.get_by_text("Live").wait_for()
    page.locator("#sort").select_option("name")
    names = page.locator("li.row .who a")
    expect(names).to_have_text(["Gate 1", "Gate 2", "Gate 10"])
    expect(page.locator("#due")).to_have_text("3 need a person")
    top = names.first.bounding_box()["y"]
    page.get_by_label("Choose all that are found").check()
    expect(page.locator("#bulk")).to_be_visible()
    assert names.first.bounding_box()["y"] == top
    page.set_viewport_size({"width": 390, "height": 844})
    shoot(page, "fleet-chosen-phone")
    page.set_viewport_size({"width": 1280, "height": 800})
    page.get_by_role("button", name="Acknowledge").click()
    expect(page.locator("#due")).to_have_text("Nothing needs a person")
    page.get_by_label("Choose all that are found").check()
    expect(page.get_by_role("button", name="They were put back")).to_be_visible()
    expect(page.get_by_role("button", name="Acknowledge")).to_be_hidden()
    shoot(page, "fleet-chosen")
    expect(page.locator("#bulk [data-bulk=undo]")).to_be_hidden()  # nobody has answered
    page.locator("#undo").get_by_role("button", name="Undo").click()
    expect(page.locator("#announce")).to_have_text("Undone: 3 alerts.")
    expect(page.locator("#due")).to_have_text("3 need a person")
    assert all(not a["acknowledged"] for a in server.http.get("/alerts").json()["items"])
    page.get_by_label("Choose Gate 1", exact=True).check()
