"""`/cameras`: register, list, show, change, remove."""

from dataclasses import asdict
from datetime import datetime
from typing import Annotated, Literal, Self

from fastapi import APIRouter, Query, Response
from pydantic import (
    AfterValidator,
    BaseModel,
    Field,
    ValidationInfo,
    field_validator,
    model_validator,
)

from models.errors import CalibrationError
from models.geometry.intrinsics import Intrinsics
from service.access.tokens import Caller, address_for
from service.api.documented import ETAG
from service.api.ignored import NamingRoute
from service.api.labels import CameraName, Site, Tags, slug
from service.api.middleware.dependencies import CallerDep, IfMatch, ReadDep, StateDep, WriteDep
from service.api.schemas import (
    Body,
    CameraId,
    Finite,
    IntrinsicsBody,
    IntrinsicsOut,
    LensBody,
    Out,
    PoseOut,
    PriorPoseBody,
    QuestionOut,
    ReferenceOut,
    Text,
    Who,
)
from service.cameras import cameras
from service.cameras.cameras import CameraChange, CameraSpec, CameraView
from service.degrees import in_degrees
from service.enums import PoseState
from service.formats.scaling import ImageSize
from service.notifications.fetch import Credentials
from service.notifications.send import read_url
from service.wording.typed_pose import judge_typed


def _checked_url(text: str) -> str:
    read_url(text)
    return text


FrameRate = Annotated[Finite, Field(gt=0, le=1000)]
SnapshotUrl = Annotated[str, AfterValidator(_checked_url)]
_MOST_CREDENTIALS = 200
ReferenceTracks = Annotated[int, Field(ge=5, le=100_000)]
TracksSize = Annotated[
    list[Annotated[Finite, Field(gt=0, le=100_000)]], Field(min_length=2, max_length=2)
]


class CredentialsBody(Body):
    """The user and password of a camera, by which its image is fetched. They are never returned."""

    user: str
    password: str

    @field_validator("user", "password")
    @classmethod
    def _can_be_sent(cls, value: str, info: ValidationInfo) -> str:
        if not 0 < len(value) <= _MOST_CREDENTIALS:
            raise ValueError(f"1 to {_MOST_CREDENTIALS} characters are needed, got {len(value)}")
        if not value.isprintable():
            raise ValueError("printable characters on one line are needed")
        if info.field_name == "user" and ":" in value:
            raise ValueError("a user without a colon is needed")
        return value

    def to_value(self) -> Credentials:
        """Credentials as a value."""
        return Credentials(user=self.user, password=self.password)


class WalkingSpeedBody(Body):
    """How fast people walk: the default is Carey's (2005)."""

    mean_mps: Finite = Field(1.4, gt=0.1, lt=5)
    sd_mps: Finite = Field(0.1, ge=0, lt=2)


class _LensedBody(Body):
    """A camera's lens, in one of two forms, and its prior pose."""

    intrinsics: IntrinsicsBody | None = None
    lens: LensBody | None = None
    prior_pose: PriorPoseBody | None = None

    @model_validator(mode="after")
    def _one_lens(self) -> Self:
        if self.intrinsics is not None and self.lens is not None:
            raise ValueError("either intrinsics or lens is taken, got both")
        return self

    @model_validator(mode="after")
    def _homography_fits_lens(self) -> Self:
        lens, prior = self.lens_value(), self.prior_pose
        if lens is not None and prior is not None and prior.homography is not None:
            try:
                prior.to_value(lens)
            except CalibrationError as error:
                raise ValueError(f"prior_pose: {error}") from error
        return self

    def lens_value(self) -> Intrinsics | None:
        """The lens in pixels; None where neither form is given."""
        body = self.lens or self.intrinsics
        return None if body is None else body.to_value()


class CameraBody(_LensedBody):
    """A camera to register, by its `intrinsics` or its `lens`.

    Without a prior pose, or with what was measured of it, people tell the rest.
    """

    id: CameraId | None = None
    name: CameraName | None = None
    site: Site = ""
    tags: Tags = []
    frame_rate_hz: FrameRate | None = None
    walking_speed: WalkingSpeedBody = Field(default_factory=WalkingSpeedBody)
    reference_tracks: ReferenceTracks = 200
    snapshot_url: SnapshotUrl | None = Field(None, description="a JPEG or PNG of now")
    snapshot_credentials: CredentialsBody | None = Field(None, description="for `snapshot_url`")

    @model_validator(mode="after")
    def _has_lens(self) -> Self:
        if self.intrinsics is None and self.lens is None:
            raise ValueError("intrinsics or lens is needed, got neither")
        return self

    def to_spec(self) -> CameraSpec:
        """A camera for the use case; its id is made of the name where none is given."""
        intrinsics = self.lens_value()
        assert intrinsics is not None
        prior = self.prior_pose
        measured = {} if prior is None else prior.measured
        return CameraSpec(
            camera_id=self.id or (slug(self.name) if self.name else None) or None,
            name=self.name or "",
            intrinsics=intrinsics,
            prior_pose=None if prior is None or measured else prior.to_value(intrinsics),
            given=measured,
            frame_rate_hz=self.frame_rate_hz,
            walking_speed_mean_mps=self.walking_speed.mean_mps,
            walking_speed_sd_mps=self.walking_speed.sd_mps,
            reference_tracks=self.reference_tracks,
            snapshot_url=self.snapshot_url,
            snapshot_credentials=_credentials(self.snapshot_credentials),
            site=self.site,
            tags=self.tags,
        )


class CameraPatch(_LensedBody):
    """What to change of a camera; fields left out stay.

    Measurements in place of a whole `prior_pose` replace the earlier ones; they are taken until the
    camera has a prior pose.
    """

    name: CameraName | None = Field(None, description="empty: its id")
    site: Site | None = None
    tags: Tags | None = None
    by: Who | None = None
    frame_rate_hz: FrameRate | None = None
    walking_speed: WalkingSpeedBody | None = None
    reference_tracks: ReferenceTracks | None = None
    snapshot_url: SnapshotUrl | Literal[""] | None = Field(
        None, description="empty: none; another host or port deletes the credentials"
    )
    snapshot_credentials: CredentialsBody | Literal[""] | None = Field(
        None, description="empty: none"
    )
    tracks_size: TracksSize | None = Field(
        None,
        description="[width, height] in pixels of the image that the numbers of the active "
        "source's tracks belong to, if its posts do not state a `size`; the frame's own size "
        "confirms pixels of the frame. Rescales stored tracks, and applies to later posts",
    )
    tracks_normalised: bool | None = Field(
        None,
        description="true: those numbers are shares of the image, 0 to 1; false: pixels of the "
        "frame, unless `tracks_size` is given",
    )

    @model_validator(mode="after")
    def _one_image_size(self) -> Self:
        if self.tracks_size is not None and self.tracks_normalised:
            raise ValueError("either tracks_size or tracks_normalised is accepted, got both")
        return self

    def image_size(self) -> ImageSize | None:
        """The declared image size of tracks; None if it does not change."""
        if self.tracks_size is not None:
            return ImageSize(size=(self.tracks_size[0], self.tracks_size[1]))
        if self.tracks_normalised is None:
            return None
        return ImageSize(normalised=self.tracks_normalised)


def _credentials(body: CredentialsBody | None) -> Credentials | None:
    return None if body is None else body.to_value()


class MeasuredOut(BaseModel):
    """Measurements of a pose that is not confirmed yet; null where not measured."""

    height_m: float | None = None
    tilt_deg: float | None = None
    roll_deg: float | None = None


class CameraOut(Out):
    """A registered camera.

    Callers without `admin` see scheme and host of `snapshot_url` alone. `measured` is null once the
    camera has a prior pose.
    """

    id: str
    name: str
    site: str | None
    tags: list[str]
    intrinsics: IntrinsicsOut
    prior_pose: PoseOut | None
    measured: MeasuredOut | None
    frame_rate_hz: float | None
    walking_speed: WalkingSpeedBody
    reference_tracks: int
    snapshot_url: str | None
    snapshot_credentials_set: bool
    snapshot_error: str | None
    tracks_size: list[float] | None = Field(
        description="declared image size of the active source's tracks; null: not declared"
    )
    tracks_normalised: bool
    state: PoseState
    reference: ReferenceOut
    tracks: int
    model_id: str | None
    created_at: datetime
    updated_at: datetime

    @classmethod
    def from_value(cls, view: CameraView, caller: Caller | None) -> Self:
        """The body of a camera for a caller."""
        record, size = view.record, view.image_size
        return cls.of(
            record,
            snapshot_url=address_for(caller, record.snapshot_url),
            snapshot_credentials_set=record.snapshot_credentials is not None,
            intrinsics=IntrinsicsOut.model_validate(asdict(view.intrinsics)),
            prior_pose=PoseOut.from_value(view.prior_pose) if view.calibrated else None,
            measured=MeasuredOut(**in_degrees(view.measured)) if view.measured else None,
            walking_speed=WalkingSpeedBody(
                mean_mps=record.walking_speed_mean_mps, sd_mps=record.walking_speed_sd_mps
            ),
            tracks_size=None if size is None or size.size is None else list(size.size),
            tracks_normalised=size is not None and size.normalised,
            state=view.state,
            reference=ReferenceOut.of(view.reference),
            tracks=view.tracks,
            model_id=view.model_id,
        )


class CameraAnswer(CameraOut):
    """A camera as it is stored, and what about its lens and prior pose is worth a second look."""

    questions: list[QuestionOut]

    @classmethod
    def from_value(cls, view: CameraView, caller: Caller | None) -> Self:
        """The body of a camera, with the questions that the registration form asks about it."""
        # Of a pose that is assumed, what was measured may be a slip, too.
        asked = [
            QuestionOut(field=each.field, text=each.text)
            for each in judge_typed(view.intrinsics, view.prior_pose)
        ]
        return cls(**dict(CameraOut.from_value(view, caller)), questions=asked)


class CameraPage(BaseModel):
    """Some cameras; `next_cursor` leads to more."""

    items: list[CameraOut]
    next_cursor: str | None


router = APIRouter(prefix="/cameras", tags=["cameras"], route_class=NamingRoute)


@router.post("", status_code=201, responses={201: {"headers": ETAG}})
def register_camera(
    body: CameraBody, state: StateDep, session: WriteDep, caller: CallerDep, response: Response
) -> CameraAnswer:
    """Register a camera.

    Its first training is queued. `questions` lists values that may be mistakes, such as millimetres
    in place of pixels.
    """
    view = cameras.register_camera(session, state.queue, state.settings, body.to_spec())
    response.headers["Location"] = f"/cameras/{view.record.id}"
    response.headers["ETag"] = view.etag
    return CameraAnswer.from_value(view, caller)


@router.get("")
def list_cameras(
    state: StateDep,
    session: ReadDep,
    caller: CallerDep,
    cursor: Text = "",
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
    wanted: Annotated[
        list[PoseState] | None,
        Query(alias="state", description="cameras in this state alone; may be said repeatedly"),
    ] = None,
    site: Annotated[Site, Query(description="cameras of this site and of those below it")] = "",
    tag: Annotated[Tags | None, Query(description="cameras with all of these")] = None,
) -> CameraPage:
    """List the cameras.

    They are ordered by id; `next_cursor` leads to the next page.
    """
    views = cameras.list_cameras(
        session, state.settings, cursor, limit + 1, wanted or (), site, tag or ()
    )
    page = views[:limit]
    return CameraPage(
        items=[CameraOut.from_value(view, caller) for view in page],
        next_cursor=page[-1].record.id if len(views) > limit else None,
    )


@router.get("/{camera_id}", responses={200: {"headers": ETAG}})
def get_camera(
    camera_id: str, state: StateDep, session: ReadDep, caller: CallerDep, response: Response
) -> CameraOut:
    """Get a camera.

    The `ETag` of the answer is needed to change the camera.
    """
    view = cameras.view_camera(session, state.settings, camera_id)
    response.headers["ETag"] = view.etag
    return CameraOut.from_value(view, caller)


@router.patch("/{camera_id}", responses={200: {"headers": ETAG}})
def change_camera(
    camera_id: str,
    body: CameraPatch,
    state: StateDep,
    session: WriteDep,
    caller: CallerDep,
    response: Response,
    if_match: IfMatch = None,
) -> CameraAnswer:
    """Change a camera.

    Another lens, prior pose or walking speed queues a training. So does `tracks_size` or
    `tracks_normalised` if it rescales stored tracks; either answers the question about them in
    `GET /cameras/{id}/pose`.

    `If-Match` is the `ETag` of the camera as it was read. Without it the answer is 428, and with an
    older one 412; both have the current one in `etag`.
    """
    given = body.snapshot_credentials
    prior = body.prior_pose
    whole = None if prior is None or prior.measured or prior.homography is not None else prior
    speed = {} if body.walking_speed is None else body.walking_speed.model_dump(exclude_unset=True)
    view = cameras.change_camera(
        session,
        state.queue,
        state.settings,
        camera_id,
        if_match,
        CameraChange(
            name=body.name,
            site=body.site,
            tags=body.tags,
            intrinsics=body.lens_value(),
            prior_pose=None if whole is None else whole.to_value(),
            homography=None if prior is None else prior.homography,
            given=(None if prior is None else prior.measured) or None,
            frame_rate_hz=body.frame_rate_hz,
            walking_speed_mean_mps=speed.get("mean_mps"),
            walking_speed_sd_mps=speed.get("sd_mps"),
            reference_tracks=body.reference_tracks,
            snapshot_url=body.snapshot_url,
            snapshot_credentials="" if given == "" else _credentials(given),
            image_size=body.image_size(),
        ),
        body.by,
    )
    response.headers["ETag"] = view.etag
    return CameraAnswer.from_value(view, caller)


@router.delete("/{camera_id}", status_code=204)
def delete_camera(
    camera_id: str,
    state: StateDep,
    session: WriteDep,
    if_match: IfMatch = None,
    by: Annotated[Who | None, Query(description="who deletes it")] = None,
) -> None:
    """Delete a camera with its tracks, models, estimates and alerts.

    `If-Match` is needed as for a change.
    """
    cameras.remove_camera(session, camera_id, if_match, by)
    state.posts.forget(camera_id)  # another may come under its id
