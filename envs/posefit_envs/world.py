"""The arguments of environments, and an instance's person, motion and silhouettes.

See `posefit.motion.instances` for the numbers.
"""

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from gymnasium import error, logger
from numpy.typing import NDArray

from posefit import (
    Body,
    Camera,
    Motion,
    Observation,
    Problem,
    SearchSpace,
    Silhouette,
    SilhouetteCost,
    Task,
)
from posefit.arrays import Array
from posefit.fitting.check import between, finite_number, one_of, pair
from posefit.fitting.prior import Prior
from posefit.fitting.space import ROOT_RANGE_DEGREES, TRANSLATIONS, Translation
from posefit.fitting.validation import check_prior
from posefit.geometry.body import varied
from posefit.motion import built_in
from posefit.motion.clips import load_motion
from posefit.motion.instances import (
    HELD_OUT,
    TRAINING,
    generator,
    instance_number,
    motion_of_instance,
    variation,
)
from posefit.reading import quoted, suggestion
from posefit.registry import registry
from posefit.silhouette.corruption import CORRUPTIONS, corrupted
from posefit.silhouette.cost import project
from posefit.silhouette.drawn import uncounted

SPLITS = {"train": TRAINING, "test": HELD_OUT}
YAWS = ("guessed", "unknown")
# the people whom the test split shows, numbered as in the CMU database; every kind of
# built-in motion has a style of one of them, and styles of others
HELD_OUT_PEOPLE = ("14", "16")
# largest difference of a person's bones and girths from the average body
PEOPLE_PERCENT = 10.0
FPS = 30.0
# largest difference between the middle of the searched yaw and the truth
YAW_DEGREES = 20.0
# how far the root is searched if the yaw is unknown
ANY_YAW_DEGREES = (180.0, *ROOT_RANGE_DEGREES[1:])
# largest difference between the middle of the searched translation and the truth
MIDDLE_METRES = 0.25
# the camera's distance from the person, and its height above the ground
DISTANCE = 3.5  # metres
HEIGHT = 0.9
# a pixel has two bytes, viewed as one number: these are the bits of the body's byte
BODY = 0xFF00 if sys.byteorder == "little" else 0x00FF
OBSERVED = 0xFFFF ^ BODY

# (height, width, 2 views): observed, body, observed, body, ...
Image = NDArray[np.uint8]


class ArgumentError(error.Error, ValueError):
    """An argument of an environment is wrong."""


@dataclass(frozen=True)
class World:
    """The arguments of all environments, as documented by FitImageEnv.

    `world_of` checks them.
    """

    motion: tuple[str, ...] = ("walk",)
    held_out_people: bool = True
    yaw: str = "guessed"
    instance: int | None = None
    split: str = "train"
    view_degrees: tuple[float, ...] = (45.0,)
    prior: str = "pca"
    train: tuple[str, ...] = ()
    translation: Translation = "known"
    size: tuple[int, int] = (64, 48)
    noise: tuple[tuple[str, float], ...] = ()
    mismatch_percent: float = 0.0
    errors: bool = True
    evaluate: bool = False

    @property
    def shows_truth(self) -> bool:
        """Whether infos contain the truth: in the test split, only with `evaluate`."""
        return self.errors and (self.evaluate or self.split == "train")

    @cached_property
    def default_infos(self) -> "World":
        """The same world with default infos, which do not affect scenes."""
        return replace(self, errors=True, evaluate=False)

    @cached_property
    def learned(self) -> Prior:
        """The prior, fitted to the training motions."""
        return _learned(self.prior, self.motion[0], self.training)

    @cached_property
    def training(self) -> tuple[str, ...]:
        """The training motions: styles of the built-in motions, or of "walk".

        With held-out people they are the styles of everybody else; otherwise all styles
        but the one that is shown.
        """
        if self.train:
            return self.train
        if self.held_out_people:
            of_others: list[str] = []
            for kind in self.motion:
                of_others += styles_of(kind, False)
            return tuple(of_others)
        styles: list[str] = []
        for motion in self.motion:
            # only built-in motions have styles; for any other, learn from walks
            name = motion if motion in built_in.names() else "walk"
            styles += built_in.other_styles(name)
        # two styles of one kind have other styles in common: list each only once
        return tuple(dict.fromkeys(styles))

    @property
    def dimensions(self) -> int:
        """The number of coordinates of a proposal."""
        return len(self.learned.low) + (6 if self.translation == "searched" else 3)

    def motion_of(self, number: int) -> str:
        """Return the motion of an instance.

        Several motions take turns, and so do the styles of several people.
        """
        turn, which = divmod(number, len(self.motion))
        motion = self.motion[which]
        if not self.held_out_people:
            return motion
        styles = styles_of(motion, number in HELD_OUT)
        return styles[turn % len(styles)]

    def numbered(self, number: object) -> int:
        """Return the number of an instance of the split as an int.

        Raises:
            ArgumentError: If there is no such instance, or it is of the other split.
        """
        chosen: int = checked(instance_number, number)
        split = SPLITS[self.split]
        if chosen not in split:
            raise ArgumentError(
                f"instance must lie in {split[0]} to {split[-1]} with "
                f"split={self.split!r}, got {chosen}"
            )
        return chosen

    def next_instance(self, rng: np.random.Generator) -> int:
        """Return the number of the next instance: fixed, or drawn from the split."""
        if self.instance is not None:
            return self.instance
        split = SPLITS[self.split]
        return int(rng.integers(split.start, split.stop))


def styles_of(kind: str, held_out: bool) -> tuple[str, ...]:
    """Return the styles of a kind of motion, of held-out people or of all others."""
    styles = []
    for style in built_in.other_styles(kind):
        if (built_in.person_of(style) in HELD_OUT_PEOPLE) == held_out:
            styles.append(style)
    return tuple(styles)


def world_of(own: Sequence[str] = (), /, **arguments: Any) -> World:
    """Return the world that an environment's arguments describe.

    Args:
        own: Names of the arguments that the environment itself takes, for the message.
        arguments: The arguments of the world.

    Raises:
        ArgumentError: If a value is wrong.
        TypeError: If an argument's name is unknown.
    """
    known = tuple(World.__dataclass_fields__)
    for name in arguments:
        if name not in known:
            every = *known, *own
            # Python's wording, in which TorchRL recognises an argument to leave out
            raise TypeError(
                f"unexpected keyword argument {quoted(name)}"
                f"{suggestion(name, every)}: it must be one of {', '.join(every)}"
            )
    world = World(**arguments)
    checked(one_of, "split", world.split, SPLITS)
    checked(one_of, "translation", world.translation, TRANSLATIONS)
    checked(one_of, "yaw", world.yaw, YAWS)
    if not isinstance(world.prior, str):
        raise ArgumentError(f"prior must be a name, got {quoted(world.prior)}")
    held_out_people = flag("held_out_people", world.held_out_people)
    what = "(width, height) of 36 to 4096 pixels"
    sides = checked(pair, "size", world.size, what)
    for side in sides:
        if not isinstance(side, int | np.integer) or not 36 <= side <= 4096:
            raise ArgumentError(f"size must be {what}, got {quoted(world.size)}")
    mismatch = checked(finite_number, "mismatch_percent", world.mismatch_percent)
    checked(between, "mismatch_percent", mismatch, 0.0, 50.0)
    if isinstance(world.train, str) or not _are_texts(world.train or ()):
        raise ArgumentError(
            "train must be a list of motions such as ['walk-a'], "
            f"got {quoted(world.train)}"
        )
    motion = _motions(world.motion, held_out_people)
    number = world.instance
    if number is not None:
        number = world.numbered(number)
    return replace(
        world,
        motion=motion,
        held_out_people=held_out_people,
        instance=number,
        view_degrees=_views(world.view_degrees),
        train=tuple(world.train or ()),
        size=(int(sides[0]), int(sides[1])),
        noise=_strengths(world.noise),
        mismatch_percent=mismatch,
        errors=flag("errors", world.errors),
        evaluate=flag("evaluate", world.evaluate),
    )


def checked(check: Callable[..., Any], *values: Any) -> Any:
    """Return the result of one of posefit's checks, which raise ValueError.

    Raises ArgumentError instead, which is also an error of Gymnasium.
    """
    try:
        return check(*values)
    except (ValueError, ImportError) as mistake:
        raise ArgumentError(str(mistake)) from None


def flag(name: str, value: object) -> bool:
    """Return a truth value as a bool. Raises ArgumentError for anything else."""
    if not isinstance(value, bool | np.bool_):
        raise ArgumentError(f"{name} must be true or false, got {quoted(value)}")
    return bool(value)


def _are_texts(values: Iterable[Any]) -> bool:
    return all(isinstance(value, str) for value in values)


def _motions(motion: Any, held_out_people: bool) -> tuple[str, ...]:
    """Return the motions: one name, several built-in ones, or "all" kinds of them."""
    kinds = tuple(dict.fromkeys(map(built_in.activity_of, built_in.names())))
    if motion == "all":
        names = kinds
    elif isinstance(motion, str):
        names = (motion,)
    else:
        names = motion
    if not isinstance(names, Sequence) or not names or not _are_texts(names):
        raise ArgumentError(
            f"motion must be a name, several names, or 'all', got {quoted(motion)}"
        )
    if held_out_people:
        for name in names:
            if name not in kinds:
                raise ArgumentError(
                    f"motion must be one of {', '.join(kinds)} with held-out people, "
                    f"got {quoted(name)}{suggestion(name, kinds)}: "
                    "held_out_people=False allows others"
                )
    elif len(names) > 1:
        for name in names:
            checked(one_of, "motion", name, built_in.names())
    return tuple(names)


def _views(view_degrees: Any) -> tuple[float, ...]:
    several = isinstance(view_degrees, Sequence | np.ndarray) and not isinstance(
        view_degrees, str
    )
    views: list[float] = []
    try:
        for view in view_degrees if several else [view_degrees]:
            views.append(finite_number("view_degrees", view))
    except ValueError:
        views = []
    if not views:
        raise ArgumentError(
            "view_degrees must be one finite number or several, "
            f"got {quoted(view_degrees)}"
        )
    return tuple(views)


def _strengths(noise: Any) -> tuple[tuple[str, float], ...]:
    strengths = noise or {}
    if not isinstance(strengths, Mapping):
        raise ArgumentError(
            f"noise must be strengths such as {{'holes': 0.3}}, got {quoted(noise)}"
        )
    for name, strength in strengths.items():
        if name not in CORRUPTIONS:
            raise ArgumentError(
                f"noise must be one of {', '.join(CORRUPTIONS)}, got {quoted(name)}"
            )
        if not 0.0 <= checked(finite_number, f"noise {name}", strength) <= 1.0:
            raise ArgumentError(
                f"noise {name} must have a strength of 0 to 1, got {strength}"
            )
    return tuple(sorted(strengths.items()))


@lru_cache(maxsize=32)
def _source(motion: str) -> Motion:
    source = load_motion(motion, FPS)
    for note in source.notes:
        logger.warn(note)
    return source


@lru_cache(maxsize=32)
def body_of(motion: str) -> Body:
    """Return the true body of the person in a motion."""
    return Body.of(_source(motion).skeleton)


@lru_cache(maxsize=32)
def _learned(prior: str, motion: str, train: tuple[str, ...]) -> Prior:
    skeleton = _source(motion).skeleton
    angles_of_motions = []
    for name in train:
        # joint angles are comparable only if they are about the axes of one skeleton
        own = load_motion(name, FPS).about_axes_of(skeleton)
        angles_of_motions.append(own.poses[:, 3:])
    angles = np.concatenate(angles_of_motions)  # (T, 63)
    offer = registry().offer("prior", prior)
    fitted: Prior = offer.factory().fit(angles, skeleton)
    check_prior(fitted, angles, skeleton, offer.label)
    return fitted


@dataclass(frozen=True, eq=False)
class Instance:
    """One numbered instance: the truth, and its observations."""

    number: int
    # what a tracker knows; its body may differ from the true one
    task: Task
    truth: Motion
    observations: Sequence[Observation] = field(repr=False)

    def cost(self, frame: int, space: SearchSpace) -> SilhouetteCost:
        """Return the cost of proposals for a frame in a space."""
        task = self.task
        silhouettes = self.observations[frame].silhouettes
        return SilhouetteCost(task.body, task.cameras, silhouettes, space, blank=True)

    def true_proposal(self, frame: int, space: SearchSpace) -> Array:
        """Return the proposal (d,) nearest to the true pose.

        The pose is projected onto the prior and clipped to the box.
        """
        pose = self.truth.poses[frame]
        place = self.truth.translations[frame]
        searched = place if space.translation == "searched" else place[:0]
        latents = space.prior.transform(pose[None, 3:])[0]
        return space.proposals(np.concatenate([pose[:3], searched, latents]))

    @cached_property
    def joints(self) -> Array:
        """The true joints (T, 27, 3) in metres, in the world."""
        return self.truth.skeleton.joints(self.truth.poses, self.truth.translations)


@dataclass(frozen=True, eq=False)
class FirstFrame:
    """The cost of proposals for an instance's first frame, computed when first used."""

    world: World
    number: int

    def __call__(self, proposals: Array) -> Array:
        """Return the costs (n,) of proposals (n, d)."""
        return self.cost(proposals)

    @cached_property
    def instance(self) -> Instance:
        """The instance: its task, its truth and its observations."""
        return instance(self.world, self.number)

    @cached_property
    def cost(self) -> SilhouetteCost:
        """The cost function itself."""
        return self.instance.cost(0, first_space(self.world, self.instance))

    @cached_property
    def truth(self) -> Array:
        """The proposal (d,) nearest to the true pose."""
        return self.instance.true_proposal(0, self.cost.space)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        return getattr(self.cost, name)


@lru_cache(maxsize=len(TRAINING))
def first_truth(world: World, number: int) -> Array:
    """Return the proposal (d,) nearest to the true first pose of an instance."""
    truth = FirstFrame(world, number).truth
    truth.setflags(write=False)
    return truth


def first_problem(world: World, number: int) -> Problem:
    """Return the problem of an instance's first frame."""
    frame = FirstFrame(world, number)
    return Problem(frame, frame.cost.space)


def first_space(world: World, made: Instance) -> SearchSpace:
    """Return the search space around the pose of an instance's first frame."""
    task = made.task
    centre = np.array([task.yaw, 0.0, 0.0])
    guessed = world.yaw == "guessed"
    reach = np.radians(ROOT_RANGE_DEGREES if guessed else ANY_YAW_DEGREES)
    return SearchSpace(world.learned, centre, reach, task.anchor, task.translation)


@lru_cache(maxsize=64)
def instance(
    world: World, number: int, frames: int = 1, evaluations: int = 1
) -> Instance:
    """Return an instance.

    The same number and arguments give the same person, pose and silhouettes on every
    machine.
    """
    motion = world.motion_of(number)
    # built-in motions are made at the instance's speed, files are cut
    source = motion if motion in built_in.names() else _source(motion)
    try:
        truth = motion_of_instance(source, number, frames=frames, fps=FPS)
    except ValueError as mistake:  # a file that is too short
        raise error.Error(str(mistake)) from None
    # for noise, yaw and build only: the instance's number gives motion and views
    rng = generator("scene", number)
    body = body_of(motion)
    if world.held_out_people:
        body = varied(body, PEOPLE_PERCENT, generator("person", number))
    facing = float(truth.poses[0, 0])
    middle = truth.translations.mean(axis=0)
    middle[1] = HEIGHT
    # a longer walk is seen from farther away, so that the person stays in the picture
    reach = DISTANCE + 0.5 * float(np.ptp(truth.translations[:, [0, 2]], axis=0).max())
    turn = rng.uniform(-180.0, 180.0) if world.yaw == "unknown" else 0.0
    azimuths = []
    cameras = []
    for view in variation(number).views(world.view_degrees):
        azimuth = facing + np.radians(view + turn)
        azimuths.append(azimuth)
        cameras.append(Camera.around(middle, azimuth, reach, world.size))
    noise = dict(world.noise)
    observations = []
    for pose, place in zip(truth.poses, truth.translations, strict=True):
        # rendering the truth is not an evaluation
        with uncounted():
            shown = [project(body, camera, pose, place) for camera in cameras]
        silhouettes = []
        for mask in shown:
            silhouettes.append(Silhouette.of(corrupted(mask, noise, rng)))
        observations.append(Observation(silhouettes, place.copy()))
    yaw = facing + float(np.radians(rng.uniform(-YAW_DEGREES, YAW_DEGREES)))
    if world.yaw == "unknown":
        yaw = azimuths[0]  # facing the camera
    fitted = varied(body, world.mismatch_percent, rng)
    # drawn last, so that arguments do not change the random numbers above
    anchor = truth.translations[0].copy()
    if world.translation == "searched":
        anchor += rng.uniform(-MIDDLE_METRES, MIDDLE_METRES, 3)
    task = Task(fitted, cameras, evaluations, yaw, anchor, world.translation, FPS)
    return Instance(number, task, truth, observations)
