"""What cameras measure of a state: the rules' joints, against where the state's points are seen. VSMM 6.1."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import Array
from posefit.geometry.skeleton import BONES
from posefit_vsmm.imm import Measurement
from posefit_vsmm.joints import Detection, Errors
from posefit_vsmm.motion import leg_of
from posefit_vsmm.points import Figure
from posefit_vsmm.state import ERROR

KNOWN = 0.002  # metres: the deviation of a translation that is known


def head_radius(body: Body) -> float:
    """Return the radius of the head in metres."""
    return float(body.radii[BONES.index("head")].mean())


@dataclass(frozen=True, eq=False)
class Sight:
    """A body before cameras."""

    body: Body
    cameras: Sequence[Camera]
    figure: Figure
    errors: Errors = field(repr=False)

    def scales(self, state: Array) -> list[float]:
        """Return how many pixels a metre is at the root's depth, one a camera."""
        depths = [float((camera.rotation @ state[:3] + camera.translation)[2]) for camera in self.cameras]
        return [float(camera.focal.mean()) / max(z, 0.05) for camera, z in zip(self.cameras, depths, strict=True)]

    def noise(self, seen: Detection, scale: float) -> Array:
        """Return the variances (17, 2) of a detection in square pixels: the measured ones, more where it is unsure."""
        spread = self.errors.deviation * leg_of(self.body.skeleton) * scale
        return np.asarray(spread**2 / np.maximum(seen.confidence, 0.05)[:, None])

    def measure(
        self, state: Array, seen: Sequence[Detection | None], variances: Sequence[Array], known: Array | None
    ) -> Measurement:
        """Return what was detected, less what a state (43,) would show; hidden joints have no row (Reading V9)."""
        residuals, jacobians, noise = [np.zeros(0)], [np.zeros((0, ERROR))], [np.zeros(0)]
        for camera, one, variance in zip(self.cameras, seen, variances, strict=True):
            if one is None:
                continue
            pixels, jacobian = self.figure.seen(camera, state)  # VSMM 6.1
            shown = one.confidence > 0.0
            residuals.append((one.points - pixels)[shown].ravel())
            jacobians.append(jacobian[shown].reshape(-1, ERROR))
            noise.append(variance[shown].ravel())
        if known is not None:
            residuals.append(known - state[:3])
            jacobians.append(np.eye(3, ERROR))
            noise.append(np.full(3, KNOWN**2))
        return Measurement(np.concatenate(residuals), np.concatenate(jacobians), np.diag(np.concatenate(noise)))

