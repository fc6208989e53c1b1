"""`/ui/register`: a camera by a form, with a preview before anything is stored."""

from typing import Annotated

import numpy as np
from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse

from models.durations import DAY_S
from service.api.cameras import CameraOut
from service.api.middleware.dependencies import BodyDep, StateDep, WriteDep
from service.api.middleware.pages import render
from service.api.registration_schemas import (
    FilledOut,
    PreviewBody,
    PreviewOut,
    RegistrationForm,
    SayingOut,
    TriedOut,
    values_of,
)
from service.cameras import cameras
from service.formats.calibration_file import read_calibration
from service.formats.mot import read_mot
from service.formats.track import Clock, Limits
from service.pages.drawings.picture import Overlay, ground_of, picture_svg
from service.pages.drawings.preview import tried_ground_svg
from service.pages.plausibility import judge_pose, judge_tracks, worst_first

router = APIRouter(include_in_schema=False)

_MOST_TRACKS, _MOST_POINTS = 80, 40  # of recorded ones, which every preview takes along
_USUAL_RATE_HZ = 25.0
_AN_EPOCH_S = 1e9  # recordings to try have frames and no dates
_A_RECORDING_S = 366 * DAY_S


@router.get("/ui/register")
def show(request: Request) -> HTMLResponse:
    """The form."""
    return render(request, "register.html")


@router.post("/ui/preview")
def preview(body: PreviewBody) -> PreviewOut:
    """What the picture and the ground look like by a form so far, and what is to say of it."""
    read = body.fields.read()
    typed = body.fields.model_dump()
    wrong = {error.pointer[1:]: error.reason for error in read.errors}
    # What is needed and not there yet is no error while the form is filled in.
    errors = {name: reason for name, reason in wrong.items() if typed[name].strip()}
    lens, pose = values_of(read)
    if lens is None or pose is None:
        return PreviewOut(picture="", ground="", says=[], errors=errors)
    tracks = [np.array(track) for track in body.tracks if len(track) > 1]
    feet = [track[:, 1:] for track in tracks]
    says = judge_pose(lens, pose, typed_angles=body.fields.form == "angles")
    if tracks:
        rate_hz = None if read.rest is None else read.rest.frame_rate_hz
        says += judge_tracks(lens, pose, tracks, max(rate_hz or _USUAL_RATE_HZ, 1e-3))
    view = ground_of(lens, pose)
    squares = "no ground in it" if view is None else f"a square is {view.spacing_m:g} m"
    drawn = picture_svg(
        lens,
        [Overlay(pose=pose, kind="prior")],
        feet,
        label=f"The picture with the horizon and a grid on the ground; {squares}",
        ground=view,
    )
    return PreviewOut(
        picture=str(drawn),
        ground=str(tried_ground_svg(lens, pose, feet)) if tracks else "",
        says=[SayingOut.model_validate(said, from_attributes=True) for said in worst_first(says)],
        errors=errors,
    )


@router.post("/ui/calibration")
def calibration(body: BodyDep) -> FilledOut:
    """What a calibration file of OpenCV's says, for the form's fields."""
    return FilledOut.from_value(read_calibration(body))


@router.post("/ui/tracks")
def tracks(
    body: BodyDep,
    width: Annotated[int, Query(gt=0, le=100_000)],
    height: Annotated[int, Query(gt=0, le=100_000)],
    frame_rate_hz: Annotated[float, Query(gt=0, le=1000)] = _USUAL_RATE_HZ,
) -> TriedOut:
    """Recorded MOTChallenge tracks, thinned, to try a form with; nothing is stored."""
    clock = Clock(frame_rate_hz=frame_rate_hz, started_at_s=_AN_EPOCH_S)
    limits = Limits(width=width, height=height, now_s=_AN_EPOCH_S, max_ahead_s=_A_RECORDING_S)
    batch = read_mot(body, "tried", clock, limits)
    some = batch.tracks[:: max(-(-len(batch.tracks) // _MOST_TRACKS), 1)]
    thinned = []
    for track in some:
        frames = np.round((track.points[:, 0] - _AN_EPOCH_S) * frame_rate_hz)
        points = np.column_stack([frames, np.round(track.points[:, 1:], 1)])
        thinned.append(points[:: max(-(-len(points) // _MOST_POINTS), 1)].tolist())
    text = f"{len(batch.tracks)} tracks read"
    if len(some) < len(batch.tracks):
        text += f", {len(some)} of them shown"
    if batch.left_out:
        text += f"; {batch.left_out} lines are of no person"
    if batch.rejections:
        first = batch.rejections[0]
        text += f"; {len(batch.rejections)} left out, the first since: {first.detail}"
    return TriedOut(tracks=thinned, text=f"{text}.")


@router.post("/ui/register", status_code=201)
def register(body: RegistrationForm, state: StateDep, session: WriteDep) -> CameraOut:
    """Register a camera by the form; the same as `POST /cameras`."""
    spec = body.to_body().to_spec()
    return CameraOut.from_value(cameras.register_camera(session, state.queue, state.settings, spec))
