"""Each loop is compiled once: arrays of another kind, read-only ones say, would be waited for."""

import importlib
import pkgutil
from dataclasses import replace

import numpy as np

import models.tracks
import models.walking
from models.pose.change_point import find_change
from models.simulation.walkers import WalkConfig
from models.tracks.observations import of_tracks
from models.tracks.trajectory import by_end
from models.walking.estimate import joint_estimate
from models.walking.reference_learning import learn_speed_reference
from tests.models.sites import KNOCKED, PRIOR, seen, tracks_of


def test_learning_an_estimate_and_a_change_ask_for_one_kind_of_arrays():
    known, after = tracks_of(3, (PRIOR, 40), (KNOCKED, 30), boxes=True)
    reference = learn_speed_reference(seen(known), PRIOR, WalkConfig(), 0)
    window = seen(by_end(after))
    joint_estimate(window, PRIOR, reference)
    find_change(window, PRIOR, reference)
    joint_estimate(of_tracks(window, np.empty(0, dtype=np.int64)), PRIOR, reference)
    by_columns = [replace(track, uv=np.asfortranarray(track.uv)) for track in after]
    seen(by_columns)
    compiled = {}
    names = [
        module.name
        for package in (models.tracks, models.walking)
        for module in pkgutil.walk_packages(package.__path__, f"{package.__name__}.")
    ]
    for name in names:
        for key, function in vars(importlib.import_module(name)).items():
            if hasattr(function, "signatures") and function.__module__ == name:
                compiled[key] = len(function.signatures)
    assert len(compiled) > 10
    assert set(compiled.values()) <= {0, 1}, compiled  # 0: kept within another
