"""Names of cameras, and where they belong: a site, which is a path, and tags, which are words."""

import re
from typing import Annotated

from pydantic import AfterValidator, Field
from pydantic_core import PydanticCustomError

MOST_TAGS = 20
_TAG = re.compile(r"[\w.:-]{1,40}")


def _checked_site(text: str) -> str:
    names = text.split("/") if text else []
    # A # begins a tag where pages say both in one line.
    if not all(n and n == n.strip() and n.isprintable() and "#" not in n for n in names):
        raise PydanticCustomError(
            "no_site", "names with / between them are needed, such as campus/north, and no #"
        )
    return text


def _checked_tags(words: list[str]) -> list[str]:
    for word in words:
        if not _TAG.fullmatch(word):
            raise PydanticCustomError(
                "no_tag",
                "a tag is letters, digits and .:-_, 40 at most, which {word} is not",
                {"word": repr(word[:50])},
            )
    return sorted(set(words))


CameraName = Annotated[str, Field(max_length=200)]
Site = Annotated[
    str,
    Field(max_length=200, description="a path such as campus/north/gate; empty: none"),
    AfterValidator(_checked_site),
]
Tags = Annotated[
    list[str],
    Field(max_length=MOST_TAGS, description="words of letters, digits and .:-_"),
    AfterValidator(_checked_tags),
]


def slug(name: str) -> str:
    """An id made of a name: lower case, digits and hyphens."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:50]
