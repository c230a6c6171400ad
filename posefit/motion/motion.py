"""A clip of motion capture: one pose and one translation a frame."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, frozen
from posefit.errors import InputError
from posefit.geometry.rotation import (
    joint_angles_from_rotation,
    root_angles_from_rotation,
    rotation_from_root_angles,
    unwrapped,
)
from posefit.geometry.skeleton import ANGLES, INNER, Skeleton, angle_index
from posefit.limits import RATES
from posefit.reading import quoted

# Share of a frame within which two times count as the same one.
SAME_TIME = 1e-6
# frames of a file, or of a motion that is made or resampled: 28 minutes at 120 a second
LONGEST = 200_000


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses of one skeleton at a constant rate. Arrays are copied and cannot be written to."""

    name: str
    skeleton: Skeleton
    # (T, 66) radians, unwrapped along time by the readers
    poses: Array = field(repr=False)
    # (T, 3) metres, the root joint in the world
    translations: Array = field(repr=False)
    fps: float
    # the number of the first frame, in the footage or the longer motion that it was
    # taken from
    first: int = 0
    notes: tuple[str, ...] = ()  # what was guessed where a file was read

    def __post_init__(self) -> None:
        for name, columns in (("poses", ANGLES), ("translations", 3)):
            object.__setattr__(
                self, name, frozen(name, getattr(self, name), ("frames", columns))
            )
        if len(self.poses) < 1:
            raise InputError("poses must hold at least 1 frame, got 0")
        if len(self.translations) != len(self.poses):
            raise InputError(
                f"translations must have shape {(len(self.poses), 3)}, got {self.translations.shape}"
            )
        object.__setattr__(self, "fps", _rate(self.fps))

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def joints(self) -> Array:
        """The joints (T, 27, 3) in the world, in metres."""
        return self.skeleton.joints(self.poses, self.translations)

    def frames(self, start: int, stop: int) -> "Motion":
        """Return frames start to stop - 1 as a motion. Raises InputError where that leaves the clip or is empty."""
        if not 0 <= start < stop <= len(self):
            raise InputError(
                f"frames must be 0 <= start < stop <= {len(self)}, got start {start} and stop {stop}"
            )
        poses = self.poses[start:stop]
        translations = self.translations[start:stop]
        return replace(
            self, poses=poses, translations=translations, first=self.first + start
        )

    def turned(self, rotation: Array) -> "Motion":
        """Return the motion in a world that is turned by a rotation (3, 3)."""
        poses = self.poses.copy()
        poses[:, :3] = unwrapped(
            root_angles_from_rotation(
                rotation @ rotation_from_root_angles(poses[:, :3])
            )
        )
        return replace(self, poses=poses, translations=self.translations @ rotation.T)

    def about_axes_of(self, skeleton: Skeleton) -> "Motion":
        """Return the motion with joint angles about another skeleton's axes: in space, each joint turns as before."""
        if np.array_equal(self.skeleton.axes, skeleton.axes):
            return self
        own = replace(
            self.skeleton,
            axes=skeleton.axes,
            channels=skeleton.channels,
            limits=skeleton.limits,
        )
        turns = self.skeleton.turns(self.poses)
        poses = self.poses.copy()
        for joint in INNER:
            start = angle_index(joint)
            axes = skeleton.axes[joint - 1]
            poses[:, start : start + 3] = joint_angles_from_rotation(
                axes.T @ turns[joint] @ axes
            )
        return replace(self, skeleton=own, poses=unwrapped(poses))

    def reversed(self) -> "Motion":
        """Return the motion with its last frame first."""
        return replace(
            self, poses=self.poses[::-1], translations=self.translations[::-1]
        )

    def resampled(self, fps: float) -> "Motion":
        """Return the motion at another rate, over the times k / fps that lie within it.

        Where the old rate is a whole multiple k of the new one, every k-th frame is taken as it is. Elsewhere joint
        angles and translations are interpolated linearly, and the root's rotation along the shortest arc. `first` is
        the nearest whole number at the new rate.
        """
        fps = _rate(fps)
        ratio = self.fps / fps
        step = round(ratio)
        first = round(self.first / ratio)
        if step >= 1 and abs(ratio - step) < 1e-9 * step:
            poses = self.poses[::step]
            translations = self.translations[::step]
            return replace(
                self, poses=poses, translations=translations, fps=fps, first=first
            )
        last = len(self) - 1
        if last / ratio >= LONGEST:
            came = f"{last / ratio:.3g} frames at {fps:g} fps"
            raise InputError(
                f"{self.name} must have at most {LONGEST} frames when it is resampled, got {came}"
            )
        # in frames of this motion; the last time may be off by rounding
        times = np.minimum(np.arange(int(last / ratio + SAME_TIME) + 1) * ratio, last)
        if last == 0:
            return replace(self, fps=fps, first=first)
        poses = at_frames(self.poses, times)
        translations = at_frames(self.translations, times)
        # a quarter of a second to import
        from scipy.spatial.transform import Rotation, Slerp

        rotations = Rotation.from_matrix(rotation_from_root_angles(self.poses[:, :3]))
        between = Slerp(np.arange(len(self)), rotations)(times).as_matrix()
        angles = np.unwrap(root_angles_from_rotation(between), axis=0)
        turns = np.round((self.poses[0, :3] - angles[0]) / (2.0 * np.pi))
        poses[:, :3] = angles + 2.0 * np.pi * turns
        return replace(
            self, poses=poses, translations=translations, fps=fps, first=first
        )


def at_frames(series: Array, times: Array | float) -> Array:
    """Return a series (T, ...) at times in frames, between which it is a straight line."""
    times = np.asarray(times, dtype=np.float64)
    before: NDArray[np.int64] = np.clip(
        times.astype(np.int64), 0, max(len(series) - 2, 0)
    )
    after = np.minimum(before + 1, len(series) - 1)
    share = (times - before).reshape(times.shape + (1,) * (series.ndim - 1))
    return np.asarray((1.0 - share) * series[before] + share * series[after])


def _rate(fps: float) -> float:
    if not RATES[0] <= fps <= RATES[1]:
        raise InputError(
            f"fps must lie in {RATES[0]:g} to {RATES[1]:g}, got {quoted(fps)}"
        )
    return float(fps)
