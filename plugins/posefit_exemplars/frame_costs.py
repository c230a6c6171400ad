"""The costs of poses in one frame, at full size and in a small picture."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array
from posefit.fitting.contours import POINT_SPACING, MaskContours
from posefit.fitting.cost import align
from posefit.fitting.landmarks import GROUPS, landmark_likelihoods, side_odds
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.camera import Camera
from posefit.geometry.symmetry import facing, mirrored_poses, reflected_poses
from posefit.silhouette.cost import known_views, pose_costs
from posefit.silhouette.mask import Areas, coarser_camera, coarser_silhouette

SIDE = 16  # pixels: sides of the smallest picture in which poses can be compared


def small_factor(cameras: Sequence[Camera]) -> int:
    """Return how many pixels across and down become one in a small picture."""
    sides = [side for camera in cameras for side in (camera.width, camera.height)]
    for factor in (4, 2):
        if min(sides) >= factor * SIDE:
            return factor
    return 1


class FrameCosts:
    """The costs of poses in one frame, and what the frame shows of the person.

    All stages of the tracker share it. Costs in the `small` picture are cheaper and
    coarser: it has every fourth pixel of every fourth row, or every second if it would
    be too small.

    Args:
        task: The task.
        observation: The silhouettes and landmarks of the frame.
        alone: Whether it is the only frame of a track.

    Attributes:
        camera_count: How many cameras show something of the person.
        camera_position: (3,) metres, the position of the only one of these. None if
            there are several, because they show depth, too.
        root: (3,) metres, or None if the root is unknown.
        earlier: The pose (66,) and the place (3,) that an earlier track reported, in a
            second pass over the frames; None in the first pass.
        small_share: The effort of a cost in the small picture, as a share of that of a
            cost at full size.
        usable: Whether the frame shows enough of the person.
        yaw: About which way the person faces, radians, or None if it is unknown.
    """

    def __init__(
        self, task: Task, observation: Observation, alone: bool = False
    ) -> None:
        self._task = task
        self.alone = alone
        self.observation = observation
        silhouettes = observation.silhouettes
        factor = small_factor(task.cameras)
        cameras = [coarser_camera(camera, factor) for camera in task.cameras]
        pictures = [
            coarser_silhouette(silhouette, factor) for silhouette in silhouettes
        ]
        self._scene = (task.body, task.cameras, silhouettes)
        self._small_scene = (task.body, cameras, pictures)
        self.small_share = 1.0 / factor**2
        # the cameras that show something of the person
        self._views = known_views(task.cameras, silhouettes)
        self.camera_count = len(self._views)
        self.skeleton = task.body.skeleton
        self.earlier = observation.estimate
        self.yaw = observation.yaw
        self.usable = observation.usable
        known = observation.translation if task.translation == "known" else None
        self.root = None if known is None else np.asarray(known, dtype=np.float64)
        self.camera_position: Array | None = None
        if self.camera_count == 1:
            self.camera_position = self._views[0].position

    def aligned(self, poses: Array, places: Array) -> Array:
        """Return the places (n, 3) of poses (n, 66).

        A known root gives the place. Otherwise it is the place near each of `places`
        (n, 3) at which the pose fits the silhouettes.
        """
        # a frame of a known motion may lack its root: `places` are then returned
        if self.root is not None or self._task.translation == "known":
            return self.at_root(places)
        return align(*self._scene, poses, places, self._task.threads)

    def at_root(self, places: Array) -> Array:
        """Return the known root n times (n, 3), or `places` (n, 3) if it is unknown."""
        if self.root is None:
            return places
        return np.repeat(self.root[None], len(places), axis=0)

    def small(self, poses: Array, places: Array) -> Array:
        """Return the costs (n,) of poses in the small picture."""
        return pose_costs(
            *self._small_scene, poses, places, threads=self._task.threads
        )[0]

    def full(self, poses: Array, places: Array) -> Array:
        """Return the costs (n,) of poses at full size."""
        return pose_costs(*self._scene, poses, places, threads=self._task.threads)[0]

    def landmarks(self, poses: Array, places: Array) -> Array:
        """Return the `landmark_likelihoods` (n, K, 2), 0 if there are no landmarks."""
        if self.observation.landmarks is None:
            return np.zeros((len(poses), len(GROUPS) * len(self._task.cameras), 2))
        return landmark_likelihoods(
            self.skeleton, self._task.cameras, self.observation.landmarks, poses, places
        )

    def side_odds(self, pose: Array, place: Array) -> Array | None:
        """Return how likely a pose (66,) has its sides as the landmarks show them.

        Returns:
            The logarithms of the odds (2,) for legs and for arms, or None if the frame
            has no landmarks.
        """
        marks = self.observation.landmarks
        if marks is None or not marks[..., 2].any():
            return None
        return side_odds(self.landmarks(pose[None], place[None])[0])

    def contours(self, place: Array) -> list[MaskContours]:
        """Return each view's mask contours, for a person at about `place` (3,)."""
        cameras = enumerate(self._task.cameras)
        frame = [self.observation]
        return [
            MaskContours.of(camera, view, frame, place[None], POINT_SPACING)
            for view, camera in cameras
        ]

    def cost_and_areas(self, pose: Array, place: Array) -> tuple[float, Areas]:
        """Return the cost of one pose, and its areas (views, 3)."""
        costs, areas = pose_costs(*self._scene, pose[None], place[None])
        return float(costs[0]), areas[:, 0]

    def reflected(self, poses: Array, place: Array) -> Array:
        """Return poses (n, 66) near `place` (3,), reflected along each line of sight.

        Returns:
            The reflected poses (cameras n, 66), camera by camera.
        """
        # each camera has its own line of sight, and so its own reflection
        reflected = []
        for view in self._views:
            camera_yaw = facing(view, place)
            reflected.append(reflected_poses(self.skeleton, poses, camera_yaw))
        return np.concatenate(reflected)

    def mirror_costs(self, pose: Array, place: Array) -> Array:
        """Return the costs of a pose's mirror image and reflections (1 + cameras,).

        There is one reflection along each camera's line of sight.
        """
        poses = pose[None]
        poses = np.concatenate(
            [poses, mirrored_poses(self.skeleton, poses), self.reflected(poses, place)]
        )
        places = self.aligned(poses, np.repeat(place[None], len(poses), axis=0))
        return self.full(poses[1:], place + places[1:] - places[0])
