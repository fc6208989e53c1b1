"""`/ui/register`: a camera by a form, with a preview before anything is stored."""

from dataclasses import replace
from typing import Annotated, Self

import numpy as np
from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse
from pydantic import BaseModel, Field

from models.durations import DAY_S
from models.geometry.usual_pose import usual_pose
from service.api.cameras import CameraOut
from service.api.middleware.dependencies import BodyDep, CallerDep, StateDep, WriteDep
from service.api.middleware.pages import render
from service.api.schemas import Body, Finite, Text, Triple
from service.cameras import cameras
from service.formats.calibration_file import read_calibration
from service.formats.track import Clock, Limits
from service.formats.track_text import read_text
from service.pages.drawings.ground_plan import tried_ground_svg
from service.pages.drawings.picture import Overlay, ground_of, picture_svg
from service.pages.registration_form import RegistrationForm
from service.wording.calibrations import notes_of
from service.wording.connecting import skipped_words
from service.wording.language import N_, _, _n
from service.wording.typed_pose import (
    Saying,
    judge_pose,
    judge_tracks,
    judge_typed,
    worst_first,
)
from surefoot.calibration.value import Calibration

router = APIRouter(include_in_schema=False)

_MOST_TRACKS, _MOST_POINTS = 80, 40  # of recorded ones, which every preview takes along
_USUAL_RATE_HZ = 25.0
_AN_EPOCH_S = 1e9  # recordings to try have frames and no dates
_A_RECORDING_S = 366 * DAY_S


# What a calibration file may say, by a field of it.
_READ = {
    "fx": N_("lens"),
    "width": N_("picture size"),
    "rotation": N_("rotation"),
    "translation_m": N_("translation"),
}


class PreviewBody(Body):
    """The form so far, and recorded tracks to try it with: `[frame, u, v]` each point."""

    fields: RegistrationForm
    tracks: Annotated[
        list[Annotated[list[Triple], Field(max_length=200)]], Field(max_length=200)
    ] = []


class PreviewOut(BaseModel):
    """The pictures of a pose, what is to say of it, and what is wrong with the fields."""

    picture: str
    ground: str
    says: list[Saying]
    errors: dict[str, str]


class TriedOut(BaseModel):
    """Tracks to send with each preview, thinned, and what was read."""

    tracks: list[list[list[Finite]]]
    text: str


class FilledOut(BaseModel):
    """A calibration file as the form's fields have it."""

    fields: dict[str, str]
    text: str

    @classmethod
    def from_value(cls, value: Calibration) -> Self:
        """The fields of a calibration."""
        fields: dict[str, str] = {}
        if value.size is not None:
            fields |= {"width": str(value.size[0]), "height": str(value.size[1])}
        if value.matrix is not None:
            fx, cx, fy, cy = (value.matrix[n] for n in (0, 2, 4, 5))
            fields |= {"lens_form": "pixels", "projection": value.projection}
            fields |= {"fx": _say(fx), "fy": _say(fy), "cx": _say(cx), "cy": _say(cy)}
        if value.distortion is not None:
            fields["distortion"] = ", ".join(_say(number) for number in value.distortion)
        if value.rotation is not None:
            rows = [value.rotation[n : n + 3] for n in range(0, len(value.rotation), 3)]
            fields["rotation"] = "\n".join("  ".join(_say(n) for n in row) for row in rows)
        if value.translation_m is not None:
            fields["translation_m"] = "  ".join(_say(number) for number in value.translation_m)
        if "rotation" in fields and "translation_m" in fields:
            fields["form"] = "matrix"
        read = ", ".join(_(word) for name, word in _READ.items() if name in fields)
        missing = ", ".join(_(word) for name, word in _READ.items() if name not in fields)
        parts = [_("Read from {format}: {names}.", format=value.format, names=read)]
        if missing:
            parts.append(_("Not in the file: {names}.", names=missing))
        return cls(fields=fields, text=" ".join([*parts, *notes_of(value)]))


@router.get("/ui/register")
def show(request: Request) -> HTMLResponse:
    """The form."""
    return render(request, "register.html")


@router.post("/ui/preview")
def preview(body: PreviewBody) -> PreviewOut:
    """The picture and the ground by a form so far, and remarks on it."""
    read = body.fields.read()
    typed = body.fields.model_dump()
    wrong = {error.pointer[1:]: error.reason for error in read.errors}
    # What is needed and not there yet is no error while the form is filled in.
    errors = {name: reason for name, reason in wrong.items() if typed[name].strip()}
    unknown = read.pose is None or bool(read.pose.measured)
    if read.lens is not None and unknown and body.fields.form == "people":
        pose = usual_pose({} if read.pose is None else read.pose.measured)
        asked = judge_typed(read.lens.to_value(), pose)
        says = worst_first([_of_measured(each) for each in asked])
        return PreviewOut(picture="", ground="", says=says, errors=errors)
    if read.lens is None or read.pose is None or unknown:
        return PreviewOut(picture="", ground="", says=[], errors=errors)
    lens, pose = read.lens.to_value(), read.pose.to_value()
    tracks = [np.array(track) for track in body.tracks if len(track) > 1]
    feet = [track[:, 1:] for track in tracks]
    says = judge_pose(lens, pose, typed_angles=body.fields.form == "angles")
    if tracks:
        rate_hz = None if read.rest is None else read.rest.frame_rate_hz
        says += judge_tracks(lens, pose, tracks, max(rate_hz or _USUAL_RATE_HZ, 1e-3))
    view = ground_of(lens, pose)
    squares = _("no ground in it")
    if view is not None:
        squares = _("a square is {m:g} m", m=view.spacing_m)
    drawn = picture_svg(
        lens,
        [Overlay(pose=pose, kind="prior")],
        feet,
        label=_(
            "The picture with the horizon and a grid on the ground; {squares}", squares=squares
        ),
        ground=view,
    )
    return PreviewOut(
        picture=str(drawn),
        ground=str(tried_ground_svg(lens, pose, feet)) if tracks else "",
        says=worst_first(says),
        errors=errors,
    )


def _of_measured(said: Saying) -> Saying:
    """A remark beside the field that what was measured is typed into."""
    typed = f"measured_{said.field}"
    return replace(said, field=typed) if typed in RegistrationForm.model_fields else said


@router.post("/ui/calibration")
def calibration(body: BodyDep, camera: Text = "") -> FilledOut:
    """The form's fields out of a calibration file."""
    return FilledOut.from_value(read_calibration(body, camera or None))


@router.post("/ui/tracks")
def tracks(
    body: BodyDep,
    width: Annotated[int, Query(gt=0, le=100_000)],
    height: Annotated[int, Query(gt=0, le=100_000)],
    frame_rate_hz: Annotated[float, Query(gt=0, le=1000)] = _USUAL_RATE_HZ,
) -> TriedOut:
    """Return recorded tracks of a text table, thinned, to try a form with; nothing is stored."""
    clock = Clock(frame_rate_hz=frame_rate_hz, started_at_s=_AN_EPOCH_S)
    limits = Limits(width=width, height=height, now_s=_AN_EPOCH_S, max_ahead_s=_A_RECORDING_S)
    batch = read_text(body, "tried", clock, limits)
    some = batch.tracks[:: max(-(-len(batch.tracks) // _MOST_TRACKS), 1)]
    thinned = []
    for track in some:
        frames = np.round((track.points[:, 0] - _AN_EPOCH_S) * frame_rate_hz)
        points = np.column_stack([frames, np.round(track.points[:, 1:], 1)])
        thinned.append(points[:: max(-(-len(points) // _MOST_POINTS), 1)].tolist())
    text = _n("{n} track read", "{n} tracks read", len(batch.tracks))
    if len(some) < len(batch.tracks):
        text += _(", {n} of them shown", n=len(some))
    for reason, count in batch.skipped.items():
        text += f"; {skipped_words(reason, count)}"
    if batch.rejections:
        first = batch.rejections[0]
        text += _(
            "; {n} left out, the first since: {why}", n=len(batch.rejections), why=first.detail
        )
    return TriedOut(tracks=thinned, text=f"{text}.")


@router.post("/ui/register", status_code=201)
def register(
    body: RegistrationForm, state: StateDep, session: WriteDep, caller: CallerDep
) -> CameraOut:
    """Register a camera by the form; the same as `POST /cameras`."""
    spec = body.to_body().to_spec()
    view = cameras.register_camera(session, state.queue, state.settings, spec)
    return CameraOut.from_value(view, caller)


def _say(number: float) -> str:
    return f"{number:.10g}"
