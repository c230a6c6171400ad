"""Instances, numbered as in other benchmarks: a number and an environment's arguments are a person and what is seen.

The motion, its speed and phase, and from where it is seen, are those of a sweep's instance of that number.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, TypedDict

import numpy as np
from gymnasium import error

from posefit import Body, Camera, Motion, Observation, SearchSpace, Silhouette, Task
from posefit.arrays import Array
from posefit.fitting.prior import Prior
from posefit.fitting.space import ROOT_RANGE_DEGREES, TRANSLATIONS, Translation
from posefit.footage.instance import motion_of_instance, variation
from posefit.footage.source import motion_of
from posefit.geometry.body import varied
from posefit.registry import registry
from posefit.silhouette.corruption import CORRUPTIONS, corrupted
from posefit.silhouette.cost import project
from posefit_envs.search import Scenery

RESERVED = {"train": (0, 10_000), "test": (10_000, 20_000)}  # instance numbers; those of the test split are held out
SALT = 2012  # part of the seed of what is drawn here for an instance, beside what `posefit.footage.instance` says
FPS = 30.0
SIZE = (64, 48)  # pixels
YAW_DEGREES = 20.0  # how far the middle of the searched yaw is from the truth at most
DISTANCE, HEIGHT = 3.5, 0.9  # metres from camera to person; of the camera above the ground

Views = float | Sequence[float]


@dataclass(frozen=True)
class World:
    """What the arguments of an environment say, checked. Arguments are names and numbers, as JSON can hold."""

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
        return Body.of(_source(self.motion).skeleton)

    @property
    def learned(self) -> Prior:
        """The prior, fitted to the training motions."""
        return _learned(self.prior, self.motion, self.train)


class Arguments(TypedDict, total=False):
    """The arguments that all environments share; their docstrings say what each means."""

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


@dataclass(frozen=True)
class Selection:
    """A world, and which of its instances come."""

    world: World
    instance: int | None
    split: str

    def number(self, options: Mapping[str, Any] | None, generator: Callable[[], np.random.Generator]) -> int:
        """Return the number of the next instance: of a reset's options, the one that is fixed, or one drawn.

        Raises gymnasium.error.Error where the options name one that there is not.
        """
        if options and options.get("instance") is not None:
            number = int(options["instance"])
            _check_number(number)
            return number
        return self.instance if self.instance is not None else int(generator().integers(*RESERVED[self.split]))


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
) -> Selection:
    """Return what the arguments describe. Raises gymnasium.error.Error where one of them makes no sense."""
    if split not in RESERVED:
        raise error.Error(f"split must be one of {', '.join(RESERVED)}, got {split!r}")
    if instance is not None:
        _check_number(instance)
    views = tuple(map(float, view_degrees)) if isinstance(view_degrees, Sequence) else (float(view_degrees),)
    if not views or not np.isfinite(views).all():
        raise error.Error(f"view_degrees must be a finite number or several, got {view_degrees!r}")
    if translation not in TRANSLATIONS:
        raise error.Error(f"translation must be one of {', '.join(TRANSLATIONS)}, got {translation!r}")
    if len(size) != 2 or not all(36 <= side <= 4096 for side in size):
        raise error.Error(f"size must be (width, height) of 36 to 4096 pixels, got {tuple(size)}")
    for name, strength in (noise or {}).items():
        if name not in CORRUPTIONS:
            raise error.Error(f"noise must be of {', '.join(CORRUPTIONS)}, got {name!r}")
        if not 0.0 <= strength <= 1.0:
            raise error.Error(f"noise {name} must have a strength of 0 to 1, got {strength}")
    if not 0.0 <= mismatch_percent <= 50.0:
        raise error.Error(f"mismatch_percent must lie in 0 to 50, got {mismatch_percent}")
    made = World(
        motion,
        views,
        prior,
        tuple(train or ()),
        translation,  # type: ignore[arg-type]
        (int(size[0]), int(size[1])),
        tuple(sorted((noise or {}).items())),
        float(mismatch_percent),
    )
    try:
        assert made.learned is not None
    except (ValueError, ImportError) as mistake:  # unknown motions and priors are named there
        raise error.Error(str(mistake)) from None
    return Selection(made, instance, split)


def _check_number(number: int) -> None:
    last = RESERVED["test"][1] - 1
    if not 0 <= number <= last:
        raise error.Error(f"instance must lie in 0 to {last}, got {number}")


@lru_cache(maxsize=32)
def _source(motion: str) -> Motion:
    return motion_of(motion, None, FPS)


@lru_cache(maxsize=32)
def _learned(prior: str, motion: str, train: tuple[str, ...]) -> Prior:
    from posefit.motion import library

    if not train:
        train = library.other_styles(motion if motion in library.names() else "walk")
    angles = np.concatenate([motion_of(one, None, FPS).poses[:, 3:] for one in train])
    fitted: Prior = registry().prior(prior)().fit(angles, _source(motion).skeleton)
    return fitted


@dataclass(frozen=True, eq=False)
class Instance:
    """One numbered instance: the truth, and what is seen of it."""

    number: int
    task: Task  # whom to fit, as a tracker is told; its body need not be the true one
    truth: Motion
    observations: Sequence[Observation] = field(repr=False)
    _sceneries: dict[int, Scenery] = field(default_factory=dict, repr=False)

    def scenery(self, frame: int) -> Scenery:
        """Return the scenery of a frame, always the same object: environments that share it share a kernel call."""
        if frame not in self._sceneries:
            self._sceneries[frame] = Scenery(self.task, self.observations[frame])
        return self._sceneries[frame]

    def space(self, prior: Prior) -> SearchSpace:
        """Return the box in which the first frame's pose is sought."""
        task = self.task
        assert task.yaw is not None
        centre = np.array([task.yaw, 0.0, 0.0])
        return SearchSpace(prior, centre, np.radians(ROOT_RANGE_DEGREES), task.anchor, task.translation)


@lru_cache(maxsize=64)
def instance(setting: World, number: int, frames: int, evaluations: int) -> Instance:
    """Return an instance: the same person, pose and silhouettes for the same number and arguments, everywhere."""
    truth = _truth(setting.motion, number, frames)
    rng = np.random.default_rng([SALT, number])  # of noise, yaw and build alone: what is seen is a sweep's instance
    body, facing = setting.body, float(truth.poses[0, 0])
    middle = truth.translations.mean(axis=0)
    middle[1] = HEIGHT
    reach = DISTANCE + 0.5 * float(np.ptp(truth.translations[:, [0, 2]], axis=0).max())
    azimuths = [facing + np.radians(view) for view in variation(number).views(setting.view_degrees)]
    cameras = [Camera.around(middle, azimuth, reach, setting.size) for azimuth in azimuths]
    noise = dict(setting.noise)
    seen = []
    for pose, where in zip(truth.poses, truth.translations, strict=True):
        masks = [corrupted(project(body, camera, pose, where), noise, rng) for camera in cameras]
        seen.append(Observation([Silhouette.of(mask) for mask in masks], where.copy()))
    yaw = facing + float(np.radians(rng.uniform(-YAW_DEGREES, YAW_DEGREES)))
    fitted = varied(body, setting.mismatch_percent, rng)
    task = Task(fitted, cameras, evaluations, yaw, truth.translations[0].copy(), setting.translation, FPS)
    return Instance(number, task, truth, seen)


def _truth(name: str, number: int, frames: int) -> Motion:
    from posefit.motion import library

    try:
        return motion_of_instance(name if name in library.names() else _source(name), number, frames=frames, fps=FPS)
    except ValueError as mistake:  # a file that is too short
        raise error.Error(str(mistake)) from None


def errors_in_degrees(truth: Motion, frame: int, poses: Array) -> Array:
    """Return the error (n,) in degrees of poses (n, 66) in a frame. SAPSO (8)."""
    from posefit.fitting.metrics import pose_error_degrees

    return pose_error_degrees(np.broadcast_to(truth.poses[frame], poses.shape), poses)
