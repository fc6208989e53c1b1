"""The fleet page with 500 cameras: until it is usable, and until an alert shows on it.

    python -m tests.benchmarks.fleet [--cameras 500] [--chromium /usr/bin/chromium]

Needs the extra `test` and a chromium.
"""

import argparse
import shutil
import statistics
import sys
import tempfile
import time
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

from playwright.sync_api import Page, sync_playwright
from sqlalchemy import select

from models.monitoring.arrivals import CELLS, ArrivalProcess
from service.cameras.status import camera_statuses
from service.commands.migrate import migrate
from service.enums import PoseState
from service.settings import Settings
from service.store.cameras import CameraRecord, RhythmRecord
from tests.benchmarks.parts.cloned import clone
from tests.running import RunningService, free_port
from tests.service.fleet_bench import Fleet, afternoon

_TIMES = 7
_SEEDED = 500  # the others are copies of those that stand still
_MARKS = """() => ({
  paint: performance.getEntriesByName('first-contentful-paint')[0].startTime,
  usable: performance.getEntriesByName('usable')[0].startTime,
  answer: performance.getEntriesByType('navigation')[0].responseEnd,
  bytes: performance.getEntriesByType('navigation')[0].encodedBodySize,
})"""


def say(words: str) -> None:
    sys.stdout.write(words + "\n")


def loads(page: Page) -> None:
    """Until the page answers, shows rows, and can be searched."""
    seen = []
    for _ in range(_TIMES):
        page.goto("/")
        page.locator("li.row").first.wait_for()
        # The first paint may be noted after the marks.
        page.wait_for_timeout(300)
        seen.append(page.evaluate(_MARKS))
    for name in ("answer", "paint", "usable"):
        values = [one[name] for one in seen]
        say(f"{name:8} median {statistics.median(values):5.0f} ms, worst {max(values):5.0f} ms")
    say(f"{seen[0]['bytes'] / 1024:.0f} KiB, {page.locator('li.row').count()} rows")
    page.evaluate("performance.mark('typed')")
    page.locator("#search").fill("quay")
    took = page.evaluate("performance.now() - performance.getEntriesByName('typed')[0].startTime")
    say(f"a search {took:.0f} ms")


def alerts(page: Page, fleet: Fleet) -> None:
    """From the commit of an alert until its row says so."""
    page.goto("/?state=ok&state=drifting")
    page.get_by_text("Live").wait_for()
    delays = []
    steady = page.locator("li.row.ok:not(:has(.flag))").evaluate_all(
        "rows => rows.map(row => row.dataset.id)"
    )
    for camera_id in steady[:: len(steady) // _TIMES][:_TIMES]:
        fleet.knock(camera_id)
        at = time.monotonic()
        page.locator(f"#row-{camera_id}.drifting").wait_for()
        delays.append(time.monotonic() - at)
    say(f"an alert shows after {statistics.median(delays):.2f} s, at the worst {max(delays):.2f} s")


def _know_hours(fleet: Fleet) -> None:
    """Every camera knows when people come, as after a week: a page asks that for each."""
    now = datetime.now(UTC)
    counts = {"tracks": {str(480_000 + hour): 20 for hour in range(28 * 24)}, "latest_s": {}}
    rates = [20 / (3 + hour) for hour in range(CELLS)]
    process = ArrivalProcess(rates=tuple(rates), burst=1.5, shape=4.0, usual_gap_s=3_600.0, days=14)
    profile = asdict(process)
    times = {"usual_gap_s": profile.pop("usual_gap_s"), "delay_s": 5.0}
    with fleet.store.write() as session:
        for camera_id in session.scalars(select(CameraRecord.id)).all():
            known = {"profile": profile, "counts": counts, "learned_at": now}
            session.add(RhythmRecord(camera_id=camera_id, **known, **times))


def _steady(fleet: Fleet) -> list[str]:
    with fleet.store.read() as session:
        statuses = camera_statuses(session, fleet.settings)
    return [
        i for i, each in statuses.items() if each.state == PoseState.OK and not each.attended.spans
    ]


def main() -> None:
    """Seed, serve, look."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cameras", type=int, default=500)
    parser.add_argument("--chromium", default=shutil.which("chromium"))
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        settings = Settings(data_dir=Path(folder) / "data", workers=0, port=free_port())
        migrate(settings)
        fleet = Fleet(settings)
        afternoon(fleet, min(given.cameras, _SEEDED))
        _know_hours(fleet)
        if given.cameras > _SEEDED:
            copies = [f"copy-{n}" for n in range(given.cameras - _SEEDED)]
            clone(settings.database_path, _steady(fleet), copies)
        server = RunningService(settings, forked=False)
        server.start()
        try:
            with sync_playwright() as playwright:
                browser = playwright.chromium.launch(
                    executable_path=given.chromium, args=["--no-sandbox"]
                )
                page = browser.new_page(base_url=server.url)
                loads(page)
                alerts(page, fleet)
                browser.close()
        finally:
            server.stop()
            fleet.close()


if __name__ == "__main__":
    main()
