"""Answers of `/cameras/{id}/tracks`; its bodies are read by `service/formats`."""

from typing import Self

from pydantic import BaseModel

from service.formats.track import Rejection
from service.recalibration.tracks import Receipt


class RejectionOut(BaseModel):
    """Why a track was not stored."""

    index: int
    id: str | None
    code: str
    detail: str

    @classmethod
    def from_value(cls, value: Rejection) -> Self:
        """The body of a rejection."""
        return cls(index=value.index, id=value.track_id, code=value.code, detail=value.detail)


class ReceiptOut(BaseModel):
    """What became of the posted tracks; where it stands, `left_out` lines were of no person."""

    accepted: int
    duplicates: int
    rejected: list[RejectionOut]
    left_out: int = 0

    @classmethod
    def from_value(cls, value: Receipt) -> Self:
        """The body of a receipt."""
        return cls(
            accepted=value.accepted,
            duplicates=value.duplicates,
            rejected=[RejectionOut.from_value(item) for item in value.rejections],
            left_out=value.left_out,
        )
