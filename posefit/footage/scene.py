"""A scene: the person, the cameras and their observations, of a known motion or of footage."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Observation
from posefit.footage.masks import Range, Views, span
from posefit.footage.quality import disagreement, extent_of, meeting
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion.motion import Motion
from posefit.silhouette.corruption import corrupted
from posefit.silhouette.cost import project
from posefit.silhouette.cuda.device import check_device, moved_to
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette

VIEW_DEGREES = 45.0  # default place of the camera of a synthetic sequence: 0 is in front, 90 to the side
RNG_STREAM_CORRUPTION = 2010
Placing = Literal["given", "guessed", "placed"]  # cameras are the user's, a guess, or set up around a known motion


@dataclass(frozen=True, eq=False)
class Scene:
    """What a tracker gets, whatever it came from: the person, the cameras, and the observations."""

    name: str
    body: Body
    cameras: Sequence[Camera]
    fps: float
    count: int
    yaw: float | None  # radians: about where the person faces at first
    anchor: Array  # (3,) metres: about where the root is at first
    truth: Motion | None
    observations: Sequence[Observation] = field(repr=False)
    placing: Placing = "placed"
    warnings: Sequence[str] = ()  # what a user should know before they trust it
    # yields the first camera's video frames, of its size; None where there is no video
    pictures: Callable[[], Iterator[Image]] | None = field(default=None, repr=False)


def synthetic(
    motion: Motion,
    views_degrees: Sequence[float],
    size: tuple[int, int],
    cameras: Sequence[Camera],
    frames: Range,
) -> Scene:
    """Return the scene of a known motion; its masks are drawn frame by frame as they are needed.

    Without cameras there is one at each of `views_degrees`, which frames the whole motion.
    """
    body = Body.of(motion.skeleton)
    placing: Placing = "given" if cameras else "placed"
    motion = motion.frames(*span(frames, len(motion)))
    if not cameras:
        joints = motion.skeleton.joints(motion.poses, motion.translations).reshape(-1, 3)
        radii = np.tile(body.joint_radii(), len(motion))
        azimuths = motion.poses[0, 0] + np.radians(views_degrees or [VIEW_DEGREES])
        cameras = [Camera.framing(joints, radii, float(azimuth), size) for azimuth in azimuths]
    observations = Rendered(motion, body, cameras)
    for k in (0, len(motion) - 1):
        if not all(silhouette.mask.any() for silhouette in observations[k].silhouettes):
            raise InputError(f"camera must see the person, got an empty mask in frame {k}")
    return Scene(
        motion.name,
        body,
        cameras,
        motion.fps,
        len(motion),
        float(motion.poses[0, 0]),
        motion.translations[0],
        motion,
        observations,
        placing,
    )


@dataclass(frozen=True, eq=False)
class Rendered(Sequence[Observation]):
    """The observations of a known motion, drawn when they are needed."""

    motion: Motion
    body: Body
    cameras: Sequence[Camera]

    def __len__(self) -> int:
        return len(self.motion)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if not 0 <= k < len(self):
            raise IndexError(k)
        pose, translation = self.motion.poses[k], self.motion.translations[k]
        masks = [project(self.body, camera, pose, translation) for camera in self.cameras]
        return Observation([Silhouette.of(mask) for mask in masks], translation)


@dataclass(frozen=True, eq=False)
class DeviceObservations(Sequence[Observation]):
    """The same observations, their silhouettes on a device: poses are drawn and counted there."""

    observations: Sequence[Observation]
    device: str

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        observation = self.observations[k]
        moved = [moved_to(silhouette, self.device) for silhouette in observation.silhouettes]
        return replace(observation, silhouettes=moved)


def on_device(scene: Scene, device: str) -> Scene:
    """Return a scene whose poses are drawn on a device, "cpu" or "cuda". Raises InputError where there is none."""
    check_device(device)
    return scene if device == "cpu" else replace(scene, observations=DeviceObservations(scene.observations, device))


@dataclass(frozen=True, eq=False)
class CorruptedObservations(Sequence[Observation]):
    """Observations with corruptions of some strength, and a share of the frames dropped; the same each time."""

    observations: Sequence[Observation] = field(repr=False)
    noise: dict[str, float]
    dropped: float
    seed: int

    def __len__(self) -> int:
        return len(self.observations)

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        observation = self.observations[k]
        rng = np.random.default_rng([RNG_STREAM_CORRUPTION, self.seed, k])
        lost = k > 0 and rng.random() < self.dropped
        masks = [corrupted(silhouette.mask, self.noise, rng) for silhouette in observation.silhouettes]
        return replace(observation, silhouettes=[Silhouette.of(mask) for mask in masks], usable=not lost)

    def __iter__(self) -> Iterator[Observation]:
        return (self[k] for k in range(len(self)))


def observed(
    views: Views,
    body: Body,
    cameras: Sequence[Camera],
    name: str,
    fps: float,
    view_degrees: float | None,
    pictures: Callable[[], Iterator[Image]] | None = None,
    placing: Placing = "given",
    warnings: Sequence[str] = (),
) -> Scene:
    """Return the scene of masks, whose true poses are unknown.

    The person is first searched where the rays through the middles of the masks meet; with a single camera, as far away
    as their size in the image implies. Raises InputError where several cameras cannot see one person of this size.
    """
    boxes = [extent_of(silhouette) for silhouette in views[views.first].silhouettes]
    if len(cameras) == 1:
        camera, (middle, tall) = cameras[0], boxes[0]
        depth = camera.focal[1] * body.stature / tall
        place = np.array([*((middle - camera.centre) / camera.focal * depth), depth])
        anchor = camera.rotation.T @ (place - camera.translation)
    else:
        if wrong := disagreement(views, cameras, body.stature):
            raise InputError(f"{name}: {wrong}")
        anchor = meeting(cameras, [middle for middle, _ in boxes])[0]
    to_camera = -cameras[0].rotation[2]
    yaw = views.yaw(views.first)
    if view_degrees is not None:
        yaw = float(np.arctan2(to_camera[0], to_camera[2]) - np.radians(view_degrees))
    return Scene(name, body, cameras, fps, len(views), yaw, anchor, None, views, placing, warnings, pictures)
