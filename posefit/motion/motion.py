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

# share of a frame within which two times count as the same
SAME_TIME = 1e-6
# most frames of a file, or of a motion that is made or resampled: 28 minutes at 120 Hz
LONGEST = 200_000


@dataclass(frozen=True, eq=False)
class Motion:
    """Poses of one skeleton at a constant rate. Arrays are read-only copies.

    Attributes:
        name: The name of the clip.
        skeleton: The skeleton that the poses are of.
        poses: Angles (T, 66) in radians, unwrapped along time by the readers.
        translations: Root joint (T, 3) in the world, in metres.
        fps: Frames per second.
        first: Number of the first frame, in the footage or in the longer motion that
            this one was cut from.
        notes: The guesses that were made when a file was read.

    Raises:
        InputError: An array has a wrong shape or is not finite, or the rate is not
            allowed.

    Example:
        >>> from posefit import Motion, load_motion
        >>> walk = load_motion("walk")
        >>> places = walk.translations[:5]
        >>> part = Motion("part", walk.skeleton, walk.poses[:5], places, 30.0)
        >>> len(part), part.joints.shape
        (5, (5, 27, 3))
    """

    name: str
    skeleton: Skeleton
    poses: Array = field(repr=False)
    translations: Array = field(repr=False)
    fps: float
    first: int = 0
    notes: tuple[str, ...] = ()
    # the motion that this one is the reverse of, if it was made so
    _forwards: "Motion | None" = field(init=False, default=None, repr=False)

    def __post_init__(self) -> None:
        for name, columns in (("poses", ANGLES), ("translations", 3)):
            array = frozen(name, getattr(self, name), ("frames", columns))
            object.__setattr__(self, name, array)
        if len(self.poses) < 1:
            raise InputError("poses must contain at least 1 frame, got 0")
        if len(self.translations) != len(self.poses):
            raise InputError(
                f"translations must have shape {(len(self.poses), 3)}, "
                f"got {self.translations.shape}"
            )
        object.__setattr__(self, "fps", _rate(self.fps))

    def __len__(self) -> int:
        return len(self.poses)

    @property
    def joints(self) -> Array:
        """The joints (T, 27, 3) in the world, in metres."""
        return self.skeleton.joints(self.poses, self.translations)

    def frames(self, start: int, stop: int) -> "Motion":
        """Return frames `start` to `stop` - 1 as a motion.

        Raises:
            InputError: That leaves the clip, or is empty.
        """
        if not 0 <= start < stop <= len(self):
            raise InputError(
                f"frames must be 0 <= start < stop <= {len(self)}, "
                f"got start {start} and stop {stop}"
            )
        poses = self.poses[start:stop]
        translations = self.translations[start:stop]
        return replace(
            self, poses=poses, translations=translations, first=self.first + start
        )

    def turned(self, rotation: Array) -> "Motion":
        """Return the motion in a world that is turned by a rotation (3, 3)."""
        poses = self.poses.copy()
        turned = rotation @ rotation_from_root_angles(poses[:, :3])  # (T, 3, 3)
        poses[:, :3] = unwrapped(root_angles_from_rotation(turned))
        return replace(self, poses=poses, translations=self.translations @ rotation.T)

    def about_axes_of(self, skeleton: Skeleton) -> "Motion":
        """Return the same motion with joint angles about another skeleton's axes."""
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
            local = axes.T @ turns[joint] @ axes  # (T, 3, 3)
            poses[:, start : start + 3] = joint_angles_from_rotation(local)
        return replace(self, skeleton=own, poses=unwrapped(poses))

    def reversed(self) -> "Motion":
        """Return the motion backwards. Twice reversed, it is the same object again."""
        if self._forwards is not None:
            return self._forwards
        backwards = replace(
            self, poses=self.poses[::-1], translations=self.translations[::-1]
        )
        object.__setattr__(backwards, "_forwards", self)
        return backwards

    def first_at(self, fps: float) -> int:
        """Return the number that the first frame has at another rate."""
        return round(self.first / (self.fps / fps))

    def resampled(self, fps: float) -> "Motion":
        """Return the motion at another rate, at the times k / fps within it.

        If the old rate is a whole multiple k of the new one, every k-th frame is taken.
        Otherwise joint angles and translations are interpolated linearly, and the
        root's rotation along the shortest arc. `first` is the nearest whole number at
        the new rate.

        Raises:
            InputError: The rate is not allowed, or gives too many frames.
        """
        fps = _rate(fps)
        ratio = self.fps / fps
        step = round(ratio)
        first = self.first_at(fps)
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
                f"{self.name} must have at most {LONGEST} frames when it is resampled, "
                f"got {came}"
            )
        # in frames of this motion; the last time may be off by rounding
        times = np.minimum(np.arange(int(last / ratio + SAME_TIME) + 1) * ratio, last)
        if last == 0:
            return replace(self, fps=fps, first=first)
        poses = at_frames(self.poses, times)
        translations = at_frames(self.translations, times)
        # imported here because the import takes a quarter of a second
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
    """Return a series (T, ...) at times in frames, interpolated linearly."""
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
