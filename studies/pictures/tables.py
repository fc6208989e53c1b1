"""Tables of what two pictures tell of a turn."""

import math
from collections.abc import Sequence

import numpy as np

from models.pictures.turn import Turn
from studies.pictures.moves import NO_TURN, TURNS, Light, MoveTrial
from studies.pictures.trials import PairTrial, TurnTrial, moved_by

_INSIDE = 1.645  # sd, of 90 %
_CERTAIN = 0.99  # `DriftLimits.certainty`
_GROUPS = ((0.8, 1.01), (0.5, 0.8), (0.0, 0.5))  # of the old view in sight


def turns_table(trials: Sequence[TurnTrial]) -> str:
    """Errors and coverage of known turns, by how much of the old view is in sight."""
    lines = [
        "| In sight | Trials | Matched | Error, median | 90 % | Largest | In the 90 % interval |",
        "|---|---|---|---|---|---|---|",
    ]
    for low, high in (*_GROUPS, (0.5, 1.01)):
        own = [trial for trial in trials if low <= trial.shared < high]
        errors = np.degrees([trial.error_rad for trial in own if trial.error_rad is not None])
        if not len(errors):
            continue
        off = np.abs(np.concatenate([trial.off_sd for trial in own if trial.off_sd]))
        lines.append(
            f"| {100 * low:.0f} to {100 * min(high, 1):.0f} % | {len(own)} "
            f"| {100 * len(errors) / len(own):.1f} % | {np.median(errors):.3f}° "
            f"| {np.quantile(errors, 0.9):.2f}° | {errors.max():.2f}° "
            f"| {100 * (off < _INSIDE).mean():.1f} % |"
        )
    return "\n".join(lines) + "\n"


def pairs_table(still: Sequence[PairTrial | None], others: Sequence[PairTrial | None]) -> str:
    """False moves among pairs of one pose, and false matches of two scenes."""
    matched = [trial for trial in still if trial is not None]
    false = [trial for trial in matched if trial.moved >= _CERTAIN]
    wrong = [trial for trial in others if trial is not None]
    turns = np.degrees([trial.turn_rad for trial in matched])
    lines = [
        f"Pairs of one pose: {len(still)}, of which {len(matched)} match; {len(false)} false moves "
        f"({_bound(len(false), len(still))}); the largest turn {turns.max(initial=0.0):.2f}°, "
        f"median {np.median(turns):.3f}°.",
        f"Pairs of two scenes: {len(others)}; {len(wrong)} match "
        f"({_bound(len(wrong), len(others))}).",
    ]
    lines += [f"- {' and '.join(each.pair)}: {math.degrees(each.turn_rad):.2f}°" for each in false]
    return "\n".join(lines) + "\n"


def _bound(count: int, of: int) -> str:
    """The upper bound of a rate at 95 %: by the rule of three where there was none."""
    if not count:
        return f"at most {3 / max(of, 1):.1e} of pairs at 95 %"
    return f"{count / of:.1e} of pairs"


def real_table(found: Sequence[tuple[str, str, Turn | None]], focal_px: float) -> str:
    """Turns of a real camera: in degrees, and the shift of its view's middle in pixels."""
    lines = [
        "| Before | After | Right | Down | Clockwise | sd | Middle moves by (px) | Inliers "
        "| `moved` |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for before, after, turn in found:
        if turn is None:
            lines.append(f"| {before} | {after} | no match | | | | | | |")
            continue
        right, down, clockwise = turn.aim
        shift = [-focal_px * math.tan(angle) for angle in (right, down)]
        sds = np.degrees(np.sqrt(np.diag(turn.covariance)[:3]))
        lines.append(
            f"| {before} | {after} | {math.degrees(right):+.2f}° | {math.degrees(down):+.2f}° "
            f"| {math.degrees(clockwise):+.2f}° | {sds.max():.2f}° "
            f"| {shift[0]:+.1f}, {shift[1]:+.1f} | {turn.inliers}{' shifted' * turn.shifted} "
            f"| {moved_by(turn):.4f} |"
        )
    return "\n".join(lines) + "\n"


def moves_table(trials: Sequence[MoveTrial]) -> str:
    """Small turns: how many are reported by one image and by three."""
    lines = [
        "| Light | Turn | Angles | Trials | Inliers | `moved`, one | Alerts, one | `moved`, three "
        "| Alerts, three |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for light in Light:
        for size, angles in (*TURNS, NO_TURN):
            own = [t for t in trials if (t.light, t.size_deg, t.angles) == (light, size, angles)]
            if not own:
                continue
            inliers = np.median([t.inliers for t in own if t.inliers] or [0])
            one, three = (np.array([getattr(t, name) for t in own]) for name in ("one", "three"))
            alarms = [sum(getattr(t, name) for t in own) for name in ("one_alerts", "three_alert")]
            lines.append(
                f"| {light.value} | {size:g}° | {angles or 'none'} | {len(own)} | {inliers:.0f} "
                f"| {np.median(one):.4f} | {alarms[0]} | {np.median(three):.4f} | {alarms[1]} |"
            )
    return "\n".join(lines) + "\n"


def cost_line(described_s: float, compared_s: float, stored_bytes: int) -> str:
    """The CPU time of a picture's features and of a comparison, and the bytes of what is kept."""
    return (
        f"1280 x 720, one core: features {described_s:.3f} CPU-s, a comparison {compared_s:.3f} "
        f"CPU-s; {stored_bytes / 1024:.0f} KiB stored.\n"
    )
