"""Exit statuses of a worker that ends by itself; `serve` reads them."""

REFUSED = 75  # another process works under its name: starting it again would not help
FULL = 76  # it had grown beyond its ceiling, and ended its jobs first
HANGS = 77  # a job of it went on far beyond its limit
GIVEN_UP = 78  # it was silent for so long that its jobs were given to others

WORDS = {
    REFUSED: "another process works under its name",
    FULL: "it had grown beyond its ceiling",
    HANGS: "a job went on beyond its limit",
    GIVEN_UP: "it was silent for too long",
}


def words_of(status: int) -> str:
    """The words for why a process ended, by its exit status."""
    if status < 0:
        return f"ended by signal {-status}"
    return WORDS.get(status, f"ended with status {status}")
