"""One process of a machine at a time: a lock on a file, held until it is let go or we end."""

import fcntl
from pathlib import Path


class FileLock:
    """A lock that the system lets go of however its holder ends: no clock has a say in it."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("w")
        self._held = False

    def held(self) -> bool:
        """Whether it is ours; where it is nobody's, it is taken."""
        if not self._held:
            try:
                fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except OSError:
                return False
            self._held = True
        return True

    def close(self) -> None:
        """Let go of it."""
        self._file.close()
