from pathlib import Path

import pytest

from tests.stores.databases import only_sqlite

_OF_FILES = {
    "test_backup.py": "backs up the file",
    "test_check.py": "looks over the file",
    "test_prepared.py": "runs statements on the file's driver",
    "test_small_disk.py": "fills the disk of the file",
}


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.parent == Path(__file__).parent and item.path.name in _OF_FILES:
            item.add_marker(only_sqlite(_OF_FILES[item.path.name]))
