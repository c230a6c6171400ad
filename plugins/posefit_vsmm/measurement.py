"""What cameras measure of a state: the rules' joints, against the projected points of the state. VSMM 6.1.

How far off a detected joint is, is counted in the standard deviations of its prediction and its detection together:
the squared Mahalanobis distance, known as the normalised innovation squared (NIS). A validation gate on it decides
which detections are accepted.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting.landmarks import DEVIATION, GROUPS, MIRRORED
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import rotation_from_joint_angles
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS, Skeleton
from posefit_vsmm.imm import Measurement
from posefit_vsmm.joints import detect, rule_errors
from posefit_vsmm.motion import leg_of
from posefit_vsmm.preprocess import Lines
from posefit_vsmm.settings import Settings
from posefit_vsmm.state import (
    ENDS,
    ERROR,
    FIRST_BONE,
    HELD,
    OTHERS,
    POINTS,
    DependentJoints,
    cross_matrices,
    quaternions_of,
    rotation_matrices,
    rotation_vectors,
)

MIN_DEPTH = 0.05  # metres: a smaller distance to the camera counts as this one
GATE_DEVIATIONS = 3.0  # the gate around where a point is expected, in standard deviations
MIN_GATE, MAX_GATE = 0.35, 1.2  # legs: between these
NO_GATE = 1e3  # legs: a gate that is none
MAX_DISTANCE = 16.0  # squared standard deviations in the image: a detection farther off is rejected
MIN_CONFIDENCE = 0.05  # a lower one counts as this one
KNOWN_DEVIATION = 0.002  # metres: of a translation that is known

# The joints that turn, whole body first, and the joints that they turn about
_TURNING = np.array([0, *HELD, *OTHERS])
_PIVOTS = np.array([0, *(PARENTS[joint] for joint in _TURNING[1:])])
_MOVES = np.eye(len(JOINTS), dtype=bool)  # which joints (column) move when a joint (row) turns
for _joint in range(1, len(JOINTS)):
    _MOVES[:, _joint] |= _MOVES[:, PARENTS[_joint]]
# (22, 17, 27) of the joints: the arms from the pivots to the points, of which each is the middle of two joints
_ARMS = np.zeros((len(_TURNING), len(POINTS), len(JOINTS)))
for _row, (_joint, _pivot) in enumerate(zip(_TURNING, _PIVOTS, strict=True)):
    for _end in (0, 1):
        np.add.at(_ARMS[_row], (np.arange(len(POINTS)), ENDS[:, _end]), 0.5 * _MOVES[_joint, ENDS[:, _end]])
    _ARMS[_row, :, _pivot] -= _ARMS[_row].sum(axis=1)


def head_radius(body: Body) -> float:
    """Return the radius of the head in metres."""
    return float(body.radii[BONES.index("head")].mean())


class Figure:
    """The 17 points of a skeleton as its states move it."""

    def __init__(self, skeleton: Skeleton, dependent: DependentJoints) -> None:
        self._dependent = dependent
        rest = np.concatenate([np.eye(3)[None], skeleton.axes])
        self._rest = rest[[*PARENTS[1:]]].swapaxes(1, 2) @ skeleton.axes  # (26, 3, 3) in the parent's frame
        self._offsets = np.einsum("bji,bj->bi", skeleton.axes, skeleton.offsets)  # (26, 3) in the bone's own frame

    def points(self, states: Array) -> tuple[Array, Array]:
        """Return the points (r, 17, 3) in metres of states (r, 43), and their Jacobians (r, 17, 3, 33) by errors."""
        count, turns = len(states), quaternions_of(states)
        vectors = rotation_vectors(turns[:, 1:])
        angles = self._dependent.angles(vectors).reshape(count, -1, 3)
        rotations = np.tile(np.eye(3), (count, len(JOINTS), 1, 1))
        rotations[:, [0, *HELD]] = rotation_matrices(turns)
        rotations[:, OTHERS] = rotation_from_joint_angles(angles)
        rotations[:, 1:] = self._rest @ rotations[:, 1:]
        frames, joints = rotations.copy(), np.empty((count, len(JOINTS), 3))
        joints[:, 0] = states[:, :3]
        for joint, parent in enumerate(PARENTS[1:], start=1):
            frames[:, joint] = frames[:, parent] @ rotations[:, joint]
            joints[:, joint] = joints[:, parent] + frames[:, joint] @ self._offsets[joint - 1]

        axes = frames[:, _TURNING]  # (r, 22, 3, 3) columns: what a joint turns about, in the world
        axes[:, -len(OTHERS) :] = axes[:, -len(OTHERS) :] @ _angle_axes(angles)
        arms = np.tensordot(joints, _ARMS, (1, 2)).transpose(0, 2, 3, 1)  # (r, 22, 17, 3)
        moves = np.cross(axes.swapaxes(2, 3)[:, :, None], arms[:, :, :, None])  # (r, 22, 17, 3 axes, 3)
        columns = moves.transpose(0, 2, 4, 1, 3).reshape(count, len(POINTS), 3, -1)
        jacobians = np.zeros((count, len(POINTS), 3, ERROR))
        jacobians[..., :3] = np.eye(3)
        jacobians[..., 3:] = columns[..., : ERROR - 3]
        by_vectors = self._dependent.matrix.reshape(-1, len(HELD), 3).swapaxes(0, 1) @ _inverse_jacobians(vectors)
        chained = by_vectors.swapaxes(1, 2).reshape(count, 1, -1, ERROR - FIRST_BONE)
        jacobians[..., FIRST_BONE:] += columns[..., ERROR - 3 :] @ chained
        return joints[:, ENDS].mean(axis=2), jacobians

    def project(self, camera: Camera, states: Array) -> tuple[Array, Array]:
        """Return the projected points (r, 17, 2) of states, in pixels, and their Jacobians (r, 17, 2, 33)."""
        points, jacobians = self.points(states)
        inside = points @ camera.rotation.T + camera.translation
        depths = np.maximum(inside[..., 2:], MIN_DEPTH)
        slopes = inside[..., :2] / depths
        moves = camera.rotation @ jacobians  # (r, 17, 3, 33)
        by_error = (camera.focal / depths)[..., None] * (moves[..., :2, :] - slopes[..., None] * moves[..., 2:, :])
        return slopes * camera.focal + camera.centre, by_error


def _angle_axes(angles: Array) -> Array:
    """Return the axes (..., 3, 3), as columns in a bone's own frame, of its angles (..., 3) rx, ry and rz.

    They are e_x, Rx' e_y and Rx' Ry' e_z.
    """
    (sine_x, sine_y, _), (cosine_x, cosine_y, _) = (np.moveaxis(f(angles), -1, 0) for f in (np.sin, np.cos))
    zero, one = np.zeros_like(sine_x), np.ones_like(sine_x)
    rows = [[one, zero, -sine_y], [zero, cosine_x, sine_x * cosine_y], [zero, -sine_x, cosine_x * cosine_y]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def _inverse_jacobians(vectors: Array) -> Array:
    """Return how rotation vectors v (..., 3) change with a small rotation on the right: I + [v] / 2 + k [v]^2."""
    angles = np.linalg.norm(vectors, axis=-1)
    safe = np.maximum(angles, 1e-3)
    k = 1.0 / safe**2 - (1.0 + np.cos(safe)) / (2.0 * safe * np.sin(safe))
    k = np.where(angles < 1e-3, 1.0 / 12.0, k)[..., None, None]
    crosses = cross_matrices(vectors)
    return np.asarray(np.eye(3) + 0.5 * crosses + k * crosses @ crosses)


class JointMeasurement(NamedTuple):
    """What one camera measured."""

    points: Array  # (17, 2) pixels
    confidence: Array  # (17,); 0 is hidden
    variances: Array  # (17, 2) square pixels
    unassigned: int  # end points of the skeleton line that belong to none of them

    def imputed(self, points: Array) -> "JointMeasurement":
        """Return the same with other points (17, 2) where none are detected, as if they were. Interpretation V9."""
        visible = self.confidence > 0.0
        return self._replace(points=np.where(visible[:, None], self.points, points), confidence=np.ones(len(visible)))


def with_sides(landmarks: Array, expected: Array) -> tuple[Array, Array]:
    """Return where landmarks (27, 3) have the points (17, 2), and their confidence (17,), 0 where they have none.

    Sides that a detector exchanged are those that are nearer to where the points are expected (17, 2).
    """
    joints = ENDS[:, 0]
    single = joints == ENDS[:, 1]  # points that are a joint, not the middle of two
    placed = landmarks[joints]
    for group in GROUPS:
        rows = np.flatnonzero(single & np.isin(joints, group) & (placed[:, 2] > 0.0))
        exchanged = landmarks[MIRRORED[joints[rows]]]
        direct, other = (
            np.linalg.norm(candidates[:, :2] - expected[rows], axis=1).sum() for candidates in (placed[rows], exchanged)
        )
        if other < direct:
            placed[rows] = exchanged
    return placed[:, :2], np.where(single, np.minimum(placed[:, 2], 1.0), 0.0)


@dataclass(frozen=True, eq=False)
class JointCameras:
    """A body before cameras."""

    body: Body
    cameras: Sequence[Camera]
    figure: Figure
    settings: Settings

    def detect(
        self, views: Sequence[Lines | None], expected: Array, spread: Array, landmarks: Array | None = None
    ) -> list[JointMeasurement]:
        """Return the joints that each camera shows, where a state (43,) is expected with a covariance (33, 33).

        Detections outside the Mahalanobis gate are rejected. Where a camera shows nobody, no joint is detected.
        `landmarks` (V, 27, 3) are those of an `Observation`; a joint is where they and the rules have it on average.
        """
        each = zip(self.cameras, views, [None] * len(views) if landmarks is None else landmarks, strict=True)
        return [self._detect(camera, lines, expected, spread, view) for camera, lines, view in each]

    def _detect(
        self, camera: Camera, lines: Lines | None, expected: Array, spread: Array, landmarks: Array | None
    ) -> JointMeasurement:
        literal, projected = self.settings.patent, self.figure.project(camera, expected[None])
        pixels, jacobian = projected[0][0], projected[1][0]
        if lines is None:
            return JointMeasurement(pixels, np.zeros(len(pixels)), np.ones_like(pixels), 0)
        depth = float((camera.rotation @ expected[:3] + camera.translation)[2])
        metre = float(camera.focal.mean()) / max(depth, MIN_DEPTH)  # in pixels, at the root's depth
        leg = leg_of(self.body.skeleton) * metre
        covariances = jacobian @ spread @ jacobian.swapaxes(1, 2)
        gates = GATE_DEVIATIONS * np.sqrt(np.diagonal(covariances, axis1=1, axis2=2).max(axis=1))
        gates = np.full_like(gates, NO_GATE * leg) if literal else np.clip(gates, MIN_GATE * leg, MAX_GATE * leg)
        bias, deviation = rule_errors(literal)
        points, confidence, unassigned = detect(
            lines, pixels, gates, leg, head_radius(self.body) * metre, bias, nearest=literal
        )
        variances = self.settings.joint_noise * (deviation * leg) ** 2
        if not literal:  # Interpretation V8
            variances = variances / np.maximum(confidence, MIN_CONFIDENCE)[:, None]
        if landmarks is not None and landmarks.any():
            placed, trust = with_sides(landmarks, pixels)
            rules = (confidence > 0.0)[:, None] / variances
            total = rules + np.maximum(trust, 1e-12)[:, None] / (DEVIATION * metre) ** 2
            placed = np.where(trust[:, None] > 0.0, placed, points)
            points, variances = placed + rules / total * (points - placed), 1.0 / total
            confidence = np.maximum(confidence, trust)
        residuals = points - pixels
        innovations = covariances + variances[:, :, None] * np.eye(2)
        distances = (residuals * np.linalg.solve(innovations, residuals[..., None])[..., 0]).sum(axis=1)
        rejected = (distances >= MAX_DISTANCE) & (confidence > 0.0) & (not literal)
        confidence = np.where(rejected, 0.0, confidence)
        return JointMeasurement(points, confidence, variances, unassigned + int(np.count_nonzero(rejected)))

    def measure(self, states: Array, measured: Sequence[JointMeasurement], known: Array | None) -> Measurement:
        """Return the residuals of detected joints for states (r, 43). Hidden joints have no column. Interpretation V9.

        `known` (3,) is the root's translation, where it is known.
        """
        count = len(states)
        residuals, jacobians, noise = [np.zeros((count, 0))], [np.zeros((count, 0, ERROR))], [np.zeros(0)]
        for camera, joints in zip(self.cameras, measured, strict=True):
            pixels, jacobian = self.figure.project(camera, states)  # VSMM 6.1
            visible = joints.confidence > 0.0
            residuals.append((joints.points - pixels)[:, visible].reshape(count, -1))
            jacobians.append(jacobian[:, visible].reshape(count, -1, ERROR))
            noise.append(joints.variances[visible].ravel())
        if known is not None:
            residuals.append(known - states[:, :3])
            jacobians.append(np.tile(np.eye(3, ERROR), (count, 1, 1)))
            noise.append(np.full(3, KNOWN_DEVIATION**2))
        covariance = np.diag(np.concatenate(noise))
        return Measurement(np.concatenate(residuals, axis=1), np.concatenate(jacobians, axis=1), covariance)
