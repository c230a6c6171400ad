"""The motion models: how a body that walks, squats or jumps goes on to its next pose. VSMM step 3.

A model is X_{k+1} = F X_k + W_k in a frame that turns with the body: its vertical axis is the world's, its heading the
body's, its origin the root, so that it does not matter where somebody walks to. Lengths are counted in legs. The
models were fitted by `fit_motion.py`, which says how good they are.
"""

import json
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from importlib.resources import files
from typing import Any, Literal, get_args

import numpy as np

from posefit.arrays import Array, jit
from posefit.geometry.skeleton import BONES as SKELETON_BONES
from posefit.geometry.skeleton import Skeleton
from posefit_vsmm.state import Reliance, free_errors

FPS = 30.0  # the rate that the models were fitted at (Reading V6)
STIFF = 1e-3  # of the deviation of an axis that a joint may turn about: that of one that it may not
Shrink = Literal["identity", "zero"]  # what ridge regression draws F towards (Reading V5)


@dataclass(frozen=True, eq=False)
class MotionModel:
    """One model, for a body and a frame rate; a `posefit_vsmm.imm.Model`."""

    name: str
    matrix: Array = field(repr=False)  # (43, 40) F less the identity, of the quaternions
    offset: Array = field(repr=False)  # (43,)
    noise: Array = field(repr=False)  # (33, 33) covariance of W
    poses: Array = field(repr=False)  # (n, 40) quaternions of its typical poses, heading along +z
    leg: float = 1.0  # metres
    share: float = 1.0  # of the step at 30 frames a second

    def predict(self, state: Array, covariance: Array) -> tuple[Array, Array]:
        """Return the state (43,) one frame later, and the covariance (33, 33) of its error."""
        moved, jacobian = self.step(state)
        return moved, jacobian @ covariance @ jacobian.T + self.noise

    def step(self, state: Array) -> tuple[Array, Array]:
        """Return the state (43,) one frame later, and the Jacobian (33, 33) of its error by the error before."""
        moved, jacobian = _step(self.matrix, self.offset, self.share, self.leg, state)
        return moved, jacobian

    def nearest(self, state: Array) -> Array:
        """Return a state (43,) with its place and heading, in the typical pose that is nearest to it."""
        back, quaternions = headed(state[3:].reshape(-1, 4))
        alike = np.abs(np.einsum("nij,ij->ni", self.poses.reshape(len(self.poses), -1, 4), quaternions))
        pose = self.poses[np.arccos(np.minimum(alike, 1.0)).sum(axis=1).argmin()].copy()
        pose[:4] = product(back, pose[:4])
        return np.concatenate([state[:3], pose])

    def fitted_to(self, skeleton: Skeleton, fps: float) -> "MotionModel":
        """Return the model for a body's legs and another frame rate, of which a step is a share of a step at 30."""
        share = FPS / fps
        scale = np.maximum(free_errors(skeleton), STIFF)
        scale[:3] = leg_of(skeleton)
        noise = self.noise * np.outer(scale, scale) * share
        return MotionModel(self.name, self.matrix, self.offset, noise, self.poses, float(scale[0]), share)


@dataclass(frozen=True, eq=False)
class Library:
    """All models, and how the joints that a state does not hold follow it."""

    models: dict[str, MotionModel]
    reliance: Reliance
    report: dict[
        str, dict[str, float]
    ]  # degrees: one and ten steps on clips that were not used, against standing still

    @cached_property
    def names(self) -> tuple[str, ...]:
        """The models' names."""
        return tuple(self.models)


@lru_cache(maxsize=2)
def library(shrink: Shrink = "identity") -> Library:
    """Return the models that the package carries. Raises ValueError for an unknown `shrink`."""
    if shrink not in get_args(Shrink):
        raise ValueError(f"shrink must be one of {', '.join(get_args(Shrink))}, got {shrink!r}")
    stored: dict[str, Any] = json.loads((files("posefit_vsmm") / "models.json").read_text(encoding="utf-8"))
    models = {
        name: MotionModel(
            name,
            np.array(one[shrink]["matrix"]),
            np.array(one[shrink]["offset"]),
            np.array(one[shrink]["noise"]),
            np.array(one["poses"]),
        )
        for name, one in stored["models"].items()
    }
    reliance = Reliance(*(np.array(stored["reliance"][key]) for key in ("matrix", "offset")))
    return Library(models, reliance, {name: one["report"] for name, one in stored["models"].items()})


def leg_of(skeleton: Skeleton) -> float:
    """Return how long a leg is, in metres, from hip to ankle."""
    return float(skeleton.lengths[[SKELETON_BONES.index(bone) for bone in ("lfemur", "ltibia")]].sum())


def headed(quaternions: Array) -> tuple[Array, Array]:
    """Return the heading (4,) of quaternions (10, 4), and they without it, with w positive.

    The heading is the part of the first one that turns about the vertical.
    """
    back, found, _ = _headed(quaternions)
    return back, found


@jit
def product(first, second):
    """Return the product (4,) of two quaternions (4,)."""
    a, b, c, d = first
    e, f, g, h = second
    return np.array(
        [
            a * e - b * f - c * g - d * h,
            a * f + b * e + c * h - d * g,
            a * g - b * h + c * e + d * f,
            a * h + b * g - c * f + d * e,
        ]
    )


@jit
def _headed(quaternions):
    back = np.array([quaternions[0, 0], 0.0, quaternions[0, 2], 0.0])
    size = np.sqrt(back[0] ** 2 + back[2] ** 2)
    if size > 1e-9:
        back /= size
    else:
        back[0], back[2] = 1.0, 0.0
    found, signs = quaternions.copy(), np.ones(len(quaternions))
    found[0] = product(np.array([back[0], 0.0, -back[2], 0.0]), found[0])
    for j in range(len(found)):
        if found[j, 0] < 0.0:
            signs[j] = -1.0
            found[j] *= -1.0
    return back, found, signs


@jit
def _tangents(quaternions):
    """Return the change (4 n, 3 n) of quaternions (n, 4) by small rotations on their right."""
    n = len(quaternions)
    change = np.zeros((4 * n, 3 * n))
    for j in range(n):
        w, x, y, z = 0.5 * quaternions[j]
        r, c = 4 * j, 3 * j
        change[r, c], change[r, c + 1], change[r, c + 2] = -x, -y, -z
        change[r + 1, c], change[r + 1, c + 1], change[r + 1, c + 2] = w, -z, y
        change[r + 2, c], change[r + 2, c + 1], change[r + 2, c + 2] = z, w, -x
        change[r + 3, c], change[r + 3, c + 1], change[r + 3, c + 2] = -y, x, w
    return change


@jit
def _step(matrix, offset, share, leg, state):
    back, before, signs = _headed(state[3:].copy().reshape(-1, 4))
    change = share * (matrix @ before.ravel() + offset)
    n = len(before)
    sine, cosine = 2.0 * back[0] * back[2], back[0] ** 2 - back[2] ** 2
    turn = np.array([[cosine, 0.0, sine], [0.0, 1.0, 0.0], [-sine, 0.0, cosine]])
    after = before + change[3:].copy().reshape(n, 4)
    sizes = np.empty(n)
    for j in range(n):
        sizes[j] = np.sqrt((after[j] ** 2).sum())
        after[j] /= sizes[j]
    moved = np.empty(state.size)
    gone = leg * (turn @ change[:3].copy())
    moved[:3] = state[:3] + gone
    for j in range(n):
        moved[3 + 4 * j : 7 + 4 * j] = signs[j] * (product(back, after[0]) if j == 0 else after[j])
    w, x, _, z = before[0]
    by_heading = np.array([z / w, 1.0, -x / w])  # how the heading turns with an error of the whole body
    flow = _tangents(before)
    flow[:4, :3] -= 0.5 * np.outer(np.array([0.0, z, w, -x]), by_heading)  # what is headed has no part of it
    change_flow = share * (matrix @ flow)  # (43, 30)
    flow += change_flow[3:]
    for j in range(n):
        flow[4 * j : 4 * j + 4] /= sizes[j]
    w, x, y, z = after[0]
    flow[:4, :3] += 0.5 * np.outer(np.array([-y, z, w, -x]), by_heading)
    jacobian = np.eye(3 + 3 * n)
    jacobian[:3, 3:] = leg * (turn @ change_flow[:3].copy())
    jacobian[:3, 3:6] += np.outer(np.array([gone[2], 0.0, -gone[0]]), by_heading)
    jacobian[3:, 3:] = 4.0 * (_tangents(after).T.copy() @ flow)
    return moved, jacobian
