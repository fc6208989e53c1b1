"""The body of every error: a problem document (RFC 9457)."""

from pydantic import BaseModel, Field


class ProblemField(BaseModel):
    """One thing wrong in a request."""

    pointer: str = Field(description="JSON Pointer into the body, or the name of a parameter")
    reason: str = Field(description="what is needed, and what came")


class Problem(BaseModel):
    """What went wrong; programs go by `code`, which stays, people by `detail`."""

    type: str = "about:blank"
    title: str
    status: int
    code: str
    detail: str
    errors: list[ProblemField] | None = None
