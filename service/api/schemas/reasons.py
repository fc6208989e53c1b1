"""What stands beside every `reason`: its code, and the numbers and names that belong to it."""

from typing import Annotated, Any

from pydantic import Field

from service.reasons import CODES

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
