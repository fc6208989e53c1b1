"""Post tracks to surefoot from where a detector runs: one file, the standard library alone.

    from client import Client

    with Client("http://surefoot:8080", "town-centre", token="sf_...", size=(1280, 720)) as client:
        for frame in frames:
            for track_id, box in tracked(frame):  # x1, y1, x2, y2 in pixels of that size
                client.add(track_id, box)

A track ends when nothing was seen of it for `silence_s`. Finished tracks lie in files of `spool`
until the service has stored them: that outlives a restart and a service that is away, and posting
twice changes nothing there. Where the files are larger than `spool_mb`, the oldest are lost, and
counted. What is under way when the process dies is lost.
"""

from __future__ import annotations

import contextlib
import http.client
import json
import logging
import math
import os
import random
import re
import tempfile
import threading
import time
import urllib.error
import urllib.parse
import urllib.request
from collections import Counter
from email.message import Message
from email.utils import parsedate_to_datetime
from pathlib import Path
from types import TracebackType
from typing import Any, Sequence  # noqa: UP035

log = logging.getLogger("surefoot.client")

_MAX_POINTS, _MAX_SPAN_S = 10_000, 3_600.0  # of a track, as the service takes them
_FILE_POINTS = 20_000  # of the tracks of one post: a megabyte
_TICK_S = 0.5
_SHORTEST_WAIT_S, _LONGEST_WAIT_S = 1.0, 60.0
_CLOCK_S = 5.0  # that clocks may differ by without a word; a second of it is the header's own
# Nothing is wrong with the tracks: they are posted again, once somebody has mended it.
_NAME = re.compile(r"[0-9]{1,18}-[0-9]{1,9}\.json")  # number and tracks of a file
_FIXABLE = frozenset((401, 403, 404, 408, 409, 421, 425, 429))


class _NoRedirect(urllib.request.HTTPRedirectHandler):
    """Follows no redirect, which would take the token along to another host."""

    def redirect_request(self, *_: Any) -> None:
        """Nothing: the answer is then an error."""


_opener = urllib.request.build_opener(_NoRedirect)


class Client:
    """Takes detections of one camera in, and posts whole tracks; may be used by several threads.

    `posted` counts tracks: `accepted`, `duplicates`, `skipped`, `refused`, `lost`. Skipped ones are
    no people, by their class; `skipped` counts them by the service's reasons.
    `clock_ahead_s` is by how much this machine's clock is ahead of the service's, to a second or
    so; None until it has answered.
    """

    def __init__(
        self,
        url: str,
        camera_id: str,
        *,
        token: str | None = None,
        source: str = "tracker",
        size: tuple[int, int] | None = None,
        normalised: bool = False,
        camera_size: tuple[int, int] | None = None,
        silence_s: float = 2.0,
        spool: str | os.PathLike[str] | None = None,
        spool_mb: float = 64.0,
        timeout_s: float = 30.0,
    ) -> None:
        """Begin to post what an earlier process has left in the spool.

        Args:
            url: of the service.
            camera_id: as it was registered.
            token: of the scope ingest; None where access is off.
            source: the tracker's name: the first that posts is the one that counts.
            size: (width, height) of the picture that boxes are of; None: the camera's own.
            normalised: boxes are shares of the picture, 0 to 1.
            camera_size: (width, height) that the camera was registered with: boxes are scaled to
                it here. None: the service does.
            silence_s: a track ends when nothing was seen of it for so long.
            spool: a folder for this camera alone; None: a new one, which no restart finds again.
            spool_mb: the largest that its files may be together.
            timeout_s: of a request.

        Raises:
            ValueError: the URL is none.
            OSError: the spool cannot be made.
        """
        self.posted: Counter[str] = Counter()
        self.skipped: Counter[str] = Counter()
        self.clock_ahead_s: float | None = None
        if not url.startswith(("http://", "https://")):
            raise ValueError(f"url: http:// or https:// is needed, got {url!r}")
        self._url = f"{url.rstrip('/')}/cameras/{urllib.parse.quote(camera_id, safe='')}/tracks"
        self._headers = {"Content-Type": "application/json", "Accept": "application/json"}
        if token:
            self._headers["Authorization"] = f"Bearer {token}"
        self._body: dict[str, Any] = {"source": source}
        self._factor, self._shift = (1.0, 1.0), (0.0, 0.0)
        if camera_size and (size or normalised):
            self._scale(camera_size, None if normalised else size)
        elif normalised:
            self._body["normalised"] = True
        elif size:
            self._body["size"] = list(size)
        self._silence_s = silence_s
        self._timeout_s = timeout_s
        self._temporary = spool is None
        self._spool = Path(spool or tempfile.mkdtemp(prefix="surefoot-"))
        self._spool.mkdir(parents=True, exist_ok=True)
        self._spool_bytes = int(spool_mb * 1e6)
        self._unreadable: set[Path] = set()
        self._number = max((_number_of(path) for path in self._files()), default=0)
        self._open: dict[str, list[list[float]]] = {}  # rows of time and box
        self._labels: dict[str, Counter[str | None]] = {}
        self._heard_s: dict[str, float] = {}
        self._done: list[dict[str, Any]] = []
        self._lock = threading.Lock()
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="surefoot-client", daemon=True)
        self._thread.start()

    def __enter__(self) -> Client:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()

    def add(
        self,
        track_id: object,
        box: Sequence[float],
        time_s: float | None = None,
        label: str | float | None = None,
    ) -> None:
        """Add one detection.

        A second one at the same time is ignored, and one with numbers that are not finite.

        Args:
            track_id: the tracker's.
            box: x1, y1, x2, y2.
            time_s: when the image was taken, in seconds since 1970; None: now.
            label: class of the detection, a name or a COCO number. A track has the class of most
                of its detections; the service skips those that are no people.
        """
        at_s = time.time() if time_s is None else float(time_s)
        (x1, y1, x2, y2), (u, v), (du, dv) = map(float, box), self._factor, self._shift
        row = [at_s, u * x1 + du, v * y1 + dv, u * x2 + du, v * y2 + dv]
        if not all(map(math.isfinite, row)):
            return
        name = str(track_id)
        with self._lock:
            rows = self._open.get(name)
            if rows and at_s <= rows[-1][0]:
                return
            full = rows and (len(rows) >= _MAX_POINTS or at_s - rows[0][0] > _MAX_SPAN_S)
            if rows and (full or at_s - rows[-1][0] > self._silence_s):
                self._finish(name)
            self._open.setdefault(name, []).append(row)
            kind = None if label is None else str(label)
            self._labels.setdefault(name, Counter())[kind] += 1
            self._heard_s[name] = time.monotonic()

    def end(self, track_id: object) -> None:
        """End a track that the tracker says is over."""
        with self._lock:
            self._finish(str(track_id))

    def close(self, wait_s: float = 10.0) -> None:
        """End all tracks, and post for so long; what is left stays in the spool."""
        with self._lock:
            for name in list(self._open):
                self._finish(name)
        self._stop.set()
        self._thread.join(wait_s)
        if self._temporary and not self.waiting:
            with contextlib.suppress(OSError):  # closed before, or still at work
                self._spool.rmdir()

    @property
    def waiting(self) -> int:
        """How many files of tracks wait to be posted."""
        return len(self._files())

    def _scale(self, camera: tuple[int, int], size: tuple[int, int] | None) -> None:
        """Scale to the camera's picture, whose pixels count from the centre of the first."""
        wide, tall = size or (1, 1)
        self._factor = u, v = camera[0] / wide, camera[1] / tall
        self._shift = (-0.5, -0.5) if size is None else ((u - 1) / 2, (v - 1) / 2)

    def _finish(self, name: str) -> None:
        rows = self._open.pop(name, None)
        self._heard_s.pop(name, None)
        labels = self._labels.pop(name, Counter())
        if rows:
            track: dict[str, Any] = {"id": name, "boxes": rows}
            label = labels.most_common(1)[0][0]
            if label is not None:
                track["class"] = label
            self._done.append(track)

    def _run(self) -> None:
        """Keep what is finished, and post what is kept, until the client is closed."""
        again_s, wait_s = 0.0, _SHORTEST_WAIT_S
        while True:
            stopping = self._stop.wait(_TICK_S)
            try:
                self._keep_finished()
                while time.monotonic() >= again_s and (files := self._files()):
                    asked_s = self._post(files[0])
                    if asked_s is None:
                        wait_s = _SHORTEST_WAIT_S
                        continue
                    # Many that were held up do not come back at once.
                    again_s = time.monotonic() + max(asked_s, wait_s * random.uniform(0.5, 1.0))
                    wait_s = min(2 * wait_s, _LONGEST_WAIT_S)
            except Exception:  # without this thread, tracks would be taken and never posted
                log.exception("the spool %s cannot be worked on; it is tried again", self._spool)
                again_s = time.monotonic() + _LONGEST_WAIT_S
            if stopping:
                return

    def _keep_finished(self) -> None:
        now_s = time.monotonic()
        with self._lock:
            for name in [n for n, at in self._heard_s.items() if now_s - at > self._silence_s]:
                self._finish(name)
            done, self._done = self._done, []
        while done:
            some: list[dict[str, Any]] = []
            points = 0
            while done and (not some or points + len(done[-1]["boxes"]) <= _FILE_POINTS):
                some.append(done.pop())
                points += len(some[-1]["boxes"])
            self._keep(some)

    def _keep(self, tracks: list[dict[str, Any]]) -> None:
        """Write tracks to a file of the spool, whole or not at all; the oldest give way."""
        content = json.dumps({**self._body, "tracks": tracks}, separators=(",", ":")).encode()
        self._number += 1
        path = self._spool / f"{self._number:012}-{len(tracks)}.json"
        try:
            self._spool.mkdir(parents=True, exist_ok=True)  # it may have been cleaned away
            with open(path.with_suffix(".part"), "wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            path.with_suffix(".part").replace(path)
            files = self._files()
            size = sum(each.stat().st_size for each in files)
            for oldest in files[:-1]:
                if size <= self._spool_bytes:
                    break
                size -= oldest.stat().st_size
                self._lose(oldest, "the spool is full")
        except OSError as error:
            self.posted["lost"] += len(tracks)
            log.error("%d tracks are lost: %s", len(tracks), error)

    def _files(self) -> list[Path]:
        with contextlib.suppress(OSError):
            found = [path for path in self._spool.iterdir() if _NAME.fullmatch(path.name)]
            return sorted(path for path in found if path not in self._unreadable)
        return []

    def _lose(self, path: Path, why: str) -> None:
        tracks = _tracks_of(path)
        self.posted["lost"] += tracks
        log.error("%d tracks are lost: %s", tracks, why)
        path.unlink(missing_ok=True)

    def _post(self, path: Path) -> float | None:
        """Post a file; None where it is done with, else how long at least to wait, in seconds."""
        try:
            content = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:  # the others do not wait for it
            self._unreadable.add(path)
            self.posted["lost"] += _tracks_of(path)
            log.error("%d tracks are lost: %s", _tracks_of(path), error)
            return None
        try:
            status, headers, body = self._ask(content)
            self._see_clock(headers.get("Date"))
            if status == 202:
                self._count(json.loads(body))
        except (OSError, http.client.HTTPException, ValueError, TypeError, KeyError) as error:
            log.warning("%s: %r; it is tried again", self._url, error)
            return 0.0
        if status != 202:
            said = body.decode("utf-8", "replace")
            if status < 400 or status >= 500 or status in _FIXABLE:
                log.warning("%s: %d %s; it is tried again", self._url, status, said)
                asked = headers.get("Retry-After") or ""
                return min(float(asked), _LONGEST_WAIT_S) if asked.isdigit() else 0.0
            self.posted["refused"] += _tracks_of(path)
            log.error("%s: %d %s", self._url, status, said)
        path.unlink(missing_ok=True)
        return None

    def _ask(self, content: bytes) -> tuple[int, Message, bytes]:
        """The status, the headers and the body of the answer to a post."""
        request = urllib.request.Request(self._url, content, self._headers, method="POST")
        try:
            with _opener.open(request, timeout=self._timeout_s) as answer:
                return answer.status, answer.headers, answer.read()
        except urllib.error.HTTPError as error:
            with error:
                return error.code, error.headers, error.read(2_000)

    def _count(self, receipt: dict[str, Any]) -> None:
        accepted, duplicates = int(receipt["accepted"]), int(receipt["duplicates"])
        for each in receipt["rejected"]:
            log.warning("track %s is refused: %s: %s", each["id"], each["code"], each["detail"])
        skipped: dict[str, int] = receipt.get("skipped", {})
        for reason in skipped.keys() - self.skipped.keys():
            log.warning("tracks are skipped: %s", reason)
        self.skipped.update(skipped)
        self.posted.update(
            accepted=accepted, duplicates=duplicates, refused=len(receipt["rejected"])
        )
        if skipped:
            self.posted["skipped"] += sum(skipped.values())

    def _see_clock(self, date: str | None) -> None:
        if date is None:
            return
        try:
            ahead_s = time.time() - parsedate_to_datetime(date).timestamp()
        except ValueError:
            return
        if abs(ahead_s) > _CLOCK_S and self.clock_ahead_s is None:
            log.warning("this clock is %.0f s ahead of the service's: set both by NTP", ahead_s)
        self.clock_ahead_s = ahead_s


def _number_of(path: Path) -> int:
    return int(path.name.partition("-")[0])


def _tracks_of(path: Path) -> int:
    return int(path.stem.partition("-")[2])
