"""What a drawn body's border hangs on, and how that changes with the pose, the root's place, and the person's build."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.fitting.shape import NAMES, shaped
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS, PARENTS
from posefit.silhouette.rasteriser import NEAR

STARTS = np.array(PARENTS[1:])  # the joint that each bone starts from
NUMBERS = 2 * len(JOINTS) + 2 * len(BONES)  # of a drawn body: pixels of joints, then radii of bones
STEP = 1e-4  # radians, metres, or of the logarithm of a factor: of a difference quotient


def drawn_numbers(body: Body, camera: Camera, poses: Array, places: Array) -> Array:
    """Return where the joints (T, 106) of poses (T, 66) are in the picture, and how wide the bones' ends, in pixels.

    A joint that is nearer than 5 cm, or behind the camera, counts as that far.
    """
    seen = body.skeleton.joints(poses, places) @ camera.rotation.T + camera.translation
    far = np.maximum(seen[..., 2:], NEAR)
    pixels = seen[..., :2] / far * camera.focal + camera.centre
    metres = np.sqrt(camera.focal.prod()) / far[..., 0]
    radii = np.stack([metres[:, STARTS] * body.radii[:, 0], metres[:, 1:] * body.radii[:, 1]], axis=-1)
    return np.concatenate([pixels.reshape(len(poses), -1), radii.reshape(len(poses), -1)], axis=1)


def drawn_slopes(body: Body, camera: Camera, poses: Array, places: Array, angles: Sequence[int]) -> Array:
    """Return how those numbers change with the root's place and some angles (T, 106, 3 + angles)."""
    count = 3 + len(angles)
    turned, moved = np.repeat(poses[None], count, axis=0), np.repeat(places[None], count, axis=0)
    for k in range(3):
        moved[k, :, k] += STEP
    for k, angle in enumerate(angles, 3):
        turned[k, :, angle] += STEP
    there = drawn_numbers(body, camera, turned.reshape(-1, ANGLES), moved.reshape(-1, 3))
    changes = there.reshape(count, len(poses), NUMBERS) - drawn_numbers(body, camera, poses, places)
    return np.ascontiguousarray(np.moveaxis(changes, 0, 2)) / STEP


def build_slopes(body: Body, camera: Camera, poses: Array, places: Array, height: float | None) -> Array:
    """Return how those numbers change with the logarithms of the factors of the build (T, 106, 17)."""
    here = drawn_numbers(body, camera, poses, places)
    bodies = [shaped(body, np.exp(STEP * row), height) for row in np.eye(len(NAMES))]
    there = [drawn_numbers(other, camera, poses, places) for other in bodies]
    return (np.stack(there, axis=2) - here[:, :, None]) / STEP
