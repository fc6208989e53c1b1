"""A street, and one whose reference is learned."""

import pytest

from tests.conftest import CAMERA
from tests.service.street import PRIOR, Street

WANTED = 60


@pytest.fixture
def street(http, settings):
    http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
    return Street(http, settings)


@pytest.fixture
def known(learned):
    """A street whose reference is learned."""

    def make(http, settings):
        http.post("/cameras", json={**CAMERA, "reference_tracks": WANTED}).raise_for_status()
        street = Street(http, settings)
        street.walk(PRIOR, WANTED)
        assert street.look()["reference"]["state"] == "ready"
        return street

    return learned("site", make)
