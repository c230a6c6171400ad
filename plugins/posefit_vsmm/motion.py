"""The motion models, which predict the next pose of a person. VSMM step 3.

A model is X_{k+1} = F X_k + W_k in coordinates that turn with the body: the vertical
axis is the world's, the heading the body's and the origin the root, so that positions
and directions do not matter. Lengths are in leg lengths. `ridge` fits a model;
docs/studies/make_models.py fitted the models of the package to CMU clips.
"""

import json
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from importlib.resources import files
from typing import Any, Literal, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import BONES as SKELETON_BONES
from posefit.geometry.skeleton import Skeleton
from posefit_vsmm.state import (
    STATE,
    TURNS,
    DependentJoints,
    differentiate,
    free_errors,
    inverse_tangents,
    joined_state,
    lengths,
    product,
    quaternions_of,
    tangents,
    unit,
)

FPS = 30.0  # the rate that the models were fitted at (Interpretation V6)
CLIP_FPS = 120.0  # the rate of the clips that they were fitted to
LAMBDA = 0.15
# The standard deviation about an axis that a joint cannot turn about, as a share of the
# deviation about the others.
STIFF = 1e-3


@dataclass(frozen=True, eq=False)
class MotionModels:
    """Motion models, one per row (r), for a body and a frame rate."""

    names: tuple[str, ...]
    # (r, 43, 40) F minus the identity, applied to the quaternions
    matrices: Array = field(repr=False)
    offsets: Array = field(repr=False)  # (r, 43)
    noises: Array = field(repr=False)  # (r, 33, 33) covariance of W
    # (r, n, 40) quaternions of typical poses, heading along +z
    poses: Array = field(repr=False)
    # (r, n, 40) quaternions of poses that the model was fitted to
    captured: Array = field(repr=False)
    leg: float = 1.0  # metres
    share: float = 1.0  # of the step at 30 frames a second

    def of(self, names: Sequence[str]) -> "MotionModels":
        """Return some of the models."""
        rows = [self.names.index(name) for name in names]
        return replace(
            self,
            names=tuple(names),
            matrices=self.matrices[rows],
            offsets=self.offsets[rows],
            noises=self.noises[rows],
            poses=self.poses[rows],
            captured=self.captured[rows],
        )

    def fitted_to(
        self, skeleton: Skeleton, fps: float, process_noise: float = 1.0
    ) -> "MotionModels":
        """Return the models for a body's leg length and for another frame rate.

        A step at `fps` frames a second is 30 / `fps` of a step at 30.
        """
        leg = leg_of(skeleton)
        share = FPS / fps
        scale = np.maximum(free_errors(skeleton), STIFF)
        scale[:3] = leg
        # Interpretation V7
        noises = process_noise * share * self.noises * np.outer(scale, scale)
        return replace(self, noises=noises, leg=leg, share=share)

    def predict(self, states: Array, covariances: Array) -> tuple[Array, Array]:
        """Return the states (r, 43) one frame later, and their errors' covariances."""
        moved, changes = differentiate(self.step, states)
        jacobians = inverse_tangents(moved) @ changes
        return moved, jacobians @ covariances @ jacobians.swapaxes(1, 2) + self.noises

    def predict_numbers(self, states: Array, covariances: Array) -> tuple[Array, Array]:
        """Predict with covariances (r, 43, 43) of the numbers. Interpretation V4."""
        before = unit(states)
        changes = inverse_tangents(before)
        moved, after = self.predict(
            before, changes @ covariances @ changes.swapaxes(1, 2)
        )
        return moved, lifted(moved, after)

    def step(self, states: Array) -> Array:
        """Return the states (r, n, 43) one frame later, n for each model.

        F is applied to the states without their headings.
        """
        headings, before = without_heading(states)
        # q and -q are the same rotation; F was fitted to quaternions with w above 0
        signs = np.where(before[..., :1] < 0.0, -1.0, 1.0)
        inputs = (signs * before).reshape(*states.shape[:-1], -1)
        change = self.share * (
            inputs @ self.matrices.swapaxes(1, 2) + self.offsets[:, None]
        )
        after = before + signs * quaternions_of(change)
        after /= lengths(after)
        after[..., 0, :] = product(headings, after[..., 0, :])
        w = headings[..., 0]
        y = headings[..., 2]
        sine = 2.0 * w * y
        cosine = w * w - y * y
        # from the body's heading to the world's axes
        side, up, ahead = self.leg * np.moveaxis(change[..., :3], -1, 0)
        way = np.stack(
            [cosine * side + sine * ahead, up, cosine * ahead - sine * side], axis=-1
        )
        return joined_state(states[..., :3] + way, after)

    def typical_states(self, yaws: Array, place: Array) -> Array:
        """Return the states (n, 43) of all typical poses at a place (3,), all yaws."""
        halves = np.stack([np.cos(0.5 * yaws), np.sin(0.5 * yaws)], axis=1)
        headings = halves @ np.eye(4)[[0, 2]]  # quaternions about the vertical
        turns = np.tile(self.poses.reshape(-1, TURNS, 4), (len(yaws), 1, 1, 1))
        turns[:, :, 0] = product(headings[:, None], turns[:, :, 0])
        return joined_state(
            np.tile(place, (turns.shape[0] * turns.shape[1], 1)),
            turns.reshape(-1, TURNS, 4),
        )

    def captured_nearest(self, name: str, state: Array) -> Array:
        """Return a state (43,) in the nearest captured pose of a model.

        Its position and heading are not changed.
        """
        poses = self.captured[self.names.index(name)].reshape(-1, TURNS, 4)
        heading, turns = without_heading(state)
        similarity = np.abs(np.einsum("nij,ij->ni", poses, turns))
        distances = np.arccos(np.minimum(similarity, 1.0)).sum(axis=1)  # (n,)
        pose = poses[distances.argmin()].copy()
        pose[0] = product(heading, pose[0])
        cosines = (pose * quaternions_of(state)).sum(axis=1, keepdims=True)
        signs = np.where(cosines < 0.0, -1.0, 1.0)
        return unit(joined_state(state[:3], signs * pose))


def without_heading(states: Array) -> tuple[Array, Array]:
    """Split the headings (..., 4), twists about the vertical, off states (..., 43).

    Returns:
        The headings, and the states' quaternions (..., 10, 4) without them.
    """
    turns = quaternions_of(states).copy()
    headings = turns[..., 0, :] * [1.0, 0.0, 1.0, 0.0]
    sizes = lengths(headings)
    headings = np.where(
        sizes > 1e-9, headings / np.maximum(sizes, 1e-9), [1.0, 0.0, 0.0, 0.0]
    )
    turns[..., 0, :] = product(headings * [1.0, 1.0, -1.0, 1.0], turns[..., 0, :])
    return headings, turns


def lifted(states: Array, covariances: Array) -> Array:
    """Return the covariances (r, 43, 43) of the numbers of states (r, 43).

    They are made from the covariances (r, 33, 33) of the states' errors.
    """
    changes = tangents(states)
    numbers = changes @ covariances @ changes.swapaxes(1, 2)
    # without this they would be singular: the numbers have ten more dimensions
    return np.asarray(numbers + 1e-9 * np.eye(STATE))


class Library(NamedTuple):
    """All models, and the joints that depend on a state."""

    models: MotionModels
    dependent: DependentJoints


@lru_cache(maxsize=2)
def library(shrunk_to: Literal["identity", "zero"] = "identity") -> Library:
    """Return the models in the package, which docs/studies/make_models.py wrote.

    The patent's models were shrunk to zero. Interpretation V5.
    """
    stored = json.loads((files("posefit_vsmm") / "models.json").read_text("utf-8"))
    models: dict[str, Any] = stored["models"]
    matrices = []
    offsets = []
    noises = []
    poses = []
    captured_poses = []
    for model in models.values():
        fit = model[shrunk_to]
        matrices.append(fit["matrix"])
        offsets.append(fit["offset"])
        noises.append(fit["noise"])
        poses.append(model["poses"])
        captured_poses.append(model["captured"])
    captured = np.array(captured_poses)
    # they are stored with a few digits, and so are not quite of length 1
    turns = captured.reshape(*captured.shape[:2], TURNS, 4)
    captured = (turns / lengths(turns)).reshape(captured.shape)
    joints = stored["dependent_joints"]
    return Library(
        MotionModels(
            tuple(models),
            np.array(matrices),
            np.array(offsets),
            np.array(noises),
            np.array(poses),
            captured,
        ),
        DependentJoints(np.array(joints["matrix"]), np.array(joints["offset"])),
    )


def ridge(inputs: Array, outputs: Array, weight: float = LAMBDA) -> Array:
    """Return the F (m, k) that minimises |F x - y|^2 + weight |F|^2.

    The first term is summed over inputs x (n, k) and outputs y (n, m).
    """
    normal = inputs.T @ inputs + weight * np.eye(inputs.shape[1])  # VSMM 3
    return np.asarray(np.linalg.solve(normal, inputs.T @ outputs).T)


def leg_of(skeleton: Skeleton) -> float:
    """Return the length of a leg from hip to ankle, in metres."""
    rows = [SKELETON_BONES.index(bone) for bone in ("lfemur", "ltibia")]
    return float(skeleton.lengths[rows].sum())
