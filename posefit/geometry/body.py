"""Body shape: one tapered cone per bone."""

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

# Radii as shares of the bone's length, at its start and at its end. Ours: read off an
# adult's build.
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
    """A skeleton and the two radii in metres of each bone's cone. SAPSO section 2.

    Attributes:
        skeleton: The skeleton.
        radii: The radii (26, 2) in metres, at the start and at the end of each bone.

    Raises:
        InputError: The radii have another shape, or one is negative or not finite.

    Example:
        >>> from posefit import Body, load_motion
        >>> body = Body.of(load_motion("walk").skeleton)
        >>> body.radii.shape
        (26, 2)
        >>> 1.5 < body.stature < 1.9
        True
    """

    skeleton: Skeleton
    radii: Array = field(repr=False)  # (26, 2)

    def __post_init__(self) -> None:
        object.__setattr__(self, "radii", frozen("radii", self.radii, (len(BONES), 2)))
        if (self.radii < 0.0).any():
            raise InputError(f"radii must not be negative, got {self.radii.min()}")

    @classmethod
    def of(cls, skeleton: Skeleton) -> "Body":
        """Return the body with radii of `PROPORTIONS` times the bone lengths."""
        shares = np.array([PROPORTIONS[kind(bone)] for bone in BONES])
        return cls(skeleton, shares * skeleton.lengths[:, None])

    def joint_radii(self) -> Array:
        """Return the radius (27,) at each joint: the largest of all bones there."""
        radii = np.zeros(len(JOINTS))
        np.maximum.at(radii, np.array(PARENTS[1:]), self.radii[:, 0])
        np.maximum.at(radii, np.arange(1, len(JOINTS)), self.radii[:, 1])
        return radii

    @property
    def stature(self) -> float:
        """The height in metres of the body at rest, with straight, upright legs."""
        skeleton = self.skeleton
        index = BONES.index
        joints = skeleton.joints(np.zeros(ANGLES))
        crown = joints[JOINTS.index("head"), 1] + self.radii[index("head"), 1]
        hip = joints[JOINTS.index("lhipjoint"), 1]
        leg = skeleton.lengths[[index("lfemur"), index("ltibia")]].sum()
        drop = max(0.0, -float(skeleton.offsets[index("lfoot"), 1]))
        sole = drop + self.radii[index("lfoot"), 1]
        return float(crown - hip + leg + sole)

    def scaled(self, lengths: Array | float, girths: Array | float) -> "Body":
        """Return the body with other lengths and radii.

        Args:
            lengths: Factors of the bones' lengths: one number, or one per bone (26,).
            girths: Factors of the radii: one number, or one per bone (26,).
        """
        lengths = np.broadcast_to(lengths, len(BONES))
        girths = np.broadcast_to(girths, len(BONES))
        offsets = self.skeleton.offsets * lengths[:, None]
        skeleton = replace(self.skeleton, offsets=offsets)
        return Body(skeleton, self.radii * girths[:, None])


def varied(body: Body, percent: float, rng: np.random.Generator) -> Body:
    """Return a body whose lengths and radii vary by at most `percent` each.

    The left and the right side vary by the same factors.
    """
    if percent == 0.0:
        return body
    mirror = np.array(MIRROR)
    factors = []
    for _ in ("lengths", "girths"):
        factor = 1.0 + rng.uniform(-percent, percent, len(JOINTS)) / 100.0
        # the mean of both sides is the same left and right
        factors.append(0.5 * (factor + factor[mirror])[1:])
    lengths, girths = factors
    return body.scaled(lengths, girths)
