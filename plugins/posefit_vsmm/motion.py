"""The motion models: how a body that walks, squats or jumps goes on to its next pose. VSMM step 3.

A model is X_{k+1} = F X_k + W_k in a frame that turns with the body: its vertical axis is the world's, its heading the
body's, its origin the root, so that places and directions do not matter. Lengths are counted in legs. `ridge` fits
them; the models that the package carries are fitted to CMU clips by docs/studies/make_models.py.
"""

import json
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.skeleton import BONES as SKELETON_BONES
from posefit.geometry.skeleton import Skeleton
from posefit.reading import parsed_json, read_text
from posefit_vsmm import kernels
from posefit_vsmm.settings import Poses, Shrink
from posefit_vsmm.state import ERROR, STATE, Reliance, free_errors

FPS = 30.0  # the rate that the models were fitted at (Interpretation V6)
SIZE_LIMIT = 10_000_000  # bytes of a file of models
CLIP_FPS = 120.0  # the rate of the clips that they were fitted to
LAMBDA = 0.15
STIFF = 1e-3  # of the deviation of an axis that a joint may turn about: that of one that it may not


@dataclass(frozen=True, eq=False)
class MotionModel:
    """One model, for a body and a frame rate; a `posefit_vsmm.imm.Model`."""

    name: str
    matrix: Array = field(repr=False)  # (43, 40) F less the identity, of the quaternions
    offset: Array = field(repr=False)  # (43,)
    noise: Array = field(repr=False)  # (33, 33) covariance of W
    poses: Array = field(repr=False)  # (n, 40) quaternions of its typical poses, heading along +z
    captured: Array = field(repr=False)  # (n, 40) those of poses that it was fitted to
    leg: float = 1.0  # metres
    share: float = 1.0  # of the step at 30 frames a second

    def predict(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the state (43,) one frame later, and the covariance (33, 33) of its error."""
        moved, jacobian = self.step(state)
        return moved, jacobian @ covariance @ jacobian.T + self.noise

    def step(self, state: Array) -> tuple[Array, Array]:
        """Return the state (43,) one frame later, and the Jacobian (33, 33) of its error by the error before."""
        moved, jacobian = np.empty(STATE), np.zeros((ERROR, ERROR))
        count = (STATE - 3) // 4
        scratch = np.empty(count), np.empty(4 * count), np.empty(4 * count), np.empty((4 * count, 3))
        flow = np.empty((STATE, ERROR - 3))
        kernels.step(self.matrix, self.offset, self.share, self.leg, state, *scratch, flow, moved, jacobian)
        return moved, jacobian

    def nearest(self, state: Array, among: Poses = "typical") -> Array:
        """Return a state (43,) with its place and heading, in the pose nearest to it. Interpretation V16."""
        heading, quaternions = without_heading(state)
        poses = self.poses if among == "typical" else self.captured
        similarity = np.abs(np.einsum("nij,ij->ni", poses.reshape(len(poses), -1, 4), quaternions))
        pose = poses[np.arccos(np.minimum(similarity, 1.0)).sum(axis=1).argmin()].copy()
        pose[:4] = turned(pose[:4], *heading)
        same_sign = np.where((pose * state[3:]).reshape(-1, 4).sum(axis=1) < 0.0, -1.0, 1.0)
        return unit(np.concatenate([state[:3], pose * np.repeat(same_sign, 4)]))

    def fitted_to(self, skeleton: Skeleton, fps: float) -> "MotionModel":
        """Return the model for a body's legs and another frame rate, of which a step is a share of a step at 30."""
        share = FPS / fps
        scale = np.maximum(free_errors(skeleton), STIFF)
        scale[:3] = leg_of(skeleton)
        noise = self.noise * np.outer(scale, scale) * share
        return replace(self, noise=noise, leg=float(scale[0]), share=share)


@dataclass(frozen=True, eq=False)
class VectorModel:
    """A model of states of 43 numbers, which it brings to unit length before a step. Interpretation V4."""

    model: MotionModel

    def predict(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the state (43,) one frame later, and the covariance (43, 43) of its error."""
        before = unit(state)
        moved, jacobian = self.model.step(before)
        flow = jacobian @ inverse_tangent(before)
        return moved, lifted(moved, flow @ covariance @ flow.T + self.model.noise)


def unit(state: Array) -> Array:
    """Return a state (43,) whose quaternions have length 1."""
    quaternions = state[3:].reshape(-1, 4)
    return np.concatenate([state[:3], (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).ravel()])


def tangent(state: Array) -> Array:
    """Return how the numbers of a state (43,) change with its error: (43, 33)."""
    from scipy.linalg import block_diag  # a fifth of a second to import

    change = np.empty((STATE - 3, 3))
    kernels.tangents(state[3:], change)
    return np.asarray(block_diag(np.eye(3), *change.reshape(-1, 4, 3)))


def inverse_tangent(state: Array) -> Array:
    """Return how the error of a state (43,) changes with its numbers: (33, 43)."""
    return np.asarray(tangent(state).T * np.repeat([1.0, 4.0], [3, STATE - 3]))


def lifted(state: Array, covariance: Array) -> Array:
    """Return the covariance (43, 43) of a state's numbers, of that of its error (33, 33)."""
    matrix = tangent(state)
    return np.asarray(matrix @ covariance @ matrix.T + 1e-9 * np.eye(STATE))


@dataclass(frozen=True, eq=False)
class Library:
    """All models, and how the joints that a state does not hold follow it."""

    models: dict[str, MotionModel]
    reliance: Reliance
    # degrees: one and ten steps on clips that were not used, against standing still
    report: dict[str, dict[str, float]]


@lru_cache(maxsize=2)
def library(shrink: Shrink = "identity", path: str = "") -> Library:
    """Return the models of a file that docs/studies/make_models.py wrote; without one, those that the package carries.

    Raises ValueError naming the file where it holds no such models.
    """
    if not path:
        return _library(json.loads((files("posefit_vsmm") / "models.json").read_text("utf-8")), shrink)
    try:
        return _library(parsed_json(read_text(path, SIZE_LIMIT)), shrink)
    except (FileNotFoundError, LookupError, TypeError, ValueError) as error:
        raise InputError(f"{path}: expected motion models as make_models.py writes them, got {error!r}") from None


def _library(stored: dict[str, Any], shrink: Shrink) -> Library:
    models = {
        name: MotionModel(
            name,
            np.array(one[shrink]["matrix"]),
            np.array(one[shrink]["offset"]),
            np.array(one[shrink]["noise"]),
            np.array(one["poses"]),
            np.array([unit(np.concatenate([np.zeros(3), pose]))[3:] for pose in one["captured"]]),
        )
        for name, one in stored["models"].items()
    }
    reliance = Reliance(*(np.array(stored["reliance"][key]) for key in ("matrix", "offset")))
    return Library(models, reliance, {name: one["report"] for name, one in stored["models"].items()})


def ridge(inputs: Array, outputs: Array, weight: float = LAMBDA) -> Array:
    """Return F (m, k): the one of least |F x - y|^2 + weight |F|^2 over inputs x (n, k) and outputs y (n, m)."""
    normal = inputs.T @ inputs + weight * np.eye(inputs.shape[1])  # VSMM 3
    return np.asarray(np.linalg.solve(normal, inputs.T @ outputs).T)


def leg_of(skeleton: Skeleton) -> float:
    """Return how long a leg is, in metres, from hip to ankle."""
    return float(skeleton.lengths[[SKELETON_BONES.index(bone) for bone in ("lfemur", "ltibia")]].sum())


def without_heading(state: Array) -> tuple[tuple[float, float], Array]:
    """Return the heading (w, y) of a state (43,), and its quaternions (10, 4) without it, with w positive.

    The heading is the part of the first one that turns about the vertical.
    """
    quaternions = np.empty((len(state) // 4, 4))
    return kernels.headed(state, quaternions.reshape(-1), np.empty(len(quaternions))), quaternions


def turned(quaternion: Array, w: float, y: float) -> Array:
    """Return a quaternion (4,) turned about the vertical by another one, (w, 0, y, 0)."""
    a, b, c, d = quaternion.tolist()
    return np.array([w * a - y * c, w * b + y * d, w * c + y * a, w * d - y * b])
