"""The cache of sites in a worker is bounded in bytes and follows the map."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np

from service.estimation import site_cache
from service.estimation.site_cache import SiteCache, array_bytes
from service.store.monitor_states import Inputs


@dataclass
class Basis:
    arrays: tuple[np.ndarray, ...]


def test_site_cache_drops_the_site_that_was_used_longest_ago(monkeypatch):
    read = []

    def read_one(_session, camera, _reference):
        read.append(camera.id)
        return Basis(arrays=(np.zeros(64), np.zeros(64)))

    monkeypatch.setattr(site_cache, "_read", read_one)
    assert array_bytes(read_one(None, SimpleNamespace(id="x"), None)) == 1024
    cache = SiteCache(most_bytes=2500)  # two of them
    reference = SimpleNamespace(id=1, prior_pose_id=1)

    def use(camera_id, learned_at="monday"):
        camera = SimpleNamespace(id=camera_id, intrinsics=None)
        inputs = Inputs(learned_at, None, None, 0)
        return cache.basis_of(None, camera, reference, inputs)

    read.clear()
    first = use("a")
    assert use("b") is not first
    assert use("a") is first
    use("c")
    assert read == ["a", "b", "c"]
    assert use("a") is first
    use("b")
    assert read == ["a", "b", "c", "b"]
    assert use("b", "tuesday") is not use("b")  # the map has grown
