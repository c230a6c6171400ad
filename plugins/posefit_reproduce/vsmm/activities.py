"""The VSMM patent's test sequence, re-created with a known truth.

The patent's recording is not public. Here its four activities are built-in motions with
random phase, speed and view for each seed. No motion model was fitted to them. A few
frames blend one activity into the next.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Observation
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image, mean_background, people
from posefit.silhouette.mask import Silhouette

SIZE = (320, 240)
FPS = 30.0
EMPTY = 100  # frames of the empty scene, for the mean background
BLEND = 8  # frames between two activities
DISTANCE = 4.6  # metres from the camera
# largest angle between the view and the front, to either side, in radians
SIDEWAYS = 0.3
SPEEDS = (0.9, 1.1)
GRAIN = 4.0  # standard deviation of a pixel from frame to frame, in grey levels


@dataclass(frozen=True)
class Activity:
    """A part of the sequence, and the motion models that describe it."""

    label: str
    motion: str
    frames: int
    models: frozenset[str]


ACTIVITIES = (
    Activity("stepping on the spot", "step-b", 120, frozenset({"stiff-walk", "walk"})),
    Activity("waving and striding", "wave-b", 130, frozenset({"walk", "arms-out"})),
    Activity("jumping jacks", "jacks-b", 140, frozenset({"jacks"})),
    Activity("squat", "squat-b", 60, frozenset({"squat"})),
)
# for priors: no motion of the sequence
TRAINING = (
    *("walk-a", "step-a", "arms-out-a", "wave-a"),
    *("jacks-a", "squat-a", "jump-a", "march-a"),
)


@dataclass(frozen=True, eq=False)
class Film:
    """A film and its truth."""

    truth: Motion
    body: Body
    camera: Camera
    labels: list[int]  # (T,) number of the activity
    rng: np.random.Generator = field(repr=False)  # for the pixels' noise

    @cached_property
    def observations(self) -> list[Observation]:
        """The mask of every frame, segmented by the mean background of the scene."""
        empty, film = _images(self.truth, self.body, self.camera, self.rng)
        background = mean_background(empty)
        observations = []
        for image in film:
            person = people(*background.segment(image), None, None)[0]
            observations.append(Observation([Silhouette.of(person.mask)]))
        return observations

    @property
    def switches(self) -> list[int]:
        """The frames in which a new activity begins."""
        switches = []
        for frame, (before, after) in enumerate(pairwise(self.labels), 1):
            if after != before:
                switches.append(frame)
        return switches


@lru_cache(maxsize=1)  # all methods track the film of one seed before the next
def film_of(seed: int, activities: Sequence[Activity] = ACTIVITIES) -> Film:
    """Return the film for a seed."""
    rng = np.random.default_rng(seed)
    poses_of_parts = []
    places_of_parts = []
    lengths = []
    for activity in activities:
        part = built_in.motion(
            activity.motion,
            frames=activity.frames,
            fps=FPS,
            speed=rng.uniform(*SPEEDS),
            phase=rng.random(),
        )
        poses_of_parts.append(part.poses)
        # striding, but on the spot
        places_of_parts.append(part.translations * [1.0, 1.0, 0.0])
        lengths.append(len(part))
    poses = np.concatenate(poses_of_parts)
    places = np.concatenate(places_of_parts)
    labels = np.repeat(np.arange(len(lengths)), lengths).tolist()
    # without a blend, the person would jump into the next activity within one frame
    for first in np.cumsum(lengths)[:-1]:
        away = wrapped(poses[first : first + BLEND] - poses[first - 1])
        moved = places[first : first + BLEND]
        share = (np.arange(1, BLEND + 1) / (BLEND + 1))[:, None]
        poses[first : first + BLEND] = poses[first - 1] + share * away
        places[first : first + BLEND] = places[first - 1] + share * (
            moved - places[first - 1]
        )
    truth = Motion("patent", built_in.average_skeleton(), poses, places, FPS)
    body = Body.of(truth.skeleton)
    camera = Camera.around(
        np.array([0.0, 1.05, 0.0]), rng.uniform(-SIDEWAYS, SIDEWAYS), DISTANCE, SIZE
    )
    return Film(truth, body, camera, labels, rng)


def _images(
    truth: Motion, body: Body, camera: Camera, rng: np.random.Generator
) -> tuple[Iterator[Image], Iterator[Image]]:
    """Return frames of the empty scene, and frames of the person in front of it.

    The scene is a wall; the clothes have other colours.
    """
    width = camera.width
    height = camera.height
    across, down = np.meshgrid(
        np.linspace(0.0, 1.0, width), np.linspace(0.0, 1.0, height)
    )
    wall = np.stack(
        [
            150.0 + 40.0 * across,
            160.0 - 30.0 * down,
            140.0 + 20.0 * np.sin(9.0 * across),
        ],
        axis=-1,
    )
    clothes = np.where(down[..., None] < 0.55, [60.0, 50.0, 170.0], [130.0, 60.0, 40.0])

    def noisy(image: Array) -> Image:
        grain = GRAIN * rng.standard_normal(image.shape, dtype=np.float32)
        return np.asarray(np.clip(image + grain, 0.0, 255.0).astype(np.uint8))

    def empty() -> Iterator[Image]:
        for _ in range(EMPTY):
            yield noisy(wall)

    def filmed() -> Iterator[Image]:
        for pose, place in zip(truth.poses, truth.translations, strict=True):
            mask = project(body, camera, pose, place)
            yield noisy(np.where(mask[..., None], clothes, wall))

    return empty(), filmed()
