"""Which tracks are pedestrians: one rule for classes and confidence, for every source.

HTTP, the bridge and `surefoot.read_tracks` all ask this module. It imports the standard library
only, because the bridge starts without numpy.
"""

import math
import re
from dataclasses import dataclass
from enum import StrEnum

# Class indices of detectors trained on COCO count from 0, and 0 is a person.
_PERSON_NUMBERS = frozenset((0,))
_PERSON_NAMES = frozenset(
    (
        "person",
        "persons",
        "people",
        "pedestrian",
        "pedestrians",
        "human",
        "humans",
        "walker",
        "man",
        "woman",
        "child",
        "adult",
        "boy",
        "girl",
    )
)
_NO_CLASS = frozenset(("", "none", "null", "nan"))
_NO_CLASS_NUMBER = -1  # MOTChallenge writes -1 into a column that it does not use
_LIST_ITEM = re.compile(r"\d{1,6}|[^\W\d][\w .-]{0,59}")
_MAX_ITEMS = 100


class SkipReason(StrEnum):
    """Reasons to leave out a track that is no error of its sender."""

    NOT_A_PERSON = "not_a_person"
    CONFIDENCE = "ignored_by_confidence"
    NO_ID = "no_track_id"


@dataclass(frozen=True, slots=True, kw_only=True)
class PersonClasses:
    """Class numbers and names that are pedestrians. Names are compared without case."""

    numbers: frozenset[int] = _PERSON_NUMBERS
    names: frozenset[str] = _PERSON_NAMES

    def include(self, value: object) -> bool:
        """Return True for the class of a pedestrian, or if no class is given.

        A class is a number (0, 0.0), text of a number ("0", "0.0") or a name. None, an empty
        text and -1 mean that the source gives no class.

        Raises:
            ValueError: the value is neither text nor a finite number.
        """
        if value is None:
            return True
        number = _number(value)
        if number is not None:
            return number == _NO_CLASS_NUMBER or number in self.numbers
        name = _name(str(value))
        return name in _NO_CLASS or name in self.names

    def __str__(self) -> str:
        """Return the numbers and the most usual names, for messages."""
        numbers = [str(number) for number in sorted(self.numbers)]
        names = ["person"] if self.names is _PERSON_NAMES else sorted(self.names)
        return ", ".join((*numbers, *names))


PEDESTRIANS = PersonClasses()


def read_classes(text: str) -> PersonClasses:
    """Read a list such as `0`, `1,7` or `person,worker` of the classes that are pedestrians.

    Numbers replace the default number, names replace the default names.

    Raises:
        ValueError: the text is no such list.
    """
    items = [item.strip() for item in text.split(",")]
    if len(items) > _MAX_ITEMS or not all(map(_LIST_ITEM.fullmatch, items)):
        needed = "numbers or names separated by commas, for example 0 or 1,7 or person"
        raise ValueError(f"must be {needed}; got {text!r:.60}")
    numbers = frozenset(int(item) for item in items if item.isdecimal())
    names = frozenset(_name(item) for item in items if not item.isdecimal())
    return PersonClasses(numbers=numbers or _PERSON_NUMBERS, names=names or _PERSON_NAMES)


def is_ignored(confidence: object) -> bool:
    """Return True if a confidence is exactly 0, which marks a detection to be ignored.

    MOTChallenge defines it so; a detector never reports it. Any other value, and none, is used.
    """
    if confidence is None or isinstance(confidence, bool):
        return False
    try:
        return float(confidence) == 0.0  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        return False


def skip_reason(
    label: object, confidence: object = None, classes: PersonClasses = PEDESTRIANS
) -> SkipReason | None:
    """Return the reason to skip a track or a detection, or None to use it.

    Raises:
        ValueError: the label is neither text nor a finite number.
    """
    if not classes.include(label):
        return SkipReason.NOT_A_PERSON
    return SkipReason.CONFIDENCE if is_ignored(confidence) else None


def _number(value: object) -> float | None:
    """Return the number that a class is, None for a name."""
    if isinstance(value, str):
        try:
            found = float(value) if value.isascii() else math.nan
        except ValueError:
            return None
        return found if math.isfinite(found) else None
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"text or a number is needed, got {value!r:.60}")
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"text or a finite number is needed, got {value!r:.60}")
    return value


def _name(text: str) -> str:
    """Return a name without case, with one blank for each run of blanks, _ and -."""
    return re.sub(r"[\s_-]+", " ", text).strip().lower()
