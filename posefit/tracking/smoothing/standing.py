"""Legs of people who stand in front of one camera, as straight as the masks allow.

A silhouette does not show how far a leg reaches towards the camera, so the tracker
bends knees as in the library. There, even standing people have bent knees, because
bones of recorded skeletons are a little too long for the distance from hip to ankle
(docs/measured/footage.md). If straighter legs explain the masks as well, once the
person is moved away from the camera to match, they are kept.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.cost import align
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import BONES, Skeleton, channel_angles
from posefit.motion.steadiness import runs
from posefit.tracking.smoothing.contours import Borders
from posefit.tracking.smoothing.path import Visibility, standing_feet
from posefit.tracking.smoothing.smooth import Smoothed, moved, smooth
from posefit.tracking.trajectory import mean_cost

# Longer than the stance of a walk, which takes 0.6 to 0.7 seconds.
STANDING_SECONDS = 0.8
# How much nearer the ankle of a standing person is to the hip in the library than in
# reality, as a share: half of the library's people keep their knees bent by 28 degrees
# or more (docs/studies/knees.py --library).
NEARER = 0.03
# Radians: knees of standing people are bent by 0 to 5 degrees (Perry and Burnfield,
# Gait Analysis, Normal and Pathological Function, 2nd edition, 2010).
STRAIGHT = np.radians(5.0)
# Factor on the mean cost of masks. Straighter legs that cost more are wrong: the masks
# show bent ones.
EQUAL_COST = 1.05
# The indices in a pose of the flexions of each leg's hip, knee and ankle: the first
# angle of each bone of a leg.
FLEXIONS = [
    [channel_angles(side + bone, ["rx"])[0] for bone in ("femur", "tibia", "foot")]
    for side in "lr"
]


def with_straight_legs(
    tracked: Smoothed, smoothed: Smoothed, beta: float, borders: Borders
) -> tuple[Sequence[Frame], Smoothed]:
    """Return the tracked and the smoothed frames, with straighter legs if they fit.

    Args:
        tracked: The tracked frames, with the scene and the build before smoothing.
        smoothed: The same, smoothed.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
        borders: The borders of the scene's masks.
    """
    free = tracked.scene.body.skeleton.free
    standing = standing_long(smoothed)
    # the legs of a given skeleton may have other axes
    if not free[FLEXIONS].all() or not standing.any():
        return tracked.frames, smoothed
    straight = list(tracked.frames)
    for k in np.flatnonzero(standing).tolist():
        straight[k] = _straighter(tracked.scene, k, straight[k])
    again = smooth(tracked.scene, straight, tracked.shape, beta, borders)
    before, after = (mean_cost(result.frames, standing) for result in (smoothed, again))
    if after > EQUAL_COST * before:
        return tracked.frames, smoothed
    return straight, again


def standing_long(smoothed: Smoothed) -> NDArray[np.bool_]:
    """Return the usable frames (T,) of stances that are longer than in a walk."""
    scene = smoothed.scene
    visibility = Visibility.of(scene)
    motion = scene.motion(smoothed.frames)
    feet = standing_feet(motion.joints, motion.fps, visibility.viewpoints)
    standing = np.zeros(len(motion), dtype=bool)
    for foot in feet.T:
        for start, stop in runs(foot):
            if stop - start >= STANDING_SECONDS * motion.fps:
                standing[start:stop] = True
    return standing & visibility.usable


def _straighter(scene: Scene, k: int, frame: Frame) -> Frame:
    """Return frame k with straighter legs, moved away from the camera to match.

    The person moves by the difference of the two places, before and after, at which
    the body fills the silhouettes' boxes.
    """
    pose = straightened(scene.body.skeleton, frame.pose)
    places = align(
        scene.body,
        scene.cameras,
        scene.observations[k].silhouettes,
        np.stack([frame.pose, pose]),
        np.stack([frame.translation, frame.translation]),
    )
    place = frame.translation + places[1] - places[0]
    return moved(frame, pose, place, frame.cost, frame.areas)


def straightened(skeleton: Skeleton, pose: Array) -> Array:
    """Return a pose (66,) with ankles farther from the hips by the share `NEARER`.

    Knees bend less, or not at all. Ankles stay on their line from the hip, and feet
    keep their directions.
    """
    pose = pose.copy()
    lengths = skeleton.lengths
    for side, (hip, knee, ankle) in zip("lr", FLEXIONS, strict=True):
        thigh, shank = (
            lengths[BONES.index(side + bone)] for bone in ("femur", "tibia")
        )
        bent = pose[knee]
        squares = thigh**2 + shank**2
        twice = 2.0 * thigh * shank
        # the law of cosines, for the distance from the hip to the ankle
        far = (1.0 + NEARER) ** 2 * (squares + twice * np.cos(bent))
        less = np.arccos(np.clip((far - squares) / twice, -1.0, 1.0))
        less = min(bent, max(less, STRAIGHT))
        # between the thigh and the line from the hip to the ankle
        before, after = (
            np.arctan2(shank * np.sin(flexion), thigh + shank * np.cos(flexion))
            for flexion in (bent, less)
        )
        pose[hip] += before - after
        pose[knee] = less
        pose[ankle] += bent - less - (before - after)
    return pose
