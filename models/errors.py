"""Errors of calibration; the service maps these to problem documents."""


class CalibrationError(ValueError):
    """Base of all errors of `models/`; the message names field, limit and value."""


class ShapeError(CalibrationError):
    """An array or a value is not of the form that the function takes."""


class DegenerateGeometryError(CalibrationError):
    """The geometry allows no answer, as for a camera that sees no ground."""


class TooFewTrajectoriesError(CalibrationError):
    """Fewer trajectories than the estimate needs."""


class CheckpointError(CalibrationError):
    """A stored model is missing, damaged or made for something else."""
