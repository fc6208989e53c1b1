"""Reads one calibration file from stdin and writes its numbers to stdout, as JSON.

A process of its own, see `confined`: `python -m service.formats.calibration_reader CPU_S CAMERA`.
"""

import io
import json
import sys
from dataclasses import asdict
from typing import Any

import numpy as np

from models.errors import CalibrationError
from service.formats.confined import give_up_rights
from surefoot.calibration.documents import MAX_BYTES
from surefoot.calibration.reader import read_calibration_file

# One from straight above, and a lens of eight coefficients.
_MATRIX = b"[100, 0, 50, 0, 100, 50, 0, 0, 1]"
_SENSOR = (
    b'{"sensors": [{"id": "a", "intrinsicMatrix": ' + _MATRIX + b', "homography": '
    b"[100, 0, 50, 0, -100, 50, 0, 0, 1]}]}"
)
_RATIONAL = b'{"K": ' + _MATRIX + b', "D": [0, 0, 0, 0, 0, 0.01, 0, 0]}'


def main() -> None:
    """Answer for the file on stdin: its calibration, or `{"rejected": why}`."""
    body = sys.stdin.buffer.read(MAX_BYTES + 1)
    _load_all()
    give_up_rights(int(sys.argv[1]))
    answer: dict[str, Any]
    try:
        answer = asdict(read_calibration_file(body, sys.argv[2] or None))
    except CalibrationError as error:
        answer = {"rejected": str(error)}
    sys.stdout.write(json.dumps(answer))


def _load_all() -> None:
    """Import what the parsers and the numerics need, while files can still be opened."""
    packed = io.BytesIO()
    np.savez_compressed(packed, mtx=np.eye(3))
    for small in (packed.getvalue(), b"<K>1 0 0 0 1 0 0 0 1</K>", _SENSOR, _RATIONAL):
        read_calibration_file(small)


if __name__ == "__main__":
    main()
