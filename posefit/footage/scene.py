"""The `Scene` that a tracker gets, and how it is made from a known motion."""

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
from posefit.silhouette.drawn import uncounted
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette

# default camera around a known motion: 0 is in front of the person, 90 to the side
VIEW_DEGREES = 45.0
# keeps the random numbers of corruptions apart from a search with the same seed
RNG_STREAM_CORRUPTION = 2010
# cameras are the user's, a guess, or placed around a known motion
Placing = Literal["given", "guessed", "placed"]


@dataclass(frozen=True, eq=False)
class Scene:
    """The person, the cameras and the observations: all that a tracker gets."""

    name: str
    body: Body
    cameras: Sequence[Camera]
    fps: float  # frames per second
    count: int  # number of frames
    # radians: about which way the person faces in the first usable frame
    yaw: float | None
    anchor: Array  # (3,) metres: about where the person's root is then
    truth: Motion | None  # the known motion; None for footage
    observations: Sequence[Observation] = field(repr=False)
    placing: Placing = "placed"
    warnings: Sequence[str] = ()  # what a user should know before trusting a track
    guesses: Sequence[str] = ()  # what the sources do not state and posefit assumes
    # yields the first camera's video frames, at its size; None without a video
    pictures: Callable[[], Iterator[Image]] | None = field(default=None, repr=False)
    # number of the first frame in the footage, or in the whole motion
    first: int = 0
    camera_moves: bool = False  # whether the first camera seems to move
    # wall and CPU time that reading took
    reading_seconds: tuple[float, float] = (0.0, 0.0)

    @property
    def cameras_turn(self) -> bool:
        """Whether the tracker may turn cameras a little from their calibrations.

        Only the masks of several cameras show whether a calibration is inexact.
        """
        return len(self.cameras) > 1 and self.placing == "given"

    def motion(self, frames: Sequence[Frame]) -> Motion:
        """Return the tracked frames as a motion of the person."""
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
    """Return the scene of a known motion, with masks that are rasterised on demand.

    Args:
        motion: The motion, which becomes the scene's truth.
        views_degrees: Without `cameras`, one camera is placed at each of these angles
            around the person, so that it frames the whole motion. 0 is in front.
        size: Width and height of these cameras' pictures.
        cameras: Cameras to use instead.
        frames: Which frames of the motion to use, by their numbers.
        guesses: What was guessed about the cameras.

    Raises:
        InputError: A camera does not see the person in the first or the last frame.
    """
    body = Body.of(motion.skeleton)
    placing: Placing = "given" if cameras else "placed"
    motion = motion.frames(*span(frames, len(motion), motion.first))
    if not cameras:
        joints = motion.joints.reshape(-1, 3)
        radii = np.tile(body.joint_radii(), len(motion))
        azimuths = motion.poses[0, 0] + np.radians(views_degrees or [VIEW_DEGREES])
        cameras = [
            Camera.framing(joints, radii, float(azimuth), size) for azimuth in azimuths
        ]
    observations = rendered(motion, body, cameras)
    # only at both ends, because each frame that is checked must be rendered
    for k in (0, len(motion) - 1):
        if not all(silhouette.mask.any() for silhouette in observations[k].silhouettes):
            number = motion.first + k
            raise InputError(
                f"camera must see the person, got an empty mask in frame {number}"
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
    """Observations that `at(k)` makes on demand, for k from 0 to `frames` - 1."""

    frames: int
    at: Callable[[int], Observation] = field(repr=False)

    def __len__(self) -> int:
        return self.frames

    def __getitem__(self, k):  # type: ignore[no-untyped-def]
        if not 0 <= k < self.frames:
            raise IndexError(k)
        return self.at(k)


def rendered(motion: Motion, body: Body, cameras: Sequence[Camera]) -> LazyObservations:
    """Return the observations of a known motion, rasterised on demand."""
    return LazyObservations(len(motion), partial(_rendered, motion, body, cameras))


def _rendered(
    motion: Motion, body: Body, cameras: Sequence[Camera], k: int
) -> Observation:
    pose = motion.poses[k]
    translation = motion.translations[k]
    # rasterising the truth must not count as an evaluation of the search
    with uncounted():
        masks = [project(body, camera, pose, translation) for camera in cameras]
    return Observation([Silhouette.of(mask) for mask in masks], translation)


def observed_views(scene: Scene) -> list[View]:
    """Return a view of each camera of a scene, with all of its masks."""
    observations = list(scene.observations)
    numbers = scene.first + np.arange(scene.count)
    usable = np.array([each.usable for each in observations])
    views = list[View]()
    for k, camera in enumerate(scene.cameras):
        silhouettes = [each.silhouettes[k] for each in observations]
        view = View(
            name=scene.name,
            numbers=numbers,
            times=times_of(numbers, scene.fps),
            bits=np.array([np.packbits(silhouette.mask) for silhouette in silhouettes]),
            known=np.array(
                [np.packbits(silhouette.valid) for silhouette in silhouettes]
            ),
            usable=usable,
            size=(camera.width, camera.height),
            fps=scene.fps,
            states_numbers=True,
            warnings=scene.warnings,
            guesses=scene.guesses,
        )
        views.append(view)
    return views


def with_corruption(
    observations: Sequence[Observation],
    noise: dict[str, float],
    dropped: float,
    seed: int,
) -> LazyObservations:
    """Return observations that are corrupted on purpose, the same way for each seed.

    Args:
        observations: The clean observations.
        noise: Strength of each corruption by its name, see `corrupted`.
        dropped: Share of the frames that become unusable. The first frame never does.
        seed: Seed of the random numbers.
    """
    at = partial(_corrupted, observations, noise, dropped, seed)
    return LazyObservations(len(observations), at)


def _corrupted(
    observations: Sequence[Observation],
    noise: dict[str, float],
    dropped: float,
    seed: int,
    k: int,
) -> Observation:
    observation = observations[k]
    rng = np.random.default_rng([RNG_STREAM_CORRUPTION, seed, k])
    # a track starts from the first frame
    lost = k > 0 and rng.random() < dropped
    silhouettes = list[Silhouette]()
    for silhouette in observation.silhouettes:
        silhouettes.append(Silhouette.of(corrupted(silhouette.mask, noise, rng)))
    return replace(observation, silhouettes=silhouettes, usable=not lost)
