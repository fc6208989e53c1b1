"""What a worker may be for alone: trainings want other machines than all the rest does."""

from enum import StrEnum


class WorkKind(StrEnum):
    """Trainings, or all but trainings; as `surefoot worker --only` says it."""

    ESTIMATE = "estimate"
    TRAIN = "train"
