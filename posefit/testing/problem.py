"""A small real problem for the checks: one frame of the built-in walk."""

from functools import lru_cache

import numpy as np

from posefit.arrays import Array
from posefit.fitting.cost import SilhouetteCost
from posefit.fitting.prior import Components
from posefit.fitting.problem import Problem
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette

SIZE = (160, 120)
COMPONENTS = 6  # m of the SAPSO paper, section 2.1


def walking_angles() -> Array:
    """Return the joint angles (T, 63) of the built-in walks other than `walk`."""
    angles = []
    for style in built_in.other_styles("walk"):
        angles.append(built_in.motion(style).poses[:, 3:])
    return np.concatenate(angles)


def principal(angles: Array) -> Components:
    """Return the principal components of joint angles (T, 63), and their range.

    With these, the checks need no plugin's prior.
    """
    mean = angles.mean(axis=0)
    _, _, directions = np.linalg.svd(angles - mean, full_matrices=False)
    components = directions[:COMPONENTS]
    latents = (angles - mean) @ components.T
    return Components(mean, components, latents.min(axis=0), latents.max(axis=0))


def pose_problem(budget: int | None = None) -> Problem:
    """Return the problem: known translation, six components, seen from 45 degrees."""
    cost = _pose_cost()
    return Problem(cost, cost.space, budget)


@lru_cache(maxsize=1)
def _pose_cost() -> SilhouetteCost:
    motion = built_in.motion("walk", frames=1)
    body = Body.of(motion.skeleton)
    prior = principal(walking_angles())
    camera = Camera.around(motion.translations[0], 0.8, 3.5, SIZE)
    space = SearchSpace(
        prior, np.zeros(3), np.radians([45.0, 15.0, 15.0]), motion.translations[0]
    )
    silhouette = Silhouette.of(
        project(body, camera, motion.poses[0], motion.translations[0])
    )
    return SilhouetteCost(body, [camera], [silhouette], space)
