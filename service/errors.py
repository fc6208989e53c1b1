"""Errors that the service answers with a problem document (RFC 9457)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from surefoot.people import SkipReason


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldError:
    """One thing wrong in a body: a JSON Pointer and the reason, with limit and value."""

    pointer: str
    reason: str


class ServiceError(Exception):
    """An error with an HTTP status and a stable code; the message is the detail.

    `retry_after_s` tells when to come back, where that helps.
    """

    status = 500
    code = "internal"

    def __init__(
        self,
        detail: str,
        errors: tuple[FieldError, ...] = (),
        retry_after_s: float | None = None,
    ) -> None:
        super().__init__(detail)
        self.detail = detail
        self.errors = errors
        self.retry_after_s = retry_after_s

    @property
    def headers(self) -> dict[str, str]:
        """Headers that go with the answer."""
        return {}


class UnauthorizedError(ServiceError):
    """Nobody is known to ask, or with what nobody is let in."""

    status, code = 401, "unauthorized"

    @property
    def headers(self) -> dict[str, str]:
        """How to be let in."""
        return {"WWW-Authenticate": 'Bearer realm="surefoot"'}


class ForbiddenError(ServiceError):
    """Who asks is known, and may not do this."""

    status, code = 403, "forbidden"


class SwitchedOffError(ServiceError):
    """The operator has not switched on what is asked for."""

    status, code = 403, "switched_off"


class NotFoundError(ServiceError):
    """The path names nothing that exists."""

    status, code = 404, "not_found"


class ConflictError(ServiceError):
    """The request does not fit the state that things are in."""

    status, code = 409, "conflict"


class TooManySourcesError(ServiceError):
    """A camera has as many sources of tracks as it may have."""

    status, code = 409, "too_many_sources"


class _VersionError(ServiceError):
    """An error about the version that a change is meant for; `etag` is the stored one's."""

    def __init__(self, detail: str, etag: str) -> None:
        super().__init__(detail)
        self.etag = etag

    @property
    def headers(self) -> dict[str, str]:
        """What `If-Match` has to be, once the change still holds of that version."""
        return {"ETag": self.etag}


class PreconditionFailedError(_VersionError):
    """`If-Match` names another version than the stored one."""

    status, code = 412, "precondition_failed"


class PreconditionRequiredError(_VersionError):
    """A change came without `If-Match`."""

    status, code = 428, "precondition_required"


def check_version(what: str, now: str, asked: str | None) -> None:
    """Refuse a change that was not made of what is stored.

    `what` is "the camera is", say; `asked` is that of `If-Match`, or *.

    Raises:
        PreconditionRequiredError: none was asked for.
        PreconditionFailedError: another one was.
    """
    if asked is None:
        raise PreconditionRequiredError(
            f"If-Match: the ETag as it was read is needed; {what} at {now}", now
        )
    if asked not in (now, "*"):
        raise PreconditionFailedError(f"If-Match: {what} at {now}, got {asked}", now)


class TooLargeError(ServiceError):
    """A request beyond a stated limit."""

    status, code = 413, "too_large"


class MalformedError(ServiceError):
    """A body that cannot be read at all, or has a missing or invalid field."""

    status, code = 422, "malformed"

    @classmethod
    def of_field(cls, name: str, reason: str) -> Self:
        """The error of one field, or parameter, alone."""
        return cls(f"{name}: {reason}", (FieldError(pointer=f"/{name}", reason=reason),))


class NothingTakenError(ServiceError):
    """A body of tracks none of which could be stored.

    `errors` has the reason for each; `skipped` counts the tracks that were skipped, by reason.
    """

    status, code = 422, "nothing_taken"

    def __init__(
        self,
        detail: str,
        errors: tuple[FieldError, ...] = (),
        skipped: Mapping[SkipReason, int] | None = None,
    ) -> None:
        super().__init__(detail, errors)
        self.skipped = skipped or {}


class UnsupportedMediaTypeError(ServiceError):
    """A body of a content type that the path does not take."""

    status, code = 415, "unsupported_media_type"


class TooManyCamerasError(ServiceError):
    """As many cameras are registered as may be."""

    status, code = 409, "too_many_cameras"


class TooManyRequestsError(ServiceError):
    """More requests than a token, an address or a camera may make."""

    status, code = 429, "too_many_requests"


class QuotaError(ServiceError):
    """More bytes of a camera are stored than may be, until the next retention."""

    status, code = 429, "quota_exceeded"


class OverloadedError(ServiceError):
    """More is asked for at once than can be worked on; nothing was done."""

    status, code = 503, "overloaded"


class StoreUnavailableError(ServiceError):
    """The store cannot be read or written now; nothing was stored."""

    status, code = 503, "store_unavailable"


class StorageFullError(ServiceError):
    """The disk is full; nothing was stored."""

    status, code = 507, "storage_full"
