"""What cameras measure of a state: the rules' joints, against the projected points of the state. VSMM 6.1.

How far off a detected joint is, is counted in the standard deviations of its prediction and its detection together:
the squared Mahalanobis distance, known as the normalised innovation squared (NIS). A validation gate on it decides
which detections are accepted, and its mean over a frame is the surprise of that frame.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from posefit.arrays import Array
from posefit.fitting.landmarks import DEVIATION, GROUPS, MIRRORED
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS, Skeleton
from posefit_vsmm.imm import Measurement
from posefit_vsmm.joints import OWN, Lines, detected, rule_errors
from posefit_vsmm.kernels import bend, points_and_jacobian
from posefit_vsmm.motion import leg_of
from posefit_vsmm.settings import Settings
from posefit_vsmm.state import ENDS, ERROR, FIRST_BONE, POINTS, Reliance

NEAREST = 0.05  # metres: a smaller distance to the camera counts as this one
NARROWEST, WIDEST = 0.35, 1.2  # legs: gates around where points are expected
FAR = 1e3  # legs: a gate that is none
DEVIATIONS = 3.0  # between these, so many standard deviations
SURPRISE = 16.0  # the Mahalanobis gate, squared standard deviations in the image: a detection farther off is rejected
LEAST = 0.05  # the lowest confidence that counts
TINY = 1e-12
KNOWN = 0.002  # metres: the deviation of a translation that is known


def head_radius(body: Body) -> float:
    """Return the radius of the head in metres."""
    return float(body.radii[BONES.index("head")].mean())


@dataclass(frozen=True, eq=False)
class Figure:
    """A skeleton as its states move it."""

    skeleton: Skeleton
    reliance: Reliance = field(repr=False)

    def points(self, state: Array) -> tuple[Array, Array]:
        """Return the points (17, 3) in metres of a state (43,), and their Jacobian (17, 3, 33) by its error."""
        matrix, offset = self.reliance.matrix, self.reliance.offset
        pose, chained = np.empty(ANGLES), np.empty(matrix.shape)
        bend(state, matrix, offset, np.empty(matrix.shape[1]), pose, chained)
        frames, (sines,), (cosines,) = self.skeleton.frames(pose[None], state[None, :3])
        count = len(POINTS)
        points, jacobian = np.empty((count, 3)), np.zeros((count, 3, ERROR))
        others = np.empty((count, 3, len(offset)))
        points_and_jacobian(sines, cosines, frames[0], frames[0, :, 3].copy(), points, jacobian, others)
        jacobian[:, :, FIRST_BONE:] += (others.reshape(-1, len(offset)) @ chained).reshape(count, 3, -1)
        return points, jacobian

    def project(self, camera: Camera, state: Array) -> tuple[Array, Array]:
        """Return the projected points (17, 2) of a state, in pixels, and their Jacobian (17, 2, 33)."""
        points, jacobian = self.points(state)
        inside = points @ camera.rotation.T + camera.translation
        depths = np.maximum(inside[:, 2], NEAREST)
        pixels = inside[:, :2] / depths[:, None] * camera.focal + camera.centre
        moving = camera.rotation @ jacobian  # (17, 3, 33)
        ratio = (inside[:, :2] / depths[:, None])[:, :, None]
        by_error = camera.focal[None, :, None] / depths[:, None, None] * (moving[:, :2] - ratio * moving[:, 2:])
        return pixels, by_error


@dataclass(frozen=True, eq=False)
class JointMeasurement:
    """What one camera measured."""

    points: Array  # (17, 2) pixels
    confidence: Array  # (17,); 0 is hidden
    variances: Array = field(repr=False)  # (17, 2) square pixels
    unassigned: int  # end points of the skeleton line that belong to none of them
    # mean squared standard deviations a coordinate (NIS / 2) of the points that the rules detected by themselves
    surprise: float | None  # None where the camera shows nobody

    def imputed(self, points: Array) -> "JointMeasurement":
        """Return the same with other points (17, 2) where none are detected, as if they were. Interpretation V9."""
        shown = self.confidence > 0.0
        return replace(self, points=np.where(shown[:, None], self.points, points), confidence=np.ones(len(shown)))


def with_sides(landmarks: Array, expected: Array) -> tuple[Array, Array]:
    """Return where landmarks (27, 3) have the points (17, 2), and their confidence (17,), 0 where they have none.

    Sides that a detector exchanged are those that are nearer to where the points are expected (17, 2).
    """
    joints = ENDS[:, 0]
    alone = joints == ENDS[:, 1]
    given = landmarks[joints]
    for group in GROUPS:
        rows = np.flatnonzero(alone & np.isin(joints, group) & (given[:, 2] > 0.0))
        exchanged = landmarks[MIRRORED[joints[rows]]]
        off, other = (np.linalg.norm(those[:, :2] - expected[rows], axis=1).sum() for those in (given[rows], exchanged))
        if other < off:
            given[rows] = exchanged
    return given[:, :2], np.where(alone, np.minimum(given[:, 2], 1.0), 0.0)


@dataclass(frozen=True, eq=False)
class JointCameras:
    """A body before cameras."""

    body: Body
    cameras: Sequence[Camera]
    figure: Figure
    how: Settings

    def detect(
        self, views: Sequence[Lines | None], expected: Array, spread: Array, landmarks: Array | None = None
    ) -> list[JointMeasurement]:
        """Return the joints that each camera shows, where a state (43,) is expected with a covariance (33, 33).

        Detections outside the Mahalanobis gate are rejected. Where a camera shows nobody, no joint is detected.
        `landmarks` (V, 27, 3) are those of an `Observation`; a joint is where they and the rules have it on average.
        """
        given = np.zeros((len(views), len(JOINTS), 3)) if landmarks is None else landmarks
        each = zip(self.cameras, views, given, strict=True)
        return [self._detected(camera, lines, expected, spread, view) for camera, lines, view in each]

    def _detected(
        self, camera: Camera, lines: Lines | None, expected: Array, spread: Array, landmarks: Array
    ) -> JointMeasurement:
        pixels, jacobian = self.figure.project(camera, expected)
        if lines is None:
            return JointMeasurement(pixels, np.zeros(len(pixels)), np.ones_like(pixels), 0, None)
        depth = float((camera.rotation @ expected[:3] + camera.translation)[2])
        metre = float(camera.focal.mean()) / max(depth, NEAREST)  # in pixels, at the root's depth
        leg = leg_of(self.body.skeleton) * metre
        covariances = jacobian @ spread @ jacobian.transpose(0, 2, 1)
        gates = DEVIATIONS * np.sqrt(np.einsum("pii->pi", covariances).max(axis=1))
        gates = np.clip(gates, NARROWEST * leg, WIDEST * leg) if self.how.gates else np.full_like(gates, FAR * leg)
        (bias, deviation), radius = rule_errors(self.how.joint_errors), head_radius(self.body) * metre
        points, sure, unassigned = detected(lines, pixels, gates, leg, radius, bias, self.how.assignment)
        variances = self.how.joint_noise * (deviation * leg) ** 2
        if self.how.joint_errors == "measured":
            variances = variances / np.maximum(sure, LEAST)[:, None]
        if landmarks.any():
            placed, trusted = with_sides(landmarks, pixels)
            rules = (sure > 0.0)[:, None] / variances
            total = rules + np.maximum(trusted, TINY)[:, None] / (DEVIATION * metre) ** 2
            placed = np.where(trusted[:, None] > 0.0, placed, points)
            points, variances = placed + rules / total * (points - placed), 1.0 / total
            sure = np.maximum(sure, trusted)
        off = points - pixels
        distance = np.einsum("pi,pij,pj->p", off, np.linalg.inv(covariances + variances[:, :, None] * np.eye(2)), off)
        accepted = (distance < SURPRISE) | (not self.how.gates)
        confidence, own = np.where(accepted, sure, 0.0), (sure > 0.0) & OWN
        dropped = np.count_nonzero((confidence == 0.0) & (sure > 0.0))
        surprise = float(distance[own].mean() / 2.0) if own.any() else 0.0
        return JointMeasurement(points, confidence, variances, unassigned + int(dropped), surprise)

    def measure(self, state: Array, measured: Sequence[JointMeasurement], known: Array | None) -> Measurement:
        """Return the residuals of detected joints for a state (43,). Hidden joints have no row. Interpretation V9."""
        residuals, jacobians, noise = [np.zeros(0)], [np.zeros((0, ERROR))], [np.zeros(0)]
        for camera, joints in zip(self.cameras, measured, strict=True):
            pixels, jacobian = self.figure.project(camera, state)  # VSMM 6.1
            shown = joints.confidence > 0.0
            residuals.append((joints.points - pixels)[shown].ravel())
            jacobians.append(jacobian[shown].reshape(-1, ERROR))
            noise.append(joints.variances[shown].ravel())
        if known is not None:
            residuals.append(known - state[:3])
            jacobians.append(np.eye(3, ERROR))
            noise.append(np.full(3, KNOWN**2))
        return Measurement(np.concatenate(residuals), np.concatenate(jacobians), np.diag(np.concatenate(noise)))
