"""Place of the weights' files. Imports no torch: backups and the HTTP process name them too."""

from pathlib import Path


def weights_path(folder: Path, digest: str) -> Path:
    """The file in a folder for weights with this SHA-256."""
    return folder / f"{digest}.safetensors"
