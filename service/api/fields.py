"""Types of fields, and the base class, that several bodies share."""

from datetime import UTC, datetime
from typing import Annotated, Any

from pydantic import (
    AfterValidator,
    AwareDatetime,
    BaseModel,
    ConfigDict,
    Field,
    StringConstraints,
    field_validator,
)

from service.reasons import CODES

_EARLIEST, _LATEST = datetime(1970, 1, 1, tzinfo=UTC), datetime(9999, 1, 1, tzinfo=UTC)


def _checked_moment(value: datetime) -> datetime:
    # In UTC, the first and the last hours that a datetime can say are none any more.
    if not _EARLIEST <= value <= _LATEST:
        raise ValueError(f"a time from 1970 to 9998 is needed, got {value.isoformat()}")
    return value


def _without_nul(value: str) -> str:
    # PostgreSQL has no text with one.
    if "\0" in value:
        raise ValueError("text without NUL characters is needed")
    return value


Moment = Annotated[AwareDatetime, AfterValidator(_checked_moment)]
Finite = Annotated[float, Field(allow_inf_nan=False)]
Triple = Annotated[list[Finite], Field(min_length=3, max_length=3)]
Text = Annotated[str, AfterValidator(_without_nul)]
CameraId = Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9-]{0,62}$")]
Who = Annotated[str, StringConstraints(min_length=1, max_length=200)]
# Beside every `reason`: its code, and the numbers and names that belong to it.
ReasonCode = Annotated[
    str,
    Field(
        description="code of the first of the reasons; null where there is none",
        json_schema_extra={"enum": list(CODES)},
    ),
]
ReasonValues = Annotated[
    dict[str, Any],
    Field(description="its numbers, with the unit in their names, and names; may be empty"),
]


class Body(BaseModel):
    """A request body; unknown fields are refused, since they are mostly misspelt ones."""

    model_config = ConfigDict(extra="forbid")

    @field_validator("*")
    @classmethod
    def _no_nul(cls, value: object) -> object:
        return _without_nul(value) if isinstance(value, str) else value
