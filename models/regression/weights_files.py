"""Where weights lie. Imports no torch: backups and the HTTP process name such files too."""

from pathlib import Path


def weights_path(folder: Path, digest: str) -> Path:
    """The file in a folder for weights with this SHA-256."""
    return folder / f"{digest}.safetensors"
