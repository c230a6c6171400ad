"""Instances, numbered as in other benchmarks: a number and an environment's arguments are a person and its images.

The motion, its speed and phase, and the camera's azimuth are those of a sweep's instance of that number.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from functools import cached_property, lru_cache
from typing import Any, TypedDict

import numpy as np
from gymnasium import error
from numpy.typing import NDArray

from posefit import Body, Camera, Motion, Observation, PoseProblem, SearchSpace, Silhouette, Task
from posefit.arrays import Array
from posefit.fitting.check import finite_number
from posefit.fitting.metrics import pose_error_degrees
from posefit.fitting.prior import Prior
from posefit.fitting.space import ROOT_RANGE_DEGREES, TRANSLATIONS, Translation
from posefit.footage.instance import motion_of_instance, variation
from posefit.footage.source import motion_of
from posefit.geometry.body import varied
from posefit.motion import built_in
from posefit.reading import quoted
from posefit.registry import registry
from posefit.silhouette.corruption import CORRUPTIONS, corrupted
from posefit.silhouette.cost import project

SPLITS = {"train": (0, 10_000), "test": (10_000, 20_000)}  # instance numbers; those of the test split are held out
RNG_STREAM = 2012  # part of the seed of noise, yaw and build of an instance
FPS = 30.0
SIZE = (64, 48)  # pixels
YAW_DEGREES = 20.0  # largest difference between the middle of the searched yaw and the truth
DISTANCE, HEIGHT = 3.5, 0.9  # metres from camera to person; of the camera above the ground
BODY = 0xFF00 if sys.byteorder == "little" else 0x00FF  # the byte of a pixel's pair that shows the body
OBSERVED = 0xFFFF ^ BODY

Image = NDArray[np.uint8]  # (height, width, 2 views): observed, body, observed, body, ...
Views = float | Sequence[float]


class ArgumentError(error.Error, ValueError):
    """An argument of an environment is not what it must be."""


@dataclass(frozen=True)
class World:
    """The arguments of an environment that decide what its instances are, checked: names and numbers, as in JSON."""

    motion: str = "walk"
    view_degrees: tuple[float, ...] = (45.0,)
    prior: str = "pca"
    train: tuple[str, ...] = ()
    translation: Translation = "known"
    size: tuple[int, int] = (64, 48)
    noise: tuple[tuple[str, float], ...] = ()
    mismatch_percent: float = 0.0

    @property
    def body(self) -> Body:
        """The true body."""
        return _body(self.motion)

    @property
    def learned(self) -> Prior:
        """The prior, fitted to the training motions."""
        return _learned(self.prior, self.motion, self.training)

    @property
    def training(self) -> tuple[str, ...]:
        """The training motions: by default the other styles of a built-in motion, else the built-in walks."""
        return self.train or built_in.other_styles(self.motion if self.motion in built_in.names() else "walk")


class Arguments(TypedDict, total=False):
    """The arguments that all environments share; FitImageEnv documents them."""

    motion: str
    instance: int | None
    split: str
    view_degrees: Views
    prior: str
    train: Sequence[str] | None
    translation: str
    size: Sequence[int]
    noise: Mapping[str, float] | None
    mismatch_percent: float
    errors: bool


@dataclass(frozen=True)
class Selection:
    """A world, which of its instances are used, and whether infos hold errors against the truth."""

    world: World
    instance: int | None
    split: str
    errors: bool

    def number(self, options: Mapping[str, Any] | None, generator: Callable[[], np.random.Generator]) -> int:
        """Return the number of the next instance: that of a reset's options, the fixed one, or a random one.

        Raises ArgumentError where the options name an unknown one.
        """
        if options and options.get("instance") is not None:
            return instance_number(options["instance"])
        return self.instance if self.instance is not None else int(generator().integers(*SPLITS[self.split]))


def select(
    *,
    motion: str = "walk",
    instance: int | None = None,
    split: str = "train",
    view_degrees: Views = 45.0,
    prior: str = "pca",
    train: Sequence[str] | None = None,
    translation: str = "known",
    size: Sequence[int] = SIZE,
    noise: Mapping[str, float] | None = None,
    mismatch_percent: float = 0.0,
    errors: bool = True,
    **unknown: Any,
) -> Selection:
    """Return the selection of instances that the arguments describe.

    Raises ArgumentError where a value is wrong, and TypeError where there is no argument of that name.
    """
    for name in unknown:
        known = tuple(Arguments.__annotations__)
        near = get_close_matches(name, known, 1)
        hint = f"; did you mean {near[0]!r}?" if near else ""
        raise TypeError(f"an argument must be one of {', '.join(known)}, got {quoted(name)}{hint}")
    if split not in SPLITS:
        raise ArgumentError(f"split must be one of {', '.join(SPLITS)}, got {quoted(split)}")
    for name, value in (("motion", motion), ("prior", prior)):
        if not isinstance(value, str):
            raise ArgumentError(f"{name} must be a name, got {quoted(value)}")
    if instance is not None:
        instance = instance_number(instance)
    views = _views(view_degrees)
    if translation not in TRANSLATIONS:
        raise ArgumentError(f"translation must be one of {', '.join(TRANSLATIONS)}, got {quoted(translation)}")
    sides = list(size) if isinstance(size, Sequence) and not isinstance(size, str) else []
    if len(sides) != 2 or not all(isinstance(side, int | np.integer) and 36 <= side <= 4096 for side in sides):
        raise ArgumentError(f"size must be (width, height) of 36 to 4096 pixels, got {quoted(size)}")
    strengths = _strengths(noise)
    if not 0.0 <= checked(finite_number, "mismatch_percent", mismatch_percent) <= 50.0:
        raise ArgumentError(f"mismatch_percent must lie in 0 to 50, got {mismatch_percent}")
    if isinstance(train, str) or not all(isinstance(name, str) for name in train or ()):
        raise ArgumentError(f"train must be a list of motions such as ['walk-a'], got {quoted(train)}")
    if not isinstance(errors, bool):
        raise ArgumentError(f"errors must be true or false, got {quoted(errors)}")
    made = World(
        motion,
        views,
        prior,
        tuple(train or ()),
        translation,  # type: ignore[arg-type]
        (int(sides[0]), int(sides[1])),
        strengths,
        float(mismatch_percent),
    )
    try:
        assert made.learned is not None
    except (ValueError, ImportError) as mistake:  # unknown motions and priors are named there
        raise ArgumentError(str(mistake)) from None
    return Selection(made, instance, split, errors)


def checked(check: Callable[..., Any], name: str, *values: Any) -> Any:
    """Return the result of one of posefit's checks. Raises ArgumentError, which is Gymnasium's error too."""
    try:
        return check(name, *values)
    except ValueError as mistake:
        raise ArgumentError(str(mistake)) from None


def _views(view_degrees: Any) -> tuple[float, ...]:
    several = isinstance(view_degrees, Sequence) and not isinstance(view_degrees, str)
    try:
        views = tuple(finite_number("view_degrees", view) for view in (view_degrees if several else [view_degrees]))
    except ValueError:
        views = ()
    if not views:
        raise ArgumentError(f"view_degrees must be a finite number or several, got {quoted(view_degrees)}")
    return views


def _strengths(noise: Any) -> tuple[tuple[str, float], ...]:
    if noise is not None and not isinstance(noise, Mapping):
        raise ArgumentError(f"noise must be strengths such as {{'holes': 0.3}}, got {quoted(noise)}")
    for name, strength in (noise or {}).items():
        if name not in CORRUPTIONS:
            raise ArgumentError(f"noise must be of {', '.join(CORRUPTIONS)}, got {quoted(name)}")
        if not 0.0 <= checked(finite_number, f"noise {name}", strength) <= 1.0:
            raise ArgumentError(f"noise {name} must have a strength of 0 to 1, got {strength}")
    return tuple(sorted((noise or {}).items()))


def instance_number(number: Any) -> int:
    """Return the number of an instance as an int. Raises ArgumentError where there is no such instance."""
    last = SPLITS["test"][1] - 1
    if isinstance(number, bool) or not isinstance(number, int | np.integer):
        raise ArgumentError(f"instance must be a whole number from 0 to {last}, got {quoted(number)}")
    if not 0 <= number <= last:
        raise ArgumentError(f"instance must lie in 0 to {last}, got {quoted(int(number))}")
    return int(number)


@lru_cache(maxsize=32)
def _source(motion: str) -> Motion:
    return motion_of(motion, None, FPS)


@lru_cache(maxsize=32)
def _body(motion: str) -> Body:
    return Body.of(_source(motion).skeleton)


@lru_cache(maxsize=32)
def _learned(prior: str, motion: str, train: tuple[str, ...]) -> Prior:
    angles = np.concatenate([motion_of(name, None, FPS).poses[:, 3:] for name in train])
    fitted: Prior = registry().prior(prior)().fit(angles, _source(motion).skeleton)
    return fitted


@dataclass(frozen=True, eq=False)
class Scenery:
    """The observation of one frame, and the picture of it into which bodies are drawn."""

    task: Task
    observation: Observation
    backdrop: NDArray[np.uint16] = field(init=False, repr=False)  # (height, width, views)

    def __post_init__(self) -> None:
        masks = np.stack([silhouette.mask for silhouette in self.observation.silhouettes], axis=-1)
        object.__setattr__(self, "backdrop", masks.astype(np.uint16) * np.uint16(OBSERVED))

    @property
    def picture(self) -> Image:
        """The picture (height, width, 2 views) before the first proposal."""
        return np.array(self.backdrop).view(np.uint8)

    def problem(self, space: SearchSpace) -> PoseProblem:
        """Return the search for the pose in a space."""
        return PoseProblem(self.task.body, self.task.cameras, self.observation.silhouettes, space, blank=True)


@dataclass(frozen=True, eq=False)
class Instance:
    """One numbered instance: the truth, and the observations of it."""

    number: int
    task: Task  # what a tracker is given; its body need not be the true one
    truth: Motion
    observations: Sequence[Observation] = field(repr=False)
    _sceneries: dict[int, Scenery] = field(default_factory=dict, repr=False)

    def scenery(self, frame: int) -> Scenery:
        """Return the scenery of a frame, always the same object."""
        if frame not in self._sceneries:
            self._sceneries[frame] = Scenery(self.task, self.observations[frame])
        return self._sceneries[frame]

    @cached_property
    def joints(self) -> Array:
        """The true joints (T, 27, 3) in metres, in the world."""
        return self.truth.skeleton.joints(self.truth.poses, self.truth.translations)

    def errors(self, frame: int, pose: Array) -> dict[str, float]:
        """Return the error of a pose (66,) against the truth of a frame, by its name in infos."""
        return {"error_degrees": float(pose_error_degrees(self.truth.poses[frame][None], pose[None])[0])}

    def space(self, prior: Prior) -> SearchSpace:
        """Return the box in which the first frame's pose is searched."""
        task = self.task
        assert task.yaw is not None
        centre = np.array([task.yaw, 0.0, 0.0])
        return SearchSpace(prior, centre, np.radians(ROOT_RANGE_DEGREES), task.anchor, task.translation)


@dataclass(frozen=True, eq=False)
class Episode:
    """What one environment searches now: a frame of an instance, in a space."""

    instance: Instance
    frame: int
    space: SearchSpace

    @property
    def scenery(self) -> Scenery:
        """What is observed in the frame."""
        return self.instance.scenery(self.frame)


def first_episode(world: World, number: int, evaluations: int, frames: int = 1) -> Episode:
    """Return the search for the first frame's pose of an instance."""
    made = instance(world, number, frames, evaluations)
    return Episode(made, 0, made.space(world.learned))


@lru_cache(maxsize=64)
def instance(setting: World, number: int, frames: int, evaluations: int) -> Instance:
    """Return an instance: the same person, pose and silhouettes for the same number and arguments, everywhere."""
    truth = _truth(setting.motion, number, frames)
    rng = np.random.default_rng([RNG_STREAM, number])  # of noise, yaw and build alone: motion and views are a sweep's
    body, facing = setting.body, float(truth.poses[0, 0])
    middle = truth.translations.mean(axis=0)
    middle[1] = HEIGHT
    reach = DISTANCE + 0.5 * float(np.ptp(truth.translations[:, [0, 2]], axis=0).max())
    azimuths = [facing + np.radians(view) for view in variation(number).views(setting.view_degrees)]
    cameras = [Camera.around(middle, azimuth, reach, setting.size) for azimuth in azimuths]
    noise = dict(setting.noise)
    observations = []
    for pose, place in zip(truth.poses, truth.translations, strict=True):
        masks = [corrupted(project(body, camera, pose, place), noise, rng) for camera in cameras]
        observations.append(Observation([Silhouette.of(mask) for mask in masks], place.copy()))
    yaw = facing + float(np.radians(rng.uniform(-YAW_DEGREES, YAW_DEGREES)))
    fitted = varied(body, setting.mismatch_percent, rng)
    task = Task(fitted, cameras, evaluations, yaw, truth.translations[0].copy(), setting.translation, FPS)
    return Instance(number, task, truth, observations)


def _truth(name: str, number: int, frames: int) -> Motion:
    try:
        return motion_of_instance(name if name in built_in.names() else _source(name), number, frames=frames, fps=FPS)
    except ValueError as mistake:  # a file that is too short
        raise error.Error(str(mistake)) from None
