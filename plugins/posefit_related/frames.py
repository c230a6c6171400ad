"""Functions that the trackers share: costs of poses, first poses, finished frames."""

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit import pose_costs
from posefit.plugin import Array, Frame, Observation, Task, project
from posefit_related.training import training_poses

YAW_REACH = np.radians(45.0)  # ours: to either side of a known first yaw


def costs_of(
    task: Task, observation: Observation, poses: Array, places: Array
) -> Array:
    """Return the costs (n,) of poses (n, 66) with their root at places (n, 3).

    SAPSO (4).
    """
    costs, _ = pose_costs(
        task.body, task.cameras, observation.silhouettes, poses, places
    )
    return costs


def first_poses(task: Task, rng: np.random.Generator, count: int) -> Array:
    """Return poses (count, 66) to begin with in a first frame.

    They are random training poses, or the known first pose. Their yaws are near the
    known yaw, or random.
    """
    poses = training_poses(task)
    poses = poses[rng.integers(len(poses), size=count)]
    if task.first_pose is not None:
        poses[:, 1:3] = 0.0
        poses[:, 3:] = task.first_pose
    middle = 0.0
    reach = np.pi
    if task.yaw is not None:
        middle = task.yaw
        reach = YAW_REACH
    poses[:, 0] = middle + rng.uniform(-reach, reach, count)
    return poses


def squared_distances(first: Array, second: Array) -> Array:
    """Return the squared distances (n, k) of points (n, D) from others (k, D)."""
    squares = (
        (first**2).sum(axis=1)[:, None]
        + (second**2).sum(axis=1)
        - 2.0 * first @ second.T
    )
    return np.asarray(np.maximum(squares, 0.0))


def frame_of(
    task: Task, observation: Observation, pose: Array, place: Array, evaluations: int
) -> Frame:
    """Return the frame of a pose (66,) at a place (3,). Its cost is one evaluation."""
    costs, counts = pose_costs(
        task.body, task.cameras, observation.silhouettes, pose[None], place[None]
    )
    return Frame(pose, place, float(costs[0]), counts[:, 0], evaluations + 1)


def place_of(
    task: Task, observation: Observation, pose: Array, place: Array
) -> tuple[Array, int]:
    """Return the place (3,) of the root, and the number of poses drawn to estimate it.

    A known place is returned unchanged. Otherwise the mask of the first view that shows
    something is compared with the drawn pose at `place`. The ratio of their heights
    gives the depth, and the offset of their centres the direction.
    """
    if observation.translation is not None:
        return np.array(observation.translation, dtype=np.float64), 0
    for camera, silhouette in zip(task.cameras, observation.silhouettes, strict=True):
        mask = _box(silhouette.mask)
        drawn = _box(project(task.body, camera, pose, place))
        if mask is not None and drawn is not None:
            at = camera.rotation @ place + camera.translation
            depth = at[2] * (drawn[1] / mask[1])[1]
            pixel = (
                mask[0] + (camera.project(place[None])[0][0] - drawn[0]) * at[2] / depth
            )
            at = np.append((pixel - camera.centre) / camera.focal * depth, depth)
            return np.asarray(camera.rotation.T @ (at - camera.translation)), 1
    return place, 1


def _box(mask: NDArray[np.bool_]) -> tuple[Array, Array] | None:
    """Return centre (2,) and size (2,) of a mask's bounding box, or None if empty.

    Both are in columns and rows.
    """
    left, top, width, height = cv2.boundingRect(np.asarray(mask, dtype=np.uint8))
    size = np.array([width, height], dtype=np.float64)
    if not width:
        return None
    return np.array([left, top]) + size / 2.0, size
