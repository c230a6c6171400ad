"""The person's flesh: a tapered cone on every bone."""

from dataclasses import dataclass, field, replace

import numpy as np

from posefit.arrays import Array, frozen
from posefit.errors import InputError
from posefit.geometry.skeleton import (
    ANGLES,
    BONES,
    JOINTS,
    MIRROR,
    PARENTS,
    Skeleton,
    kind,
)

# Radii as shares of the bone's length: (where the bone starts, where it ends). Ours: read off an adult's build.
PROPORTIONS = {
    "hipjoint": (0.80, 0.72),
    "femur": (0.205, 0.130),
    "tibia": (0.125, 0.085),
    "foot": (0.34, 0.27),
    "toes": (0.50, 0.34),
    "lowerback": (1.00, 1.00),
    "upperback": (1.00, 1.05),
    "thorax": (1.05, 0.80),
    "lowerneck": (0.66, 0.58),
    "upperneck": (0.60, 0.85),
    "head": (0.88, 0.86),
    "clavicle": (0.40, 0.31),
    "humerus": (0.185, 0.140),
    "radius": (0.185, 0.130),
    "wrist": (0.27, 0.33),
    "hand": (0.90, 0.80),
}


@dataclass(frozen=True, eq=False)
class Body:
    """A skeleton with the two radii of every bone's truncated cone, in metres. SAPSO section 2."""

    skeleton: Skeleton
    radii: Array = field(repr=False)  # (26, 2) where the bone starts, where it ends

    def __post_init__(self) -> None:
        object.__setattr__(self, "radii", frozen("radii", self.radii, (len(BONES), 2)))
        if (self.radii < 0.0).any():
            raise InputError(f"radii must not be negative, got {self.radii.min()}")

    @classmethod
    def of(cls, skeleton: Skeleton) -> "Body":
        """Return the body whose radii are `PROPORTIONS` of the bone lengths."""
        shares = np.array([PROPORTIONS[kind(bone)] for bone in BONES])
        return cls(skeleton, shares * skeleton.lengths[:, None])

    def joint_radii(self) -> Array:
        """Return the largest radius (27,) that a bone has at each joint."""
        radii = np.zeros(len(JOINTS))
        np.maximum.at(radii, np.array(PARENTS[1:]), self.radii[:, 0])
        np.maximum.at(radii, np.arange(1, len(JOINTS)), self.radii[:, 1])
        return radii

    @property
    def stature(self) -> float:
        """How tall the body stands, in metres: its legs straight and upright, the rest as in its rest pose."""
        skeleton = self.skeleton
        at = BONES.index
        joints = skeleton.joints(np.zeros(ANGLES))
        crown = joints[JOINTS.index("head"), 1] + self.radii[at("head"), 1]
        leg = skeleton.lengths[[at("lfemur"), at("ltibia")]].sum()
        sole = (
            max(0.0, -float(skeleton.offsets[at("lfoot"), 1]))
            + self.radii[at("lfoot"), 1]
        )
        return float(crown - joints[JOINTS.index("lhipjoint"), 1] + leg + sole)

    def scaled(self, lengths: Array | float, girths: Array | float) -> "Body":
        """Return the body with its bones' lengths and radii multiplied by factors, one for all or one a bone (26,)."""
        lengths = np.broadcast_to(lengths, len(BONES))
        girths = np.broadcast_to(girths, len(BONES))
        skeleton = replace(
            self.skeleton, offsets=self.skeleton.offsets * lengths[:, None]
        )
        return Body(skeleton, self.radii * girths[:, None])


def varied(body: Body, percent: float, rng: np.random.Generator) -> Body:
    """Return a body whose bones and radii vary by at most `percent` each, the same left and right."""
    if percent == 0.0:
        return body
    mirror = np.array(MIRROR)
    shares = [
        1.0 + rng.uniform(-percent, percent, len(JOINTS)) / 100.0 for _ in range(2)
    ]
    lengths, girths = (0.5 * (share + share[mirror])[1:] for share in shares)
    return body.scaled(lengths, girths)
