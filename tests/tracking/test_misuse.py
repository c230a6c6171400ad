"""What a caller from Python or at the command line gets wrong is one clear line, and no option is ignored."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import posefit
from posefit import Camera, PoseProblem, SearchSpace, Silhouette, minimise
from posefit.fitting.tracker import Prediction
from posefit.footage.segmentation import Extraction
from posefit.geometry.body import Body
from posefit.motion import built_in
from posefit.registry import registry
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
    ({"hypotheses": 0}, "hypotheses must be .* got 0"),
    ({"restarts": -1}, "restarts must be 0 or more, got -1"),
]


def test_a_misuse_of_track_is_one_clear_error() -> None:
    for given, message in MISUSES:
        with pytest.raises(ValueError, match=message):
            posefit.track("walk", **{"evaluations": 80, "frames": (0, 2), **given})


@pytest.fixture(scope="module")
def problem() -> PoseProblem:
    motion = built_in.motion("walk", frames=1)
    body = Body.of(motion.skeleton)
    angles = np.concatenate([built_in.motion(name).poses[:, 3:] for name in built_in.other_styles("walk")])
    prior = registry().prior("pca")().fit(angles, motion.skeleton)
    camera = Camera.around(motion.translations[0], 0.8, 3.5, (64, 48))
    mask = posefit.silhouette.cost.project(body, camera, motion.poses[0], motion.translations[0])
    space = SearchSpace(prior, np.zeros(3), np.radians([45.0, 15.0, 15.0]), motion.translations[0])
    return PoseProblem(body, [camera], [Silhouette.of(mask)], space)


def test_a_misuse_of_a_class_or_a_function_is_one_clear_error(problem: PoseProblem) -> None:
    space, empty = problem.space, Silhouette.of(np.zeros((48, 64), dtype=bool))
    optimiser = registry().optimiser("random")(space, np.random.default_rng(0), population_size=40)
    for call, message in (
        (lambda: Camera.around(np.zeros(3), 0.0, -1.0, (64, 48)), "distance must be 0 or more metres, got -1.0"),
        (
            lambda: Camera.around(np.zeros(3), 0.0, 3.0, (64, 48), 4.0),
            "field_of_view must lie between 0 and pi radians, got 4.0",
        ),
        (
            lambda: SearchSpace(space.prior, np.zeros(3), -np.ones(3), space.anchor),
            r"root_range must be 3 numbers of 0 or more, got \[-1.0, -1.0, -1.0\]",
        ),
        (
            lambda: replace(space, translation_range=np.full(3, -0.5)),
            "translation_range must be 3 numbers of 0 or more",
        ),
        (
            lambda: Prediction(root_range_degrees=(45.0, -15.0, 15.0)),
            "root_range_degrees must be at least 0, got -15",
        ),
        (
            lambda: PoseProblem(problem.body, problem.cameras, [empty], space),
            "silhouettes must show a person, got an empty mask",
        ),
        (
            lambda: minimise(lambda proposals: problem.evaluate(proposals)[:-1], optimiser, 400),
            r"evaluate must return an array of costs of shape \(40,\), got shape \(39,\)",
        ),
        (
            lambda: minimise(lambda proposals: problem.evaluate(proposals).tolist(), optimiser, 400),
            r"evaluate must return an array of costs of shape \(40,\), got list",
        ),
    ):
        with pytest.raises((ValueError, TypeError), match=message):
            call()


@each("name", ["sapso", "annealed", "particle"])
def test_a_search_that_ends_long_before_its_budget_says_so(problem: PoseProblem, name: str) -> None:
    factory = registry().optimiser(name)
    with pytest.warns(UserWarning, match="ended its search after 24.. of 100000 evaluations: .* build it with it"):
        minimise(problem.evaluate, factory(problem.space, np.random.default_rng(0)), 100_000)
