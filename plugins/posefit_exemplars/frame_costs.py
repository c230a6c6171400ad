"""The costs of poses in one frame, at full size and in a small picture."""

import numpy as np

from posefit.arrays import Array
from posefit.fitting.contours import POINT_SPACING, MaskContours
from posefit.fitting.cost import align
from posefit.fitting.landmarks import GROUPS, landmark_likelihoods, side_odds
from posefit.fitting.tracker import Observation, Task
from posefit.geometry.symmetry import facing, mirrored_poses, reflected_poses
from posefit.silhouette.cost import known_views, pose_costs
from posefit.silhouette.mask import Areas, coarser_camera, coarser_silhouette

MIN_SMALL_SIDE = 40  # pixels: no side of a small picture is shorter
SMALL_FACTORS = (4, 2, 1)


class FrameCosts:
    """The silhouettes of one frame. `small` costs are of a picture with every fourth pixel of every fourth row."""

    def __init__(
        self, task: Task, observation: Observation, alone: bool = False
    ) -> None:
        self._task = task
        self.alone = alone  # the only frame of a track
        self.observation = observation
        silhouettes = observation.silhouettes
        side = min(
            side for camera in task.cameras for side in (camera.width, camera.height)
        )
        factor = next(
            (factor for factor in SMALL_FACTORS if side >= factor * MIN_SMALL_SIDE), 1
        )
        cameras = [coarser_camera(camera, factor) for camera in task.cameras]
        pictures = [
            coarser_silhouette(silhouette, factor) for silhouette in silhouettes
        ]
        self._scene = (task.body, task.cameras, silhouettes)
        self._small_scene = (task.body, cameras, pictures)
        # effort of a cost in the small picture, as a share of one at full size
        self.small_share = 1.0 / factor**2
        self._views = known_views(task.cameras, silhouettes)
        # of cameras that show something
        self.skeleton, self.camera_count = task.body.skeleton, len(self._views)
        self.yaw = observation.yaw
        self.usable = observation.usable
        known = observation.translation if task.translation == "known" else None
        # (3,) metres, where it is known
        self.root = None if known is None else np.asarray(known, dtype=np.float64)
        # (3,) of the only camera that shows the person; None with several, which also show the depth
        self.camera_position: Array | None = (
            self._views[0].position if self.camera_count == 1 else None
        )

    def aligned(self, poses: Array, places: Array) -> Array:
        """Return the places (n, 3) of poses (n, 66): of the known root, or those near `places` (n, 3) that fit."""
        if self.root is not None or self._task.translation == "known":
            return self.at_root(places)
        return align(*self._scene, poses, places)

    def at_root(self, places: Array) -> Array:
        """Return the known place of the root, once for each of `places` (n, 3); else these."""
        return (
            places
            if self.root is None
            else np.repeat(self.root[None], len(places), axis=0)
        )

    def small(self, poses: Array, places: Array) -> Array:
        """Return the costs (n,) of poses in the small picture."""
        return pose_costs(
            *self._small_scene, poses, places, threads=self._task.threads
        )[0]

    def full(self, poses: Array, places: Array) -> Array:
        """Return the costs (n,) of poses."""
        return pose_costs(*self._scene, poses, places, threads=self._task.threads)[0]

    def landmarks(self, poses: Array, places: Array) -> Array:
        """Return the `landmark_likelihoods` (n, K, 2) of poses: 0 where the frame has no landmarks."""
        if self.observation.landmarks is None:
            return np.zeros((len(poses), len(GROUPS) * len(self._task.cameras), 2))
        return landmark_likelihoods(
            self.skeleton, self._task.cameras, self.observation.landmarks, poses, places
        )

    def side_odds(self, pose: Array, place: Array) -> Array | None:
        """Return the logarithms of the odds (2,) that legs, and arms, are as in a pose (66,), by all landmarks."""
        marks = self.observation.landmarks
        known = marks is not None and marks[..., 2].any()
        return side_odds(self.landmarks(pose[None], place[None])[0]) if known else None

    def contours(self, place: Array) -> list[MaskContours]:
        """Return the contours of the masks in each view, of a person whose root is about at `place` (3,)."""
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
        """Return poses (n, 66) at about `place` (3,) reflected along each line of sight (cameras n, 66)."""
        return np.concatenate(
            [
                reflected_poses(self.skeleton, poses, facing(view, place))
                for view in self._views
            ]
        )

    def mirror_costs(self, pose: Array, place: Array) -> Array:
        """Return the costs (1 + cameras,) of a pose's mirror image, and of its reflection along each line of sight."""
        poses = pose[None]
        poses = np.concatenate(
            [poses, mirrored_poses(self.skeleton, poses), self.reflected(poses, place)]
        )
        places = self.aligned(poses, np.repeat(place[None], len(poses), axis=0))
        return self.full(poses[1:], place + places[1:] - places[0])
