"""Answers of `/cameras/{id}/tracks`; its bodies are read by `service/formats`."""

from typing import Any, Self

from pydantic import BaseModel

from service.cameras.tracks import Receipt
from service.formats.track import Rejection


def _rows(what: str, numbers: int) -> dict[str, Any]:
    row = {"type": "array", "items": {"type": "number"}, "minItems": numbers}
    return {"type": "array", "items": row, "description": what}


# A track takes one of the four forms.
DESCRIBED_TRACK: dict[str, Any] = {
    "type": "object",
    "required": ["id"],
    "properties": {
        "id": {"type": "string"},
        "points": _rows(
            "[time_s, u_px, v_px] of the foot, or all with their heads: "
            "[time_s, u_px, v_px, u_head_px, v_head_px]",
            3,
        ),
        "boxes": _rows("[time_s, x1, y1, x2, y2] in pixels", 5),
        "frames": _rows("[frame, u_px, v_px], or all with their heads", 3),
        "frame_boxes": _rows("[frame, x1, y1, x2, y2]", 5),
        "class": {
            "type": ["string", "number", "null"],
            "description": "what it is of, by name or COCO's number: no person is left out",
        },
    },
}


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
    """What became of the posted tracks; where it stands, `left_out` of them were of no person."""

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
