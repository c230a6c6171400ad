"""The measurement: detected joints against the projected points of a state. VSMM 6.1.

A validation gate on the squared Mahalanobis distance decides which detections are
accepted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting.landmarks import DEVIATION, GROUPS, MIRRORED
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import BONES
from posefit_vsmm.imm import Measurement
from posefit_vsmm.joints import Rules, default_rules, detect
from posefit_vsmm.motion import leg_of
from posefit_vsmm.preprocess import Lines
from posefit_vsmm.state import ENDS, ERROR, DependentJoints, decode, differentiate

MIN_DEPTH = 0.05  # metres: points nearer to the camera are projected at this depth
# radius of the gate around a point's expected position, in standard deviations
GATE_DEVIATIONS = 3.0
KNOWN_VARIANCE = 0.002**2  # square metres: variance of a known translation


def head_radius(body: Body) -> float:
    """Return the radius of the head in metres."""
    return float(body.radii[BONES.index("head")].mean())


class JointMeasurement(NamedTuple):
    """The joints that one camera measured."""

    points: Array  # (17, 2) pixels
    confidence: Array  # (17,); 0 if hidden
    variances: Array  # (17, 2) square pixels
    unassigned: int  # end points of the skeleton line without a joint

    def imputed(self, points: Array) -> "JointMeasurement":
        """Replace the hidden points by others, as if detected. Interpretation V9."""
        visible = self.confidence > 0.0
        return self._replace(
            points=np.where(visible[:, None], self.points, points),
            confidence=np.ones(len(visible)),
        )


class ExpectedPoints(NamedTuple):
    """Where a camera is expected to see the points of the body."""

    pixels: Array  # (17, 2)
    covariances: Array  # (17, 2, 2) square pixels
    pixels_per_metre: float  # at the root's depth


def with_sides(landmarks: Array, expected: Array) -> tuple[Array, Array]:
    """Return the points (17, 2) from landmarks, and their confidence (17,).

    A detector may exchange left and right. So each group of landmarks is exchanged if
    that brings it nearer to the expected points.

    Args:
        landmarks: (27, 3) column, row and confidence of the joints.
        expected: (17, 2) pixels.

    Returns:
        The points in pixels, and their confidence: 0 for points without a landmark.
    """
    joints = ENDS[:, 0]
    single = joints == ENDS[:, 1]  # points that are joints, not the middle of two
    placed = landmarks[joints]
    for group in GROUPS:
        rows = np.flatnonzero(single & np.isin(joints, group) & (placed[:, 2] > 0.0))
        exchanged = landmarks[MIRRORED[joints[rows]]]
        both = np.stack([placed[rows], exchanged])[..., :2]
        direct, other = np.linalg.norm(both - expected[rows], axis=2).sum(axis=1)
        if other < direct:
            placed[rows] = exchanged
    return placed[:, :2], np.where(single, np.minimum(placed[:, 2], 1.0), 0.0)


def with_landmarks(
    detected: JointMeasurement, landmarks: Array, expected: ExpectedPoints
) -> JointMeasurement:
    """Return the means of the rules' points and of landmarks (27, 3).

    The weights are inverse variances.
    """
    placed, trust = with_sides(landmarks, expected.pixels)
    visible = detected.confidence > 0.0
    rules = visible[:, None] / detected.variances
    landmark_variance = (DEVIATION * expected.pixels_per_metre) ** 2
    total = rules + np.maximum(trust, 1e-12)[:, None] / landmark_variance
    placed = np.where(trust[:, None] > 0.0, placed, detected.points)
    return JointMeasurement(
        placed + rules / total * (detected.points - placed),
        np.maximum(detected.confidence, trust),
        1.0 / total,
        detected.unassigned,
    )


@dataclass(frozen=True, eq=False)
class JointCameras:
    """Detects and measures the joints of a body in the images of cameras."""

    body: Body
    cameras: Sequence[Camera]
    dependent: DependentJoints
    rules: Rules = field(default_factory=default_rules)
    joint_noise: float = 1.0

    def project(self, camera: Camera, states: Array) -> tuple[Array, Array]:
        """Return the points (r, 17, 2) of states (r, 43) in pixels, and Jacobians.

        The Jacobians (r, 17, 2, 33) are by the states' errors.
        """

        def pixels(states: Array) -> Array:
            joints = self.body.skeleton.joints(*decode(states, self.dependent))
            points = joints[..., ENDS, :].mean(axis=-2)  # (r, n, 17, 3)
            inside = points @ camera.rotation.T + camera.translation
            slopes = inside[..., :2] / np.maximum(inside[..., 2:], MIN_DEPTH)
            return np.asarray(slopes * camera.focal + camera.centre)

        return differentiate(pixels, states)

    def detect(
        self,
        views: Sequence[Lines | None],
        expected: Array,
        spread: Array,
        landmarks: Array | None = None,
    ) -> list[JointMeasurement]:
        """Detect the joints in each camera's image.

        Args:
            views: The silhouette in each camera; None for a camera without one.
            expected: (43,) the expected state.
            spread: (33, 33) the covariance of its error.
            landmarks: (V, 27, 3) of an `Observation`. A joint is the mean of the
                landmark and the rules' point, weighted by inverse variances.

        Returns:
            One measurement per camera.
        """
        each = [None] * len(views) if landmarks is None else landmarks
        measured = []
        for camera, lines, view in zip(self.cameras, views, each, strict=True):
            measured.append(self._detect(camera, lines, expected, spread, view))
        return measured

    def _detect(
        self,
        camera: Camera,
        lines: Lines | None,
        state: Array,
        spread: Array,
        landmarks: Array | None,
    ) -> JointMeasurement:
        """Detect the joints in one camera's image, given the expected state (43,)."""
        expected = self._expected_points(camera, state, spread)
        if lines is None:
            pixels = expected.pixels
            hidden = np.zeros(len(pixels))
            return JointMeasurement(pixels, hidden, np.ones_like(pixels), 0)
        detected = self._by_rules(lines, expected)
        if landmarks is not None and landmarks.any():
            detected = with_landmarks(detected, landmarks, expected)
        return self._gated(detected, expected)

    def _expected_points(
        self, camera: Camera, state: Array, spread: Array
    ) -> ExpectedPoints:
        """Return where a camera is expected to see the points of a state (43,)."""
        all_pixels, jacobians = self.project(camera, state[None])
        pixels = all_pixels[0]
        jacobian = jacobians[0]
        depth = float((camera.rotation @ state[:3] + camera.translation)[2])
        pixels_per_metre = float(camera.focal.mean()) / max(depth, MIN_DEPTH)
        covariances = jacobian @ spread @ jacobian.swapaxes(1, 2)
        return ExpectedPoints(pixels, covariances, pixels_per_metre)

    def _by_rules(self, lines: Lines, expected: ExpectedPoints) -> JointMeasurement:
        """Return the joints that the rules detect in a silhouette. VSMM 2."""
        leg = leg_of(self.body.skeleton) * expected.pixels_per_metre
        head = head_radius(self.body) * expected.pixels_per_metre
        # each point is searched for within a gate around its expected position
        variances_of_points = np.diagonal(expected.covariances, axis1=1, axis2=2)
        largest = variances_of_points.max(axis=1)  # (17,)
        low, high = self.rules.gate
        gates = np.clip(GATE_DEVIATIONS * np.sqrt(largest), low * leg, high * leg)
        points, confidence, unassigned = detect(
            lines, expected.pixels, gates, leg, head, self.rules
        )
        variances = self.joint_noise * (self.rules.deviation * leg) ** 2
        # Interpretation V8
        trusted = np.maximum(confidence, self.rules.min_confidence)
        return JointMeasurement(
            points, confidence, variances / trusted[:, None], unassigned
        )

    def _gated(
        self, detected: JointMeasurement, expected: ExpectedPoints
    ) -> JointMeasurement:
        """Return the joints, with those too far from their expected points hidden.

        The squared Mahalanobis distance decides. Rejected joints count as unassigned.
        """
        residuals = detected.points - expected.pixels
        innovations = expected.covariances + detected.variances[:, :, None] * np.eye(2)
        solved = np.linalg.solve(innovations, residuals[..., None])[..., 0]  # (17, 2)
        distances = (residuals * solved).sum(axis=1)
        visible = detected.confidence > 0.0
        rejected = (distances >= self.rules.max_distance) & visible
        return detected._replace(
            confidence=np.where(rejected, 0.0, detected.confidence),
            unassigned=detected.unassigned + int(np.count_nonzero(rejected)),
        )

    def measure(
        self, states: Array, measured: Sequence[JointMeasurement], known: Array | None
    ) -> Measurement:
        """Return the measurement of states (r, 43).

        It has the residuals of the detected joints and of a known translation (3,).
        Interpretation V9.
        """
        count = len(states)
        residuals = []
        jacobians = []
        variances = []
        for camera, joints in zip(self.cameras, measured, strict=True):
            visible = joints.confidence > 0.0
            # VSMM 6.1
            pixels, changes = self.project(camera, states)
            apart = joints.points[visible] - pixels[:, visible]
            residuals.append(apart.reshape(count, -1))
            jacobians.append(changes[:, visible].reshape(count, -1, ERROR))
            variances.append(joints.variances[visible].ravel())
        if known is not None:
            residuals.append(known - states[:, :3])
            jacobians.append(np.tile(np.eye(3, ERROR), (count, 1, 1)))
            variances.append(np.full(3, KNOWN_VARIANCE))
        return Measurement(
            np.concatenate(residuals, axis=1),
            np.concatenate(jacobians, axis=1),
            np.diag(np.concatenate(variances)),
        )
