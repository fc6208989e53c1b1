"""The drift in words: what is told, how sure it is, and what it is held against."""

import math

from models.drift.verdict import Drift, DriftLimits, DriftVerdict


def describe_drift(drift: Drift, verdict: DriftVerdict, limits: DriftLimits) -> str:
    """The told numbers against the prior pose and the limits; empty where none is told."""
    said = {
        "tilt": f"tilt {_degrees(drift.tilt_rad, drift.tilt_sd_rad)}",
        "roll": f"roll {_degrees(drift.roll_rad, drift.roll_sd_rad)}",
        "height": f"height {drift.height_m:+.2f} m (sd {drift.height_sd_m:.2f})",
    }
    limit = (
        f"{limits.sigmas:g} sd and {math.degrees(limits.floor_rad):g} deg or {limits.floor_m:g} m"
    )
    if not drift.told:
        return f"beyond {limit} when it was last told" if verdict.drifting else ""
    text = ", ".join(said[name] for name in drift.told) + " against the prior pose"
    if verdict.drifting and verdict.excess >= 1:
        updates = "1 update" if limits.updates == 1 else f"{limits.updates} updates"
        return f"{text}: beyond {limit} for {updates} or more"
    if verdict.drifting:
        below = max(-verdict.streak, 0)
        return f"{text}: was beyond {limit}, {below} of {limits.updates} updates below"
    if verdict.streak > 0:
        return f"{text}: beyond {limit}, {verdict.streak} of {limits.updates} updates"
    return f"{text}: not beyond {limit}"


def _degrees(angle_rad: float, sd_rad: float) -> str:
    return f"{math.degrees(angle_rad):+.2f} deg (sd {math.degrees(sd_rad):.2f})"
