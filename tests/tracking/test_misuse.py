"""What a caller from Python or at the command line gets wrong is one clear line, and no option is ignored."""

from typing import Any

import numpy as np
import pytest

import posefit
from posefit import minimise
from posefit.footage.segmentation import Extraction
from posefit.registry import registry
from posefit.testing.toy import Toy, sphere
from tests.cases import each

MISUSES: list[tuple[dict[str, Any], str]] = [
    ({"evaluations": 1e3}, "evaluations must be a whole number of at least 1, got 1000.0"),
    ({"frames": 5}, r"frames must be \(start, stop\), either of which may be None, got 5"),
    ({"frames": (5, 2)}, "frames must choose some of the 60 frames, got 5:2"),
    ({"size": (320.5, 240)}, "size must be from 1x1 to 16384x16384 pixels, got 320.5x240"),
    ({"seed": None}, "seed must be a whole number of at least 0, got None"),
    ({"threads": True}, "threads must be a whole number of at least 1, got True"),
    ({"fps": 10**400}, "fps must be a finite number, got 1000"),
    ({"view_degrees": "front"}, "view_degrees must be a finite number, got 'front'"),
    ({"train": "walk-a"}, "train must be a list of motions, got 'walk-a'"),
    ({"view_degrees": 361}, "view_degrees must lie in -360 to 360 degrees, got 361"),
    ({"force": True}, "force must be given with out, the folder of the track, got none"),
    ({"settings": ("sapso.cooling=0.9", "sapso.cooling=0.8")}, "must be given once, got 'sapso.cooling' twice"),
    ({"asf": "a.asf"}, "asf must be given for .amc files and footage only, got 'a.asf'"),
    ({"extraction": Extraction()}, "extraction must be given for video only, got Extraction.* for a motion"),
    ({"up": "y"}, "up must be given for .amc and .bvh files only, got 'y'"),
    ({"unit": "cm"}, "unit must be given for .amc and .bvh files only, got 'cm'"),
    ({"unit": "ell"}, "unit must be one of m, cm, mm, inch, foot, cmu, got 'ell'"),
    ({"rate": 50.0}, "rate must be given for .amc files only, got 50.0"),
    ({"evaluations": 30, "method": "sapso"}, "evaluations must hold one population of 40, got 30"),
    ({"method": "sapzo"}, "method must be OPTIMISER@PRIOR, or one of .*, got 'sapzo'; did you mean 'sapso'"),
    ({"method": "sapzo@pca"}, "optimiser must be one of .*did you mean 'sapso'"),
    (
        {"method": "@pcb"},
        "prior must be one of full, gplvm, isomap, loose, pca, sklearn, got 'pcb'; did you mean 'pca'",
    ),
    ({"method": 3}, "method must be a name, a factory, or a pair of optimiser and prior, got 3"),
    ({"first_pose": "mine"}, "first_pose must be one of searched, given, got 'mine'"),
    ({"settings": {"sapso.coling": 1.0}}, "a setting of sapso must be one of .*did you mean 'cooling'"),
    ({"settings": {"pca.components": "six"}}, "pca.components must be float, got 'six'"),
    ({"settings": {"tracker.flor": 1.0}}, "a setting of tracker must be one of .*did you mean 'floor'"),
    ({"settings": {"tracker.relocalise_gap": -1}}, "relocalise_gap must be 0 or more, got -1"),
    ({"settings": {"tracker.tilt": "upright"}}, r"tilt must be learned \| box \| none, got 'upright'"),
    ({"settings": {"tracker.beta": 1.5}}, "beta must lie in 0 to 1, got 1.5"),
    ({"settings": {"tracker.root_range_degrees": (9.0, -15.0, 9.0)}}, "root_range_degrees must be at least 0, got -15"),
    ({"settings": {"tracker.start": "nowhere"}}, "start must be one of blind, lookup, got 'nowhere'"),
    ({"method": "exemplars"}, "evaluations must be at least 715 for exemplars, got 80"),
    ({"method": "exemplars", "settings": {"spread": 0.0}}, "spread must be above 0, got 0"),
    ({"method": "exemplars", "settings": {"temperature": np.nan}}, "temperature must be above 0, got nan"),
    ({"method": "exemplars", "settings": {"lag": -1}}, "lag must be at least 0, got -1"),
    ({"method": "vsmm", "settings": {"structure": "some"}}, "structure must be"),
    ({"method": "vsmm", "settings": {"joint_noise": 0.0}}, "joint_noise must be above 0, got 0"),
    ({"method": "vsmm:letter"}, "variant must be one of default, patent, got 'letter'"),
    ({"hypotheses": 0}, "hypotheses must be .* got 0"),
    ({"restarts": -1}, "restarts must be 0 or more, got -1"),
]


def test_a_misuse_of_track_is_one_clear_error() -> None:
    for given, message in MISUSES:
        with pytest.raises(ValueError, match=message):
            posefit.track("walk", **{"evaluations": 80, "frames": (0, 2), **given})


@each("name", ["sapso", "annealed", "particle"])
def test_a_search_that_ends_long_before_its_budget_says_so(name: str) -> None:
    optimiser = registry().optimiser(name)(Toy(9), np.random.default_rng(0))
    with pytest.warns(UserWarning, match="ended its search after 24.. of 100000 evaluations: .* build it with it"):
        minimise(sphere, optimiser, 100_000)
