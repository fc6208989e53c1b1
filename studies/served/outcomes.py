"""Outcomes of what was served of a case beside the truth: each parameter, and how surely."""

import math
import time
from dataclasses import dataclass

import numpy as np

from models.assessment import AssessmentLimits, tracks_a_year
from models.errors import CalibrationError
from models.geometry.pose import PARAMETERS, CameraPose, array_of
from models.pose import CameraSite, PoseFinding
from studies.protocol.cases import ProtocolCase, angle_deg
from studies.served.windows import Window, assessed_windows


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterOutcome:
    """One parameter of a pose: degrees, or the log of the height.

    `moved` is how far it truly is from the prior pose, `error` how far off the truth the estimate
    was, `sd` what it gave as its standard deviation, and `covered` says whether its 90 % interval
    held the truth. Only `identifiable` ones are served.
    """

    moved: float
    error: float
    sd: float
    identifiable: bool
    covered: bool

    @property
    def off_sd(self) -> float:
        """The error in standard deviations."""
        return abs(self.error) / max(self.sd, 1e-12)


@dataclass(frozen=True, slots=True, kw_only=True)
class ServedOutcome:
    """A case as it was served at its end: what is not identifiable as the prior has it.

    `parameters` are tilt, roll, height, heading; none where nothing could be learned or estimated,
    and `failure` says why. `rotation_deg` is the whole rotation between the served and the true
    pose, `height_error` a share of the height. `cuts` windows were cut at a change, where there
    was none. `mapped` says whether the flow map had a part, `reason` what was said of it. `state`
    is by the last look alone, without a chart, `moved` the probability that it moved, and `cause`
    the code of what a drift would be told as instead.
    """

    reference_tracks: int
    seen_tracks: int
    used_tracks: int
    parameters: tuple[ParameterOutcome, ...]
    rotation_deg: float
    height_error: float
    cuts: int
    mapped: bool
    reason: str
    seconds: float
    failure: str = ""
    state: str = ""
    moved: float | None = None
    cause: str = ""


def serve_case(case: ProtocolCase, site: CameraSite | None, window: Window) -> ServedOutcome:
    """Served outcome of a case after its last batch; a site of None is not known."""
    started = time.monotonic()
    failure = "" if site is not None else "the reference tells nothing"
    last, cuts = None, 0
    try:
        if site is not None:
            limits = AssessmentLimits(tracks_a_year=tracks_a_year(case.seen))
            for each in assessed_windows(case.seen, site, window, limits):
                last, cuts = each.assessment, cuts + (each.cut is not None)
            failure = "" if last is not None else "too few people walk"
    except CalibrationError as error:
        failure = f"{type(error).__name__}: {error}"
    if last is None or failure:
        return _unserved(case, failure, time.monotonic() - started)
    found, decision = last.estimated, last.decision
    served, cause = found.pose, decision.cause
    return ServedOutcome(
        reference_tracks=len(case.reference),
        seen_tracks=len(case.seen),
        used_tracks=found.joint.walkers,
        parameters=parameters_beside(found, case.prior_pose, case.true_pose),
        rotation_deg=angle_deg(served, case.true_pose),
        height_error=abs(served.height_m / case.true_pose.height_m - 1),
        cuts=cuts,
        mapped=found.fused.registered,
        reason=reason_of(found),
        seconds=time.monotonic() - started,
        state=decision.state,
        moved=found.posterior.moved,
        cause="" if cause is None or not decision.verdict.drifting else str(cause.code),
    )


def parameters_beside(
    found: PoseFinding, prior: CameraPose, truth: CameraPose
) -> tuple[ParameterOutcome, ...]:
    """Each parameter of a finding beside the truth."""
    posterior = found.posterior
    before = array_of(prior)
    values, sds = before + posterior.offset, np.sqrt(np.diag(posterior.covariance))
    identifiable = found.drift.identifiable
    columns = zip(PARAMETERS, before, array_of(truth), values, sds, strict=True)
    return tuple(
        ParameterOutcome(
            moved=_apart(name, still, true),
            error=_apart(name, true, value),
            sd=_apart(name, 0.0, sd),
            identifiable=name in identifiable,
            covered=_covers(posterior.interval(name, 0.9), true - still, name),
        )
        for name, still, true, value, sd in columns
    )


def _covers(interval: tuple[float, float], offset: float, name: str) -> bool:
    """True where an interval holds an offset."""
    low, high = interval
    true = offset if name == "height" else math.remainder(offset, 2 * math.pi)
    return bool(low <= true <= high)


def _apart(name: str, one: float, other: float) -> float:
    """From one value of a parameter to another: degrees within half a turn, or the log's."""
    if name == "height":
        return float(other - one)
    return math.degrees(math.remainder(float(other - one), 2 * math.pi))


def reason_of(found: PoseFinding) -> str:
    """The code of what is said of the flow map; empty where nothing is."""
    return "" if found.fused.reason is None else str(found.fused.reason.code)


def _unserved(case: ProtocolCase, failure: str, seconds: float) -> ServedOutcome:
    """The prior pose is served where nothing is identifiable."""
    return ServedOutcome(
        reference_tracks=len(case.reference),
        seen_tracks=len(case.seen),
        used_tracks=0,
        parameters=(),
        rotation_deg=angle_deg(case.prior_pose, case.true_pose),
        height_error=abs(case.prior_pose.height_m / case.true_pose.height_m - 1),
        cuts=0,
        mapped=False,
        reason="",
        seconds=seconds,
        failure=failure,
    )
