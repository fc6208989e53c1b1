"""A hash of code between tracks and pose: figures that two versions of it made are told apart."""

import ast
import hashlib
from collections.abc import Iterable, Sequence
from functools import cache
from modulefinder import ModuleFinder
from pathlib import Path

_ROOT = Path(__file__).parent.parent
# What makes figures; other studies only ask for them.
_MAKERS = ("models.", "studies.baselines.", "studies.base_model.", "studies.regressors.")
_WITH_DOCSTRING = ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef


def code_hash(modules: Sequence[str] = (), *, root: Path = _ROOT) -> str:
    """Twelve digits that change with the code that makes figures, not with other studies or words.

    Args:
        modules: whose code and imports are meant, with dots; all of models/ where there are none.
        root: of the folder `models`.
    """
    return _hash(tuple(modules), root)


@cache
def _hash(modules: Sequence[str], root: Path) -> str:
    digest = hashlib.sha256()
    for name, path in sorted(_reached(modules, root) if modules else _all(root)):
        if f"{name}.".startswith(_MAKERS):
            digest.update(name.encode() + b"\0" + _code(path).encode())
    return digest.hexdigest()[:12]


def _all(root: Path) -> Iterable[tuple[str, Path]]:
    for path in (root / "models").rglob("*.py"):
        place = path.relative_to(root).with_suffix("")
        yield ".".join(part for part in place.parts if part != "__init__"), path


def _reached(modules: Iterable[str], root: Path) -> Iterable[tuple[str, Path]]:
    """Modules that some modules import of the root, they themselves among them."""
    finder = ModuleFinder(path=[str(root)])
    for name in modules:
        finder.import_hook(name)
    files = {name: getattr(found, "__file__", None) for name, found in finder.modules.items()}
    return [(name, Path(file)) for name, file in files.items() if file]  # built-in ones have none


def _code(path: Path) -> str:
    """A file without comments, docstrings and layout."""
    tree = ast.parse(path.read_text())
    for node in ast.walk(tree):
        if isinstance(node, _WITH_DOCSTRING) and ast.get_docstring(node) is not None:
            del node.body[0]
    return ast.dump(tree)
