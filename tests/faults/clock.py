"""The wall clock of other processes, to be set by a test; the monotonic one goes on."""

import shutil
import struct
import subprocess
from pathlib import Path


class Clock:
    """A file that says how far their clock is ahead, and what has processes look at it."""

    def __init__(self, folder: Path) -> None:
        self._file, library = folder / "clock", folder / "clock.so"
        self._file.write_bytes(struct.pack("=q", 0))
        source, compiler = Path(__file__).with_name("clock.c"), shutil.which("cc")
        made = (
            compiler is not None
            and not subprocess.run(
                [compiler, "-shared", "-fPIC", "-O1", "-o", library, source], check=False
            ).returncode
        )
        # None where there is no C compiler.
        self.environment: dict[str, str] | None = (
            {"LD_PRELOAD": str(library), "FAULTS_CLOCK": str(self._file)} if made else None
        )

    def set(self, ahead_s: int) -> None:
        """Have it run so many seconds ahead."""
        with self._file.open("r+b") as file:  # in its place: processes have it mapped
            file.write(struct.pack("=q", ahead_s))
