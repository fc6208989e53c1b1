"""Forms of pages that work without a script: what was typed, read by hand."""

from typing import Annotated
from urllib.parse import parse_qs

from fastapi import Depends, Request

from service.api.middleware.dependencies import media_type_of
from service.errors import MalformedError, TooLargeError, UnsupportedMediaTypeError

_MOST_BYTES = 16 * 1024
_MOST_FIELDS = 100
_TYPE = "application/x-www-form-urlencoded"


class Form(dict[str, list[str]]):
    """The fields of a form; one that was left empty is missing."""

    def one(self, name: str) -> str:
        """The text of a field; empty where nothing was typed."""
        return self.get(name, [""])[0].strip()


async def read_form(request: Request) -> Form:
    """The fields of a request's form.

    Raises:
        UnsupportedMediaTypeError: it is no form.
        TooLargeError: more than a form of ours has.
        MalformedError: it cannot be read, or has NUL characters in it.
    """
    media_type = media_type_of(request)
    if media_type != _TYPE:
        raise UnsupportedMediaTypeError(f"Content-Type: {_TYPE} is needed, got {media_type!r:.80}")
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > _MOST_BYTES:
            raise TooLargeError(f"body: at most {_MOST_BYTES} bytes of a form are taken")
    try:
        form = Form(parse_qs(body.decode("utf-8"), max_num_fields=_MOST_FIELDS))
    except ValueError as error:  # UnicodeDecodeError is one
        raise MalformedError(f"body: this is no form: {error}") from error
    for name, values in form.items():
        if any("\0" in value for value in values):
            raise MalformedError(f"{name[:80]!r}: text without NUL characters is needed")
    return form


FormDep = Annotated[Form, Depends(read_form)]
