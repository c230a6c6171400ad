"""The cost model: the costs of poses in a frame, and of steps between frames.

A cost is the negative logarithm of a likelihood, up to a constant. The tracker first
finds a path through the poses of clips, and then the likeliest sequence of fitted
hypotheses. Both are cheapest paths, with these costs:

| stage | a pose in a frame | a step to the next frame |
|---|---|---|
| path | `ClipCosts.of_poses`, `ClipCosts.of_small` | `ClipSteps.costs` |
| hypotheses | `HypothesisCosts.of_poses`, landmarks | `HypothesisCosts.of_steps` |

`frame_costs` compares poses with silhouettes and landmarks, and `proposals` reaches new
states at the costs of `ClipSteps`. docs/studies/ablate.py measures the effect of each
cost.
"""

import math
from bisect import insort
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.landmarks import landmark_costs
from posefit.fitting.tracker import Task
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import JOINTS, LIMBS
from posefit_exemplars.beam import Beam
from posefit_exemplars.exemplars import Exemplars, about_vertical
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.hypotheses import Hypotheses
from posefit_exemplars.kernels import Codes, Rows
from posefit_exemplars.lookup import YAW_TOLERANCE

# The path's costs.

JUMP_COST = 12.0  # cost of a jump to any other pose; costs are over the temperature
# Standard deviation of turns away from the clip, for a thirtieth of a second; and of an
# angle from the start of a fit.
TURN_SPREAD = np.radians(8.0)
# Metres between an aligned root and where its clip continues, to the side or up. Along
# the line of sight of a single camera it is the spread of poses, which is larger: one
# silhouette says little about the distance from the camera.
ROOT_SPREAD = 0.01
# Cost, over the temperature, of a yaw off by twice the tolerance or more, for a
# thirtieth of a second.
WRONG_YAW_COST = 4.0

# The hypotheses' costs.

# Silhouettes cost this many times as much as on the path: fitted poses are nearer.
SHARPNESS = 2.0
# A distance from the clips of d LIBRARY_DISTANCE costs LIBRARY_COST log(1 + d^2 / 2).
# It is also the standard deviation of an unknown root from the start of a fit.
LIBRARY_DISTANCE = 0.05  # metres
LIBRARY_COST = 4.0  # for a thirtieth of a second
# The trunk and each limb may go on at these multiples of their speed, at these costs.
# Without them, tracks of damaged masks lose the person more often.
SPEED_COSTS: Mapping[float, float] = {0.0: 0.3, 0.5: 0.1, 1.0: 0.0, 1.4: 0.15}
_LIMBS = [np.array([JOINTS.index(bone) for bone in bones]) for bones in LIMBS.values()]
_TRUNK = np.setdiff1d(np.arange(len(JOINTS)), np.concatenate(_LIMBS))
PARTS: Sequence[Rows] = (_TRUNK, *_LIMBS)  # the joints of each
# The cost of a pose fitted to clean masks. If even the best frames cost more, masks or
# the body are less precise.
CLEAN_COST = 3.0
BEST_SHARE = 0.2  # the quantile of costs that represents the best frames


def squared_distances(codes: Codes, others: Codes) -> Codes:
    """Return the squared distances (..., n, m) of codes (..., n, D) and (..., m, D)."""
    squares = (
        (codes**2).sum(axis=-1)[..., None]
        - 2.0 * (codes @ others.swapaxes(-1, -2))
        + (others**2).sum(axis=-1)[..., None, :]
    )
    return np.asarray(np.maximum(squares, 0.0))


class Step(NamedTuple):
    """The time from one frame to the next, and the usual differences between them."""

    seconds: float  # negative in a track that runs backwards in time
    # metres, root mean square over joints, between a pose and where its clip continues
    pose: float
    turn: float = TURN_SPREAD
    max_turn: float = math.inf  # radians: the fastest possible turn

    @classmethod
    def of(cls, task: Task, spread: float) -> Self:
        """Return the step of a task; `spread` is for a thirtieth of a second."""
        seconds = (-1.0 if task.backwards else 1.0) / task.fps
        max_turn = math.inf
        if task.fastest_turn is not None:
            max_turn = task.fastest_turn / task.fps
        slack = math.sqrt(30.0 / task.fps)
        return cls(seconds, spread * slack, TURN_SPREAD * slack, max_turn)


@dataclass(frozen=True, eq=False)
class ClipSteps:
    """The steps from the states of a beam to the next frame, along their clips."""

    beam: Beam
    step: Step
    # where the clips of the n states continue
    codes: Codes  # (n, D)
    yaws: Array  # (n,)
    places: Array  # (n, 3)

    @classmethod
    def of(cls, exemplars: Exemplars, beam: Beam, step: Step) -> Self:
        """Return where the clips of a beam's states are a step later."""
        codes, turns, displacements = exemplars.continuation(beam.states, step.seconds)
        places = beam.places + about_vertical(displacements, beam.yaws)
        return cls(beam, step, codes, beam.yaws + turns, places)

    @property
    def pose_cost(self) -> float:
        """The cost of a pose for each square metre of its squared distance."""
        return 1.0 / (2.0 * self.step.pose**2)

    def turn_costs(self, turns: Array) -> Array:
        """Return the costs of turns away from the clips, in radians."""
        return np.asarray(0.5 * (turns / self.step.turn) ** 2)

    def costs(
        self,
        exemplars: Exemplars,
        after: Beam,
        camera: Array | None = None,
        *,
        aligned: bool = True,
    ) -> Array:
        """Return the costs (n, m) of steps to the states of the next frame.

        A pose costs half the square of its distance, in spreads, from where the clip
        continues. A yaw costs half the square of its turn away from the clip's yaw, in
        spreads. A step costs at most as much as a jump. One that turns faster than
        possible costs as much as a jump more.

        Args:
            exemplars: The poses of the clips.
            after: The m states of the next frame.
            camera: (3,) metres, the position of the only camera, or None for several.
            aligned: Whether the roots of the states are aligned. Those that are known
                cost nothing.
        """
        step = self.step
        codes = exemplars.codes[after.states]
        squares = squared_distances(self.codes, codes)
        # TOYAMA2001 (dynamics)
        pose_costs = squares * np.float32(self.pose_cost)
        # Most steps cost more than a jump by their poses alone, and need no more. Flat
        # indices of the others take a tenth of the time of a mask.
        near = np.flatnonzero(pose_costs < JUMP_COST)
        rows, columns = np.divmod(near, len(after))
        turns = wrapped(after.yaws[columns] - self.yaws[rows])
        cheap = pose_costs.take(near) + self.turn_costs(turns)
        if aligned:
            missed = after.places.take(columns, 0) - self.places.take(rows, 0)
            sights = lines_of_sight(after.places, camera)
            if sights is not None:
                sights = sights.take(columns, 0)
            cheap += root_deviation_costs(missed, sights, step.pose)
        costs = np.full(pose_costs.shape, JUMP_COST)
        costs.ravel()[near] = np.minimum(cheap, JUMP_COST)
        if step.max_turn < np.pi:
            turned = np.abs(wrapped(after.yaws - self.beam.yaws[:, None]))
            costs[turned > step.max_turn] += JUMP_COST
        return costs


def root_costs(
    places: Array, expected: Array, camera: Array | None, depth_spread: float
) -> Array:
    """Return the costs (..., n) of aligned roots at `places` (n, 3).

    Args:
        places: (n, 3) metres.
        expected: (..., n, 3) metres, where they were expected.
        camera: (3,) metres, the position of the only camera, or None for several.
        depth_spread: Metres, standard deviation along the line of sight of that camera.
    """
    sights = lines_of_sight(places, camera)
    return root_deviation_costs(places - expected, sights, depth_spread)


def lines_of_sight(places: Array, camera: Array | None) -> Array | None:
    """Return the directions (n, 3) from the only camera to places (n, 3).

    None without a `camera` (3,), if several show the person.
    """
    if camera is None:
        return None
    sights = places - camera
    lengths = np.linalg.norm(sights, axis=1, keepdims=True)
    return np.asarray(sights / np.maximum(lengths, np.finfo(np.float64).tiny))


def root_deviation_costs(
    missed: Array, sights: Array | None, depth_spread: float
) -> Array:
    """Return the costs of aligned roots that were expected elsewhere.

    Args:
        missed: (..., n, 3) metres, from where the roots were expected to where they
            are.
        sights: (n, 3) the `lines_of_sight`. Differences along the line of sight of a
            single camera cost less, because one silhouette says little about how far
            away a body is.
        depth_spread: Metres, standard deviation along that line.

    Returns:
        The costs (..., n).
    """
    # axis by axis, because NumPy's sums over an axis of length 3 take far longer
    x, y, z = (missed[..., axis] for axis in range(3))
    along: Array | float = 0.0
    if sights is not None:
        along = (x * sights[:, 0] + y * sights[:, 1] + z * sights[:, 2]) ** 2
    across = x**2 + y**2 + z**2 - along
    return np.asarray(
        np.log1p(0.5 * (across / ROOT_SPREAD**2 + along / depth_spread**2))
    )


class ClipCosts:
    """The costs of states of clips in a frame.

    Args:
        task: The task, for the time between frames.
        temperature: Divides silhouette costs, for a thirtieth of a second.
    """

    def __init__(self, task: Task, temperature: float) -> None:
        # at higher frame rates each frame counts for less, as it covers less time
        self._weight = 30.0 / task.fps
        self._temperature = temperature

    def of_poses(self, frame_costs: FrameCosts, poses: Array, places: Array) -> Array:
        """Return the costs (n,) of poses (n, 66) at places (n, 3)."""
        return np.asarray(
            self._of(frame_costs, poses, frame_costs.full(poses, places))
            + landmark_costs(frame_costs.landmarks(poses, places))
        )

    def of_small(self, frame_costs: FrameCosts, poses: Array, places: Array) -> Array:
        """Return rough costs (n,), by small pictures and without landmarks."""
        return self._of(frame_costs, poses, frame_costs.small(poses, places))

    def _of(self, frame_costs: FrameCosts, poses: Array, silhouettes: Array) -> Array:
        """Return the costs (n,) of poses by their yaws and their silhouettes (n,)."""
        costs = (
            yaw_costs(poses[:, 0], frame_costs.yaw) + silhouettes / self._temperature
        )
        return np.asarray(self._weight * costs)


def yaw_costs(yaws: Array, known: float | None) -> Array:
    """Return the costs (n,) of yaws (n,) in a frame with a yaw of about `known`.

    A yaw within the tolerance costs nothing. Without a known yaw all are free.
    """
    if known is None:
        return np.zeros(len(yaws))
    excess = np.abs(wrapped(yaws - known)) / YAW_TOLERANCE - 1.0
    return np.asarray(WRONG_YAW_COST * np.clip(excess, 0.0, 1.0))


class HypothesisCosts:
    """The costs of fitted hypotheses, and of the steps between them.

    Args:
        task: The task, for the time between frames.
        exemplars: The poses of clips.
        temperature: Divides silhouette costs on the path, for a thirtieth of a second.
        spread: Metres, the usual difference from where a pose leads on the path.
    """

    def __init__(
        self, task: Task, exemplars: Exemplars, temperature: float, spread: float
    ) -> None:
        self._exemplars = exemplars
        self._weight = 30.0 / task.fps
        self._temperature = temperature / SHARPNESS
        self._spread = spread

    def of_poses(
        self, frame_costs: FrameCosts, poses: Array, places: Array, noise: float
    ) -> tuple[Array, float]:
        """Return the costs of poses by their silhouettes and distances from the clips.

        Args:
            frame_costs: The costs of the frame.
            poses: (n, 66).
            places: (n, 3) metres.
            noise: How many times less precise the masks are than clean ones.

        Returns:
            The costs (n,), and the least cost of a silhouette, per cent.
        """
        squares = self._exemplars.nearest(poses, 1)[1][:, 0]
        silhouette_costs = frame_costs.full(poses, places)
        # in a second pass several cameras show limbs that no clip combines, so the
        # distance from the clips counts only as much as one view
        first_pass = frame_costs.earlier is None
        views = 1 if first_pass else frame_costs.camera_count
        library_cost = LIBRARY_COST / views
        # the only frame of a track is fitted longer, so silhouettes count more again
        if frame_costs.alone:
            library_cost /= SHARPNESS
        distances = np.log1p(0.5 * squares / LIBRARY_DISTANCE**2)
        costs = silhouette_costs / (noise * self._temperature)
        costs += library_cost * distances
        return self._weight * costs, float(silhouette_costs.min())

    def of_steps(
        self,
        frame_costs: FrameCosts,
        before: Hypotheses,
        after: Hypotheses,
    ) -> Array:
        """Return the costs (n, m) of steps to the m hypotheses of a frame.

        The cost grows with the distance of the joints from where the motion of the
        hypothesis leads, and with that of the root if it is unknown.
        """
        costs = motion_step_costs(self._spread, before, after)
        if frame_costs.root is None:
            expected = (before.places + before.shifts)[:, None]
            costs += root_costs(
                after.places, expected, frame_costs.camera_position, self._spread
            )
        return costs


def motion_step_costs(spread: float, before: Hypotheses, after: Hypotheses) -> Array:
    """Return the costs (n, m) of steps between hypotheses of successive frames.

    The trunk and each limb continue at their speed, at half of it, faster, or stop;
    the cheapest counts. The cost of a part is half the sum of two squares, and the
    cost of its change of speed. The squares are those of the distance of its joints
    from where the mean of both rates leads, and of the difference of the rates. Both
    are in spreads, root mean square over all joints.

    Args:
        spread: Standard deviation of a step, metres.
        before: The n hypotheses of one frame.
        after: The m hypotheses of the next frame.
    """
    scale = 0.5 / (spread**2 * len(JOINTS))
    total = np.zeros((len(before.joints), len(after.joints)))
    # (speeds, 1, 1) each, so that NumPy compares all speeds at once
    speeds = np.array([*SPEED_COSTS])[:, None, None]
    halves = (0.5 * speeds).astype(np.float32)
    squares = (speeds**2).astype(np.float32)
    prices = np.array([*SPEED_COSTS.values()], np.float32)[:, None, None]
    for part in PARTS:
        joints = _flat(before.joints[:, part])
        rates = _flat(before.rates[:, part])
        later = _flat(after.joints[:, part])
        later_rates = _flat(after.rates[:, part])
        changes = squared_distances(rates, later_rates)
        # half a frame after the one and half a frame before the other
        missed = squared_distances(
            joints + halves * rates, later - halves * later_rates
        )
        costs = scale * (missed + squares * changes) + prices  # (speeds, n, m)
        total += costs.min(axis=0)
    return total


def _flat(vectors: Array) -> Codes:
    """Return vectors (n, k, 3) of each hypothesis as one (n, 3 k)."""
    return vectors.reshape(len(vectors), -1).astype(np.float32)


class MaskNoise:
    """How precise the masks of one camera are, judged by the best frames so far."""

    def __init__(self) -> None:
        # the costs of the best hypotheses of all frames, the least first
        self._costs: list[float] = []

    def add(self, cost: float) -> None:
        """Take the least cost of a silhouette in the next frame, per cent."""
        insort(self._costs, cost)

    def of(self, frame_costs: FrameCosts) -> float:
        """Return how many times less precise a frame's masks are than clean ones.

        This is 1 with several cameras, and before the first frame is fitted.
        """
        if frame_costs.camera_count > 1 or not self._costs:
            return 1.0
        typical = self._costs[int(BEST_SHARE * len(self._costs))]
        return max(typical / CLEAN_COST, 1.0)
