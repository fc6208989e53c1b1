"""Studies that train, or start processes, are run nightly: nothing that serves hangs on them."""

from pathlib import Path

import pytest

_HERE = Path(__file__).parent


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if item.path.is_relative_to(_HERE) and item.get_closest_marker("slow"):
            item.add_marker(pytest.mark.nightly)
