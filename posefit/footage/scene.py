"""A scene: the person, the cameras and their observations, of a known motion or of footage."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.views import Range, View, span, times_of
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion.motion import Motion
from posefit.silhouette.corruption import corrupted
from posefit.silhouette.cost import project
from posefit.silhouette.cuda.device import check_device, moved_to
from posefit.silhouette.drawn import uncounted
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette

# default place of the camera of a synthetic sequence: 0 is in front, 90 to the side
VIEW_DEGREES = 45.0
RNG_STREAM_CORRUPTION = 2010
# cameras are the user's, a guess, or set up around a known motion
Placing = Literal["given", "guessed", "placed"]


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
    guesses: Sequence[str] = ()  # what the sources do not state, and posefit assumes
    # yields the first camera's video frames, of its size; None where there is no video
    pictures: Callable[[], Iterator[Image]] | None = field(default=None, repr=False)
    # the number of the first frame in the footage, or in the whole motion
    first: int = 0
    camera_moves: bool = False  # whether the first camera seems to
    # wall and CPU time that it took to read
    reading_seconds: tuple[float, float] = (0.0, 0.0)

    @property
    def cameras_turn(self) -> bool:
        """Whether cameras may be turned a little from their calibrations, which several masks show to be off."""
        return len(self.cameras) > 1 and self.placing == "given"

    def motion(self, frames: Sequence[Frame]) -> Motion:
        """Return the person's motion that some frames estimate."""
        poses = np.array([frame.pose for frame in frames])
        places = np.array([frame.translation for frame in frames])
        return Motion(
            self.name, self.body.skeleton, poses, places, self.fps, self.first
        )


def synthetic(
    motion: Motion,
    views_degrees: Sequence[float],
    size: tuple[int, int],
    cameras: Sequence[Camera],
    frames: Range,
    guesses: Sequence[str] = (),
) -> Scene:
    """Return the scene of a known motion; its masks are drawn frame by frame as they are needed.

    Without cameras there is one at each of `views_degrees`, which frames the whole motion.
    """
    body = Body.of(motion.skeleton)
    placing: Placing = "given" if cameras else "placed"
    motion = motion.frames(*span(frames, len(motion)))
    if not cameras:
        joints = motion.joints.reshape(-1, 3)
        radii = np.tile(body.joint_radii(), len(motion))
        azimuths = motion.poses[0, 0] + np.radians(views_degrees or [VIEW_DEGREES])
        cameras = [
            Camera.framing(joints, radii, float(azimuth), size) for azimuth in azimuths
        ]
    observations = rendered(motion, body, cameras)
    for k in (0, len(motion) - 1):
        if not all(silhouette.mask.any() for silhouette in observations[k].silhouettes):
            raise InputError(
                f"camera must see the person, got an empty mask in frame {k}"
            )
    return Scene(
        name=motion.name,
        body=body,
        cameras=cameras,
        fps=motion.fps,
        count=len(motion),
        yaw=float(motion.poses[0, 0]),
        anchor=motion.translations[0],
        truth=motion,
        observations=observations,
        placing=placing,
        warnings=motion.notes,
        guesses=guesses,
        first=motion.first,
    )


@dataclass(frozen=True, eq=False)
class LazyObservations(Sequence[Observation]):
    """Observations of so many frames, each made by `at(k)` when it is needed."""

    frames: int
    at: Callable[[int], Observation] = field(repr=False)

    def __len__(self) -> int:
        return self.frames

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if not 0 <= k < self.frames:
            raise IndexError(k)
        return self.at(k)


def rendered(motion: Motion, body: Body, cameras: Sequence[Camera]) -> LazyObservations:
    """Return the observations of a known motion."""
    return LazyObservations(len(motion), partial(_rendered, motion, body, cameras))


def _rendered(
    motion: Motion, body: Body, cameras: Sequence[Camera], k: int
) -> Observation:
    pose = motion.poses[k]
    translation = motion.translations[k]
    with uncounted():  # to show a known motion is no evaluation
        masks = [project(body, camera, pose, translation) for camera in cameras]
    return Observation([Silhouette.of(mask) for mask in masks], translation)


def observed_views(scene: Scene) -> list[View]:
    """Return what the cameras of a scene saw."""
    observations = list(scene.observations)
    numbers = scene.first + np.arange(scene.count)
    return [
        View(
            scene.name,
            numbers,
            times_of(numbers, scene.fps),
            np.array([np.packbits(each.silhouettes[k].mask) for each in observations]),
            np.array([np.packbits(each.silhouettes[k].valid) for each in observations]),
            np.array([each.usable for each in observations]),
            (camera.width, camera.height),
            fps=scene.fps,
            counted=True,
            warnings=scene.warnings,
            guesses=scene.guesses,
        )
        for k, camera in enumerate(scene.cameras)
    ]


def on_device(scene: Scene, device: str) -> Scene:
    """Return a scene whose poses are drawn on a device, "cpu" or "cuda". Raises InputError where there is none."""
    check_device(device)
    if device == "cpu":
        return scene
    return replace(
        scene,
        observations=LazyObservations(
            scene.count, partial(_moved, scene.observations, device)
        ),
    )


def _moved(observations: Sequence[Observation], device: str, k: int) -> Observation:
    silhouettes = [moved_to(mask, device) for mask in observations[k].silhouettes]
    return replace(observations[k], silhouettes=silhouettes)


def with_corruption(
    observations: Sequence[Observation],
    noise: dict[str, float],
    dropped: float,
    seed: int,
) -> LazyObservations:
    """Return observations with corruptions of some strength, and a share of the frames dropped; the same each time."""
    return LazyObservations(
        len(observations), partial(_corrupted, observations, noise, dropped, seed)
    )


def _corrupted(
    observations: Sequence[Observation],
    noise: dict[str, float],
    dropped: float,
    seed: int,
    k: int,
) -> Observation:
    observation = observations[k]
    rng = np.random.default_rng([RNG_STREAM_CORRUPTION, seed, k])
    lost = k > 0 and rng.random() < dropped
    masks = [
        corrupted(silhouette.mask, noise, rng) for silhouette in observation.silhouettes
    ]
    return replace(
        observation,
        silhouettes=[Silhouette.of(mask) for mask in masks],
        usable=not lost,
    )
