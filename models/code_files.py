"""Files of machine code that are whole or as if they were not there.

numba's own are not: what a crash cut off is an error at every later call, and it is not looked at
before it is run. Here a file has the hash of its code before it, and is on disk before it has its
name; one that is not as it was written is deleted, and the function compiled anew.
"""

import contextlib
import hashlib
import os
import pickle
import tempfile
from pathlib import Path
from typing import Any

_DIGEST_BYTES = hashlib.sha256().digest_size


class CodeFiles:
    """The machine code of one function, a file for each kind of arguments.

    In the place of numba's `IndexDataCacheFile`, which has the same methods. `stamp` is of all that
    the code hangs on beside the arguments and the machine.
    """

    def __init__(self, folder: Path, name: str, stamp: object) -> None:
        self._folder, self._name, self._stamp = folder, name, stamp

    def load(self, key: object) -> Any:
        """The code for a kind of arguments; None where there is none, or none that is whole."""
        path = self._path(key)
        try:
            whole = path.read_bytes()
            digest, code = whole[:_DIGEST_BYTES], whole[_DIGEST_BYTES:]
            if hashlib.sha256(code).digest() == digest:
                return pickle.loads(code)
            path.unlink()
        except OSError:  # nobody has compiled it yet, mostly
            pass
        return None

    def save(self, key: object, data: object) -> None:
        """Keep the code for a kind of arguments; without room for it each process compiles."""
        from numba.core import serialize  # see `compiled`

        pack: Any = serialize.dumps  # of numba's own classes; it has no type
        code = pack(data)
        with contextlib.suppress(OSError):
            self._folder.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=self._folder, delete=False) as file:
                try:
                    file.write(hashlib.sha256(code).digest() + code)
                    file.flush()
                    os.fsync(file.fileno())
                    os.replace(file.name, self._path(key))
                except OSError:
                    os.unlink(file.name)
                    raise

    def _path(self, key: object) -> Path:
        kind = hashlib.sha256(repr((key, self._stamp)).encode()).hexdigest()[:16]
        return self._folder / f"{self._name}.{kind}.nbc"
