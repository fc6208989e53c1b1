"""Fuzzing of cost: `python -m tests.cost` draws bodies and windows, and prints the worst of each.

Exits with 1 where one is beyond its budget, of its size or of a look; Ctrl-C (or SIGINT, from
behind `nohup` too) goes on to what comes next, with what it has.
"""

import argparse
import contextlib
import signal
import sys
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings, target

from tests.cost.bodies import MB, BodyCost, Drawn, bodies, read_cost, words_of
from tests.cost.drawn import Crowd, windows
from tests.cost.looks import LOOK_CPU_S, LOOK_MB, Cost, looker

_WORST = 10

Drawing = Callable[[Callable[..., None]], Callable[..., None]]


def main() -> int:
    """Draw bodies, then windows; print the worst."""
    parser = argparse.ArgumentParser(prog="python -m tests.cost", description=__doc__)
    parser.add_argument("--bodies", type=int, default=20_000)
    parser.add_argument("--body-mb", type=float, default=32.0, help="MiB of the largest body")
    parser.add_argument("--windows", type=int, default=2_000)
    parser.add_argument("--points", type=int, default=400_000, help="most points of a crowd")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--plain", action="store_true", help="do not look for the costliest")
    asked = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
    phases = (Phase.generate,) if asked.plain else (Phase.generate, Phase.target)
    beyond = 0
    if asked.bodies:
        beyond += _bodies(asked.body_mb, _drawing(asked.bodies, asked.seed, phases))
    if asked.windows:
        beyond += _windows(asked.points, _drawing(asked.windows, asked.seed, phases))
    return 1 if beyond else 0


def _drawing(examples: int, number: int, phases: tuple[Phase, ...]) -> Drawing:
    """The way in which a function's arguments are drawn: half of them towards the costliest."""

    def drawing(test: Callable[..., None]) -> Callable[..., None]:
        how = settings(
            max_examples=examples,
            deadline=None,
            database=None,
            phases=phases,
            suppress_health_check=list(HealthCheck),
        )
        return seed(number)(how(test))

    return drawing


def _bodies(most_mb: float, drawing: Drawing) -> int:
    """How many bodies are beyond what they are worth."""
    costs: list[BodyCost] = []

    @drawing
    @given(bodies(int(most_mb * MB)))
    def read(drawn: Drawn) -> None:
        cost = read_cost(drawn)
        if cost.too_slow and not cost.too_large:  # as a window below
            cost = min(cost, read_cost(drawn), key=lambda each: (not each.too_large, each.cpu_s))
        costs.append(cost)
        target(cost.peak_mb / (cost.mb + 4), label="MB a MiB")
        target(cost.cpu_s / (cost.mb + 4), label="CPU seconds a MiB")
        if len(costs) % 1_000 == 0:
            _say(f"{len(costs)} bodies")

    with contextlib.suppress(KeyboardInterrupt):
        read()
    for title, key in (
        ("CPU seconds", lambda cost: cost.cpu_s),
        ("memory", lambda cost: cost.peak_mb),
        ("CPU a MiB", lambda cost: cost.cpu_s / (cost.mb + 4)),
        ("memory a MiB", lambda cost: cost.peak_mb / (cost.mb + 4)),
    ):
        _say(f"\nThe worst bodies by {title}:")
        for cost in sorted(costs, key=key, reverse=True)[:_WORST]:
            _say(words_of(cost))
    beyond = [cost for cost in costs if cost.too_large or cost.too_slow]
    _say(f"\n{len(costs)} bodies, {len(beyond)} beyond their budget")
    for cost in beyond[:_WORST]:
        _say(words_of(cost))
    return len(beyond)


def _windows(points: int, drawing: Drawing) -> int:
    """How many windows are beyond the budget of a look."""
    costs: list[Cost] = []
    with tempfile.TemporaryDirectory() as folder, looker(Path(folder) / "data") as found:

        @drawing
        @given(windows(points))
        def look(window: tuple[list[Crowd], bool]) -> None:
            drawn, checked = window
            cost = found.look(drawn, checked=checked)
            if cost.cpu_s >= LOOK_CPU_S:  # up to twice its seconds where others share the core
                again = found.look(drawn, checked=checked)
                cost = replace(again if again.error else cost, cpu_s=min(cost.cpu_s, again.cpu_s))
            costs.append(cost)
            target(cost.peak_mb, label="MB")
            target(cost.cpu_s, label="CPU seconds")
            if _is_beyond(cost):
                _say(f"beyond: {_words(cost)}")
            if len(costs) % 50 == 0:
                _say(f"{len(costs)} windows, {_most(costs)}")

        with contextlib.suppress(KeyboardInterrupt):
            look()
    for title, key in (("CPU seconds", _cpu), ("memory", _memory), ("CPU a point", _cpu_a_point)):
        _say(f"\nThe worst by {title}:")
        for cost in sorted(costs, key=key, reverse=True)[:_WORST]:
            _say(_words(cost))
    beyond = [cost for cost in costs if _is_beyond(cost)]
    _say(f"\n{len(costs)} windows, {_most(costs)}; {len(beyond)} beyond their budget")
    for cost in beyond[:_WORST]:
        _say(_words(cost))
    return len(beyond)


def _is_beyond(cost: Cost) -> bool:
    return cost.error is not None or cost.peak_mb >= LOOK_MB or cost.cpu_s >= LOOK_CPU_S


def _cpu(cost: Cost) -> float:
    return cost.cpu_s


def _memory(cost: Cost) -> float:
    return cost.peak_mb


def _cpu_a_point(cost: Cost) -> float:
    return cost.cpu_s / max(cost.points, 1_000)


def _most(costs: list[Cost]) -> str:
    keys: list[Callable[[Cost], float]] = [_cpu, _memory]
    cpu_s, peak_mb = (max(map(key, costs)) for key in keys)
    return f"at most {cpu_s:.1f} CPU-s and {peak_mb:.0f} MB"


def _words(cost: Cost) -> str:
    crowds = "; ".join(
        f"{each.tracks} of {each.points} points over {each.seconds:.4g} s, {each.rhythm}, "
        f"{each.gaps} gaps of {each.gap_s:g} s, within {each.spread_s:g} s, {each.scatter_px:g} px "
        f"apart, {each.pace_px:g} px/s, jumps of {each.jump_px:g} px, {each.form}"
        for each in cost.crowds
    )
    ended = "" if cost.error is None else f", {cost.error}"
    return (
        f"{cost.cpu_s:6.2f} CPU-s {cost.peak_mb:5.0f} MB, {cost.tracks} tracks of {cost.points} "
        f"points, {cost.skipped} skipped{ended}: {crowds}"
    )


def _say(text: str) -> None:
    sys.stdout.write(text + "\n")
    sys.stdout.flush()


if __name__ == "__main__":
    sys.exit(main())
