"""Student's t: how often chance goes so far, and how far it goes so often.

Source: Student 1908; the functions are SciPy's.
"""


def chance_below(value: float, freedom: float) -> float:
    """The chance that a Student's t of some degrees of freedom is below a value."""
    from scipy.special import stdtr  # late: the HTTP process has no use for it

    return float(stdtr(freedom, value))


def value_below(chance: float, freedom: float) -> float:
    """What a Student's t of some degrees of freedom is below with a chance."""
    from scipy.special import stdtrit

    return float(stdtrit(freedom, chance))
