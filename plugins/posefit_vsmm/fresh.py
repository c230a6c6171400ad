"""A pose from one frame alone: the typical pose that matches best, and the best of some draws around it. VSMM 8.3."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.fitting.alignment import align
from posefit.fitting.tracker import Observation, Task
from posefit.silhouette.cost import areas, mismatch
from posefit_imm.kernels import minus, plus
from posefit_imm.quaternions import product
from posefit_vsmm.motion import MotionModel
from posefit_vsmm.state import ERROR, Reliance, decode, encode, free_errors

NEAR = np.radians([-30.0, -15.0, 0.0, 15.0, 30.0])  # yaws that are tried where one is about known
ALL_AROUND = np.linspace(-np.pi, np.pi, 12, endpoint=False)
SHARE = 0.6  # of the budget: what the typical poses may have
ROUND = 40  # draws around the best so far
USUAL = np.radians(15.0)  # as far from a typical pose, a quaternion costs 1 of 100, as much as 1 % of the silhouette
SPREADS = np.radians([20.0, 12.0, 7.0, 4.0])  # of the draws, one a round, the last one for the rest


class Matcher:
    """Compares states with one observation."""

    def __init__(self, task: Task, observation: Observation, reliance: Reliance) -> None:
        self._task, self._observation, self._reliance = task, observation, reliance
        self.free = free_errors(task.body.skeleton)
        self.evaluations = 0

    def costs(self, states: Array) -> tuple[Array, Array]:
        """Return the costs (n,) of states (n, 43), and the states, moved to where their silhouettes fit."""
        task, seen = self._task, self._observation
        poses, places = decode(states, self._reliance)
        if seen.translation is not None:
            places[:] = seen.translation
        else:
            places = align(task.body, task.cameras, seen.silhouettes, poses, places)
        costs = np.mean(
            [
                mismatch(areas(task.body, camera, silhouette, poses, places, task.threads))
                for camera, silhouette in zip(task.cameras, seen.silhouettes, strict=True)
            ],
            axis=0,
        )
        self.evaluations += len(states)
        return costs, np.column_stack([places, states[:, 3:]])


def estimated(
    matcher: Matcher,
    models: Sequence[MotionModel],
    yaw: float | None,
    anchor: Array,
    given: Array | None,
    budget: int,
    rng: np.random.Generator,
) -> Array:
    """Return the state (43,) that fits an observation best, for at most so many evaluations.

    `yaw` is about where the person faces, None for anywhere; `given` a pose (66,) that somebody knows, if anybody.
    """
    yaws = ALL_AROUND if yaw is None else yaw + NEAR
    typical = np.concatenate([model.poses for model in models])
    states = np.array([_placed(pose, float(one), anchor) for one in yaws for pose in typical])
    room = max(1, min(len(states), int(SHARE * budget)) - (given is not None))
    states = states[np.linspace(0, len(states) - 1, room).astype(np.int64)]
    if given is not None:
        states = np.concatenate([encode(given[None], anchor[None]), states])
    costs, states = matcher.costs(states)
    best, least = states[costs.argmin()], float(costs.min())
    home = best
    left, turn = budget - len(states), 0
    while left >= ROUND:
        errors = rng.normal(0.0, SPREADS[min(turn, len(SPREADS) - 1)], (ROUND, ERROR))
        errors[:, :3] = 0.0
        errors *= matcher.free
        costs, states = matcher.costs(np.array([plus(best, error) for error in errors]))
        costs = costs + np.array([_doubt(state, home) for state in states])
        if costs.min() < least:
            best, least = states[costs.argmin()], float(costs.min())
        left, turn = left - ROUND, turn + 1
    return np.asarray(best)


def _doubt(state: Array, home: Array) -> float:
    """Return what a state costs beside its silhouette for being another pose than the typical one."""
    return float(((minus(state, home)[3:] / USUAL) ** 2).sum())


def _placed(pose: Array, yaw: float, anchor: Array) -> Array:
    """Return the state of a typical pose (40,) that faces a way and stands somewhere."""
    turned = pose.copy()
    turned[:4] = product(np.array([np.cos(0.5 * yaw), 0.0, np.sin(0.5 * yaw), 0.0]), pose[:4])
    return np.concatenate([anchor, turned])
