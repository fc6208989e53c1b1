"""A series as a small line, with a limit as another."""

from collections.abc import Sequence

from markupsafe import Markup

_WIDTH, _HEIGHT = 96, 26
_LEAST_TOP, _MOST_TOP = 1.5, 4.0  # limits that the height stands for


def trend(history: Sequence[float]) -> Markup:
    """Values of at least 0 relative to their maximum, newest at the right, without a limit."""
    top = max([*history, 1e-9])
    return sparkline([_LEAST_TOP * value / top for value in history], limited=False)


def sparkline(history: Sequence[float | None], places: int = 24, *, limited: bool = True) -> Markup:
    """Values in units of their limit, newest at the right; the dashed line is the limit.

    Hidden from screen readers: the text beside it has the values.
    """
    values = [value for value in history if value is not None]
    top = min(max([_LEAST_TOP, *(1.1 * value for value in values)]), _MOST_TOP)
    limit = _height(1.0, top)
    step = _WIDTH / (places - 1)
    first = places - len(history)
    runs: list[list[str]] = [[]]
    for place, value in enumerate(history, start=first):
        if value is None:
            runs.append([])
        else:
            runs[-1].append(f"{place * step:.0f} {_height(value, top):.1f}")
    line = "".join("M" + "L".join(run) for run in runs if run)
    end = ""
    if history and history[-1] is not None:
        end = f'<circle cx="{_WIDTH}" cy="{_height(history[-1], top):.1f}" r="2.2"/>'
    dashed = f'<path class="limit" d="M0 {limit:.1f}H{_WIDTH}"/>' if limited else ""
    return Markup(
        f'<svg class="spark" viewBox="-2 0 {_WIDTH + 5} {_HEIGHT}" width="{_WIDTH + 5}" '
        f'height="{_HEIGHT}" aria-hidden="true">'
        f'{dashed}<path class="line" d="{line}"/>{end}</svg>'
    )


def _height(value: float, top: float) -> float:
    return _HEIGHT - 3 - min(value, top) / top * (_HEIGHT - 6)
