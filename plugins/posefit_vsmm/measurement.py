"""What cameras measure of a state: the rules' joints, against the projected points of the state. VSMM 6.1.

A validation gate on the squared Mahalanobis distance decides which detections are accepted.
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

MIN_DEPTH = 0.05  # metres: a smaller distance to the camera counts as this one
# the gate around where a point is expected, in standard deviations
GATE_DEVIATIONS = 3.0
KNOWN_VARIANCE = 0.002**2  # square metres: of a translation that is known


def head_radius(body: Body) -> float:
    """Return the radius of the head in metres."""
    return float(body.radii[BONES.index("head")].mean())


class JointMeasurement(NamedTuple):
    """What one camera measured."""

    points: Array  # (17, 2) pixels
    confidence: Array  # (17,); 0 is hidden
    variances: Array  # (17, 2) square pixels
    unassigned: int  # end points of the skeleton line that belong to none of them

    def imputed(self, points: Array) -> "JointMeasurement":
        """Return the same with other points (17, 2) where none are detected, as if they were. Interpretation V9."""
        visible = self.confidence > 0.0
        return self._replace(
            points=np.where(visible[:, None], self.points, points),
            confidence=np.ones(len(visible)),
        )


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
        both = np.stack([placed[rows], exchanged])[..., :2]
        direct, other = np.linalg.norm(both - expected[rows], axis=2).sum(axis=1)
        if other < direct:
            placed[rows] = exchanged
    return placed[:, :2], np.where(single, np.minimum(placed[:, 2], 1.0), 0.0)


@dataclass(frozen=True, eq=False)
class JointCameras:
    """A body, as its states move it, before cameras."""

    body: Body
    cameras: Sequence[Camera]
    dependent: DependentJoints
    rules: Rules = field(default_factory=default_rules)
    joint_noise: float = 1.0

    def project(self, camera: Camera, states: Array) -> tuple[Array, Array]:
        """Return the projected points (r, 17, 2) of states (r, 43), in pixels, and their Jacobians (r, 17, 2, 33)."""

        def pixels(states: Array) -> Array:
            points = self.body.skeleton.joints(*decode(states, self.dependent))[
                ..., ENDS, :
            ].mean(axis=-2)
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
        """Return the joints that each camera shows, where a state (43,) is expected with a covariance (33, 33).

        `landmarks` (V, 27, 3) are those of an `Observation`; a joint is where they and the rules have it on average.
        """
        each = zip(
            self.cameras,
            views,
            [None] * len(views) if landmarks is None else landmarks,
            strict=True,
        )
        return [
            self._detect(camera, lines, expected, spread, view)
            for camera, lines, view in each
        ]

    def _detect(
        self,
        camera: Camera,
        lines: Lines | None,
        expected: Array,
        spread: Array,
        landmarks: Array | None,
    ) -> JointMeasurement:
        pixels, jacobian = (part[0] for part in self.project(camera, expected[None]))
        if lines is None:
            return JointMeasurement(
                pixels, np.zeros(len(pixels)), np.ones_like(pixels), 0
            )
        depth = float((camera.rotation @ expected[:3] + camera.translation)[2])
        # in pixels, at the root's depth
        metre = float(camera.focal.mean()) / max(depth, MIN_DEPTH)
        leg = leg_of(self.body.skeleton) * metre
        covariances = jacobian @ spread @ jacobian.swapaxes(1, 2)
        gates = GATE_DEVIATIONS * np.sqrt(
            np.diagonal(covariances, axis1=1, axis2=2).max(axis=1)
        )
        low, high = self.rules.gate
        gates = np.clip(gates, low * leg, high * leg)
        head = head_radius(self.body) * metre
        points, confidence, unassigned = detect(
            lines, pixels, gates, leg, head, self.rules
        )
        variances = self.joint_noise * (self.rules.deviation * leg) ** 2
        # Interpretation V8
        variances = (
            variances / np.maximum(confidence, self.rules.min_confidence)[:, None]
        )
        if landmarks is not None and landmarks.any():
            placed, trust = with_sides(landmarks, pixels)
            rules = (confidence > 0.0)[:, None] / variances
            total = rules + np.maximum(trust, 1e-12)[:, None] / (DEVIATION * metre) ** 2
            placed = np.where(trust[:, None] > 0.0, placed, points)
            points = placed + rules / total * (points - placed)
            variances = 1.0 / total
            confidence = np.maximum(confidence, trust)
        residuals = points - pixels
        innovations = covariances + variances[:, :, None] * np.eye(2)
        distances = (
            residuals * np.linalg.solve(innovations, residuals[..., None])[..., 0]
        ).sum(axis=1)
        rejected = (distances >= self.rules.max_distance) & (confidence > 0.0)
        confidence = np.where(rejected, 0.0, confidence)
        return JointMeasurement(
            points, confidence, variances, unassigned + int(np.count_nonzero(rejected))
        )

    def measure(
        self, states: Array, measured: Sequence[JointMeasurement], known: Array | None
    ) -> Measurement:
        """Return the residuals of detected joints, and of a known translation (3,), for states (r, 43). V9."""
        count = len(states)
        parts = []
        for camera, joints in zip(self.cameras, measured, strict=True):
            visible = joints.confidence > 0.0
            # VSMM 6.1
            pixels, jacobians = (
                part[:, visible] for part in self.project(camera, states)
            )
            parts.append(
                (joints.points[visible] - pixels, jacobians, joints.variances[visible])
            )
        if known is not None:
            parts.append(
                (
                    known - states[:, :3],
                    np.tile(np.eye(3, ERROR), (count, 1, 1)),
                    np.full(3, KNOWN_VARIANCE),
                )
            )
        residuals = np.concatenate(
            [residual.reshape(count, -1) for residual, _, _ in parts], axis=1
        )
        jacobians = np.concatenate(
            [jacobian.reshape(count, -1, ERROR) for _, jacobian, _ in parts], axis=1
        )
        return Measurement(
            residuals,
            jacobians,
            np.diag(np.concatenate([noise.ravel() for *_, noise in parts])),
        )
