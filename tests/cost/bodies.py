"""Bodies of tracks as no tracker writes them, and the CPU and memory that reading each takes."""

import json
import os
import resource
import time
from dataclasses import asdict, dataclass
from pathlib import Path

from hypothesis import strategies as st

from service.errors import ServiceError
from service.formats.batch import read_json, read_ndjson
from service.formats.track import Clock, Limits
from service.formats.track_text import read_text
from service.workers.processes.process import settle_allocator

MB = 2**20
# Of a body: what a small one may cost, and what each byte may.
BASE_MB, MB_A_MB = 64.0, 8.0
BASE_CPU_S, CPU_S_A_MB = 2.0, 0.1
_MOST_MB, _MOST_CPU_S = 2_000, 30  # a process that takes more is ended
ENDED = "ended"
_CLOCK = Clock(frame_rate_hz=25.0, started_at_s=1.7e9)
_LIMITS = Limits(width=1280, height=720, now_s=1.8e9, max_ahead_s=60.0)

_ROWS = ("[1,1,1],", "[],", "[1,1],", '[1,"x",1],', "[NaN,1,1],", "[1e400,1,1],", "1,", "{},")
_JSON = (
    *_ROWS, "[", "]", "{", "}", '"', ",", ":", "\\", "\\n", "\\ud800", "a", "é", "\U0001f600", "0",
    "1" * 400, "1e", "-", "NaN,", "Infinity,", "null,", "true,", " ", "\t", "\n", '"a":1,', '"":{',
    '"id":"1",', '"points":[', '"boxes":[[1,1,1,2,2]],', '"class":[', '"tracks":[', '{"id":1},',
)  # fmt: skip
_WRAPS = (
    ("", ""), ('{"tracks":[', "1]}"), ('{"source":"', '"}'), ('{"', '":1}'), ("{", '"tracks":[]}'),
    ('{"tracks":[{"id":"1","points":[', "[1,1,1]]}]}"), ('{"tracks":[{"id":"', '"}]}'),
    ('{"tracks":[{"points":[[', "1]]}]}"), ('{"started_at":', "1}"), ('[{"a":', "1}]"),
)  # fmt: skip
_ITEMS = (
    ("", ""), ('{"id":"1","points":[', "[1,1,1]]},"), ('{"a":[', "1]},"), ('"', '",'), ("[", "1],"),
    ("{", '"a":1},'), ('{"class":"car","points":[', "1]},"), ('{"id":', "1},"),
)  # fmt: skip
_CSV = (
    "1", ",", "x", "\r", "\n", "\r\n", "\x0b", "\x85", "\u2028", "1e400", "nan", "-1", " ", '"',
    "1,1,1,1,9,9,1\n", "2,1,1,1,9,9,1,0,1\n", "1,a,1,1\n", "0" * 500, "frame", "1,1,1,1,9,9,0\n",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A body of so many bytes: `(head + inner * times + tail)` again and again in its wrap."""

    kind: str
    before: str
    head: str
    inner: str
    times: int
    tail: str
    after: str
    size: int

    def body(self) -> bytes:
        """Its bytes."""
        head, inner, tail, before, after = (
            part.encode("utf-8", "surrogatepass")
            for part in (self.head, self.inner, self.tail, self.before, self.after)
        )
        times = min(self.times, self.size // max(len(inner), 1))
        item = head + inner * times + tail
        return before + item * (self.size // max(len(item), 1)) + after


@dataclass(frozen=True, slots=True, kw_only=True)
class BodyCost:
    """The cost of reading a body of so many MiB: CPU seconds, and memory beside the body itself."""

    drawn: Drawn
    mb: float
    cpu_s: float
    peak_mb: float
    said: str

    @property
    def too_large(self) -> bool:
        """True of one that takes more memory than its size is worth, or was ended over it."""
        return self.peak_mb > BASE_MB + MB_A_MB * self.mb or self.said == ENDED

    @property
    def too_slow(self) -> bool:
        """True of one that takes more CPU than its size is worth."""
        return self.cpu_s > BASE_CPU_S + CPU_S_A_MB * self.mb


def bodies(most_bytes: int) -> st.SearchStrategy[Drawn]:
    """Bodies of up to so many bytes and a little more."""

    def made(kind: str, parts: tuple[str, ...], wraps, items) -> st.SearchStrategy[Drawn]:  # type: ignore[no-untyped-def]
        text = st.lists(st.sampled_from(parts), min_size=1, max_size=4).map("".join)
        wrap, item = st.sampled_from(wraps), st.sampled_from(items)
        size = st.floats(0, 1).map(lambda share: int(64 * (most_bytes / 64) ** share))
        times = st.sampled_from((1, 3, 100, 9_999, 200_000, 2**25))
        return st.builds(
            lambda wrap, item, inner, times, size: Drawn(
                kind=kind, before=wrap[0], head=item[0], inner=inner, times=times, tail=item[1],
                after=wrap[1], size=size,
            ),
            wrap, item, text, times, size,
        )  # fmt: skip

    lines = tuple((head, f"{tail}\n") for head, tail in _ITEMS)
    return (
        made("json", _JSON, _WRAPS, _ITEMS)
        | made("ndjson", _JSON, (("", ""),), (("", ""), *lines))
        | made(
            "csv", _CSV, (("", ""), ("1,", "\n")), (("", ""), ("1,", "\n"), ("1,1,1,1,9,9,", "\n"))
        )
    )


def read_cost(drawn: Drawn) -> BodyCost:
    """The cost of one, in a process of its own, which is ended where it takes far too much."""
    reading, writing = os.pipe()
    child = os.fork()
    if not child:
        status = 1
        try:
            os.close(reading)
            os.write(writing, json.dumps(_measured(drawn)).encode())
            status = 0
        finally:
            os._exit(status)
    os.close(writing)
    with os.fdopen(reading, "rb") as answer:
        told = answer.read()
    os.waitpid(child, 0)
    found = {"cpu_s": _MOST_CPU_S, "peak_mb": _MOST_MB, "said": ENDED} | json.loads(told or "{}")
    return BodyCost(drawn=drawn, mb=drawn.size / MB, **found)


def _measured(drawn: Drawn) -> dict[str, float | str]:
    body = drawn.body()
    settle_allocator()
    Path("/proc/self/clear_refs").write_text("5")  # the peak begins anew
    before_mb = _memory_mb("VmRSS")
    limit = int(_memory_mb("VmSize") + _MOST_MB) * MB
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    resource.setrlimit(resource.RLIMIT_CPU, (_MOST_CPU_S, _MOST_CPU_S))
    begun_s = time.process_time()
    said = _read(drawn.kind, body)
    return {
        "cpu_s": time.process_time() - begun_s,
        "peak_mb": _memory_mb("VmHWM") - before_mb,
        "said": said,
    }


def _read(kind: str, body: bytes) -> str:
    try:
        match kind:
            case "json":
                batch = read_json(body, _CLOCK, _LIMITS)
            case "ndjson":
                batch = read_ndjson(body, "drawn", _CLOCK, _LIMITS)
            case _:
                batch = read_text(body, "drawn", _CLOCK, _LIMITS)
    except ServiceError as error:
        return error.code
    return f"{len(batch.tracks)} taken, {len(batch.rejections)} rejected"


def _memory_mb(what: str) -> float:
    status = Path("/proc/self/status").read_text()
    return int(status.partition(f"{what}:")[2].split()[0]) / 1024


def words_of(cost: BodyCost) -> str:
    """One line about a body."""
    drawn = {name: f"{value!r:.60}" for name, value in asdict(cost.drawn).items()}
    took = f"{cost.cpu_s:6.2f} CPU-s {cost.peak_mb:5.0f} MB of {cost.mb:5.2f} MiB"
    return f"{took}, {cost.said}: {drawn}"
