"""The build of one person: factors on bone lengths and radii, fitted to a few frames.

The poses of the frames are fitted in turns with the build: first they are tracked, then
they are fitted to the contours of the masks.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.bodies import HeldFrames, scaled_bodies
from posefit.fitting.box import Start
from posefit.fitting.cma import CMAES, default_population_size
from posefit.fitting.contours import ROBUST_SCALES, STEP_EVALUATIONS, contour_fit
from posefit.fitting.cost import align
from posefit.fitting.problem import Problem, minimise
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.skeleton import BONES, kind
from posefit.silhouette.cost import BETA

LENGTHS = {
    "hips": ("hipjoint",),
    "thighs": ("femur",),
    "shanks": ("tibia",),
    "feet": ("foot", "toes"),
    "torso": ("lowerback", "upperback", "thorax"),
    "neck": ("lowerneck", "upperneck", "head"),
    "shoulders": ("clavicle",),
    "upper arms": ("humerus",),
    "forearms": ("radius", "wrist", "hand"),
}
GIRTHS = {
    "hips": ("hipjoint",),
    "thighs": ("femur",),
    "shanks": ("tibia",),
    "feet": ("foot", "toes"),
    "torso": ("lowerback", "upperback", "thorax", "clavicle"),
    "head": ("lowerneck", "upperneck", "head"),
    "arms": ("humerus", "radius", "wrist", "hand"),
}
NAMES = (
    "scale",
    *(f"{name} length" for name in LENGTHS),
    *(f"{name} girth" for name in GIRTHS),
)

# How much adults differ: standard deviations and correlations of the logarithms of
# lengths over stature. They are computed from the public data of ANSUR II (Gordon et
# al. 2014, NATICK/TR-15/007), 4082 men and 1986 women, with equal weight of both sexes.
# The measures are: for thighs, trochanterion to lateral femoral epicondyle; for shanks,
# from there to the lateral malleolus; for feet, foot length; for the torso,
# trochanterion to cervicale; for the neck, cervicale to the crown; for shoulders,
# biacromial breadth; for upper arms, acromion to radiale; for forearms, radiale to
# stylion and the hand. ANSUR II does not measure the distance of the hip
# joints, so its spread is ours. So are the spreads of girths, which are wide because
# clothes count, and of scale, which is wider than the 0.054 of adults.
PROPORTIONS_SPREAD = {
    "thighs": 0.049,
    "shanks": 0.044,
    "feet": 0.036,
    "torso": 0.044,
    "neck": 0.054,
    "shoulders": 0.050,
    "upper arms": 0.033,
    "forearms": 0.036,
}
PROPORTIONS_CORRELATION = np.array(
    [
        [1.00, 0.03, 0.05, -0.67, -0.20, -0.05, 0.18, 0.23],
        [0.03, 1.00, 0.08, -0.59, -0.09, -0.28, 0.35, 0.31],
        [0.05, 0.08, 1.00, -0.02, -0.22, 0.34, 0.12, 0.56],
        [-0.67, -0.59, -0.02, 1.00, -0.24, 0.30, -0.24, -0.25],
        [-0.20, -0.09, -0.22, -0.24, 1.00, -0.25, -0.25, -0.31],
        [-0.05, -0.28, 0.34, 0.30, -0.25, 1.00, 0.02, 0.26],
        [0.18, 0.35, 0.12, -0.24, -0.25, 0.02, 1.00, 0.33],
        [0.23, 0.31, 0.56, -0.25, -0.31, 0.26, 0.33, 1.00],
    ]
)
# Factor on the variance of the ratio of thigh to shank in the fit, so small that the
# fit does not change the ratio. In a mask, the knee is where the flesh of the thigh and
# that of the shank meet. Most flesh is behind the bones, by 2 cm (Dumas et al. 2007): a
# knee that is a little bent seems to be higher than it is, by more than the 6 % by
# which people's ratios vary, and in every frame and every view.
RATIO_SHARE = 1e-4
SCALE_SPREAD = 0.10
HIPS_SPREAD = 0.06
GIRTH_SPREAD = 0.30
# Added spread of lengths between joints, over lengths between landmarks on the skin.
# Ours.
JOINT_SPREAD = 0.01
REACH = 3.0  # the search reaches this many spreads to either side
PULL = 0.15  # cost of a build that is one spread away from the average
# Each round fits the poses of a fixed body, and then the body in these poses. The
# numbers are the spread of CMA-ES's first draws, in spreads of people, and how many
# generations it makes. The second round begins near the result of the first.
ROUNDS = ((0.5, 60), (0.2, 20))
# How far poses are from those of the round before, once the body has changed: standard
# deviations of angles, in radians, and of places, in metres; of known places too.
POSE_DEVIATIONS = (np.radians(8.0), 0.05)
KNOWN_PLACE_DEVIATION = 0.003


def _members(groups: dict[str, tuple[str, ...]]) -> Array:
    """Return which bones belong to which group, (26, groups) of 0 and 1."""
    members = np.zeros((len(BONES), len(groups)))
    for row, bone in enumerate(BONES):
        for column, kinds in enumerate(groups.values()):
            members[row, column] = kind(bone) in kinds
    return members


def _covariance() -> Array:
    """Return the covariance (17, 17) of the logarithms of factors, as in `NAMES`."""
    spread = np.array(
        [
            SCALE_SPREAD,
            HIPS_SPREAD,
            *PROPORTIONS_SPREAD.values(),
            *[GIRTH_SPREAD] * len(GIRTHS),
        ]
    )
    correlation = np.eye(len(NAMES))
    proportions = slice(2, 2 + len(PROPORTIONS_SPREAD))
    correlation[proportions, proportions] = PROPORTIONS_CORRELATION
    covariance = correlation * np.outer(spread, spread)
    covariance[proportions, proportions] += JOINT_SPREAD**2 * np.eye(
        len(PROPORTIONS_SPREAD)
    )
    return np.asarray(covariance)


def _without_ratio(covariance: Array) -> Array:
    """Return the covariance (17, 17) with nearly one ratio of thigh to shank."""
    with_ratio = covariance @ _RATIO
    share = np.outer(with_ratio, with_ratio) / (_RATIO @ with_ratio)
    return np.asarray(covariance - (1.0 - RATIO_SHARE) * share)


# the logarithm of the ratio of thigh to shank, from the logarithms of all factors
_RATIO = np.zeros(len(NAMES))
_RATIO[NAMES.index("thighs length")] = 1.0
_RATIO[NAMES.index("shanks length")] = -1.0
_LENGTHS = _members(LENGTHS)
_GIRTHS = _members(GIRTHS)
COVARIANCE = _covariance()
SPREAD = np.sqrt(np.diag(COVARIANCE))
FITTED_COVARIANCE = _without_ratio(COVARIANCE)
PRECISION = np.linalg.inv(FITTED_COVARIANCE)
# Error of lengths that remains when contours agree, because people are not cones. It is
# about the least error with four cameras of people with different radii on each bone,
# 2.0 to 3.5 % on average (docs/studies/builds.py). The fit determines only the sum of a
# thigh and a shank, so each is also off by half of their ratio.
_CONES_SPREAD = np.array([0.0, *[0.03] * len(LENGTHS), *[0.0] * len(GIRTHS)])
_HALF_RATIO_SPREAD = 0.5 * np.sqrt(_RATIO @ COVARIANCE @ _RATIO)
MODEL_SPREAD = np.hypot(_CONES_SPREAD, _HALF_RATIO_SPREAD * np.abs(_RATIO))
# Maps independent numbers of deviation 1 to the logarithms of people's factors.
_ROOT = np.linalg.cholesky(FITTED_COVARIANCE)


def shaped(body: Body, factors: Array, height: float | None = None) -> Body:
    """Return a body with lengths and radii multiplied by factors (17,), see `NAMES`.

    With a `height` in metres the result is scaled to it.
    """
    lengths, girths = _scales(factors[None])
    scaled = body.scaled(lengths[0], girths[0])
    if height is None:
        return scaled
    factor = height / scaled.stature
    return scaled.scaled(factor, factor)


def _scales(factors: Array) -> tuple[Array, Array]:
    """Return scales of bones' lengths and girths (m, 26), from factors (m, 17)."""
    scale = factors[:, :1]
    lengths, girths = np.split(np.log(factors[:, 1:]), [len(LENGTHS)], axis=1)
    return scale * np.exp(lengths @ _LENGTHS.T), scale * np.exp(girths @ _GIRTHS.T)


@dataclass(frozen=True, eq=False)
class Shape:
    """A fitted body, and the uncertainty of its factors."""

    body: Body
    factors: Array = field(repr=False)  # (17,) in the order of `NAMES`
    # (17,) standard deviation of each factor's logarithm
    spread: Array = field(repr=False)
    cost: float  # mean over the frames
    # metres, the given height, or None if it was fitted
    height: float | None = None

    def as_dict(self) -> dict[str, Any]:
        """Return the build's entry in summary.json."""
        factors = dict(zip(NAMES, self.factors.tolist(), strict=True))
        spread = dict(zip(NAMES, self.spread.tolist(), strict=True))
        return {
            "stature_m": self.body.stature,
            "cost": self.cost,
            "factors": factors,
            "spread": spread,
        }


def fit_shape(
    task: Task,
    observations: Sequence[Observation],
    follow: Callable[[Body], Sequence[Frame]],
    rng: np.random.Generator,
    *,
    height: float | None = None,
    beta: float = BETA,
) -> Shape:
    """Return the shape that fits all observations best, fitted in turns with the poses.

    The uncertainty of the factors is not known yet: their `spread` is the spread
    among people.

    Args:
        task: The task, with the body that is scaled, the cameras, and whether places of
            poses are known, or aligned for each body that is tried.
        observations: The frames.
        follow: Tracks the observations with a body.
        rng: The random numbers.
        height: The person's height in metres, or None if it is fitted. One camera alone
            cannot show how large a person is.
        beta: The weight in the cost, see `posefit.silhouette.cost`.
    """
    body = task.body
    aligned = task.translation == "aligned"

    def cost(factors: Array) -> Array:
        """Return the mean costs (m,) of the frames for factors (m, 17)."""
        offsets, radii = scaled_bodies(body, *_scales(factors), height)
        return held.costs(offsets, radii, aligned, beta, task.threads)

    factors = np.ones(len(NAMES))
    frames: Sequence[Frame] = ()
    for width, generations in ROUNDS:
        start = shaped(body, factors, height)
        if not frames:
            frames = follow(start)
        else:
            frames = _refitted(replace(task, body=start), observations, frames)
        held = HeldFrames.of(body, task.cameras, observations, frames)
        factors = _search(cost, factors, rng, width, generations)
    fitted = shaped(body, factors, height)
    return Shape(fitted, factors, SPREAD, float(cost(factors[None])[0]), height)


def _refitted(
    task: Task, observations: Sequence[Observation], frames: Sequence[Frame]
) -> list[Frame]:
    """Return frames with poses and places fitted to the contours of the masks.

    The task's body is another one than that of the frames. Tracking with it would take
    twenty times as long, and fit the masks less well.
    """
    turn, shift = POSE_DEVIATIONS
    if task.translation == "known":
        shift = KNOWN_PLACE_DEVIATION
    evaluations = int(len(ROBUST_SCALES) * STEP_EVALUATIONS)
    refitted = []
    for observation, frame in zip(observations, frames, strict=True):
        place = frame.translation
        if task.translation == "aligned":
            scene = task.body, task.cameras, observation.silhouettes
            place = align(*scene, frame.pose[None], place[None])[0]
        pose, place, _ = contour_fit(
            task, observation, (frame.pose, place), (turn, shift), evaluations
        )
        refitted.append(replace(frame, pose=pose, translation=place))
    return refitted


@dataclass(frozen=True, eq=False)
class FactorBox:
    """The box in which builds are searched, [-1, 1]^17.

    Its half-range is `REACH` spreads of uncorrelated numbers.
    """

    start: Start
    dimensions: int = len(NAMES)
    periodic: NDArray[np.bool_] = field(
        default_factory=lambda: np.zeros(len(NAMES), dtype=bool)
    )

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, 17) lie in the box (n,)."""
        return np.asarray((np.abs(proposals) <= 1.0).all(axis=1))


def _search(
    cost: Callable[[Array], Array],
    start: Array,
    rng: np.random.Generator,
    width: float,
    generations: int,
) -> Array:
    """Return the factors (17,) of least cost, by CMA-ES from the factors `start` (17,).

    `cost` returns the costs (m,) of factors (m, 17).
    """

    def evaluate(proposals: Array) -> Array:
        """Return the costs (m,) of proposals, with a pull to the average build."""
        points = REACH * proposals  # in spreads of people
        logs = np.empty_like(points)
        pulls = np.empty(len(points))
        # one by one: how a product of matrices is rounded depends on their sizes
        for k, point in enumerate(points):
            logs[k] = _ROOT @ point
            pulls[k] = PULL * float(point @ point)
        return np.asarray(cost(np.exp(logs)) + pulls)

    mean = np.clip(np.linalg.solve(_ROOT, np.log(start)) / REACH, -1.0, 1.0)
    spread = np.full(len(NAMES), width / REACH)
    box = FactorBox(Start(mean, spread, np.zeros(len(NAMES))))
    population = default_population_size(len(NAMES))
    optimiser = CMAES(box, rng, population_size=population)
    problem = Problem(evaluate, box, population * generations, id="the build")
    minimise(problem, optimiser, budget_known=True)
    return np.asarray(np.exp(REACH * _ROOT @ problem.best))
