"""A receiver of webhooks."""

import pytest

from tests.service.notifications.receiver import receiver


@pytest.fixture
def inbox():
    with receiver() as found:
        yield found
