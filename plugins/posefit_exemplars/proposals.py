"""Proposals: the states that the path may be in, and where hypotheses begin.

The states of a frame continue the clips of the previous frame. A few times a second,
states from anywhere are added, which a look-up of the silhouette suggests. Hypotheses
begin at the pose of the path, at diverse states, and at reflections of the likeliest
hypotheses.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.fitting.contours import race_count
from posefit.fitting.tracker import Task
from posefit.geometry.skeleton import JOINTS, LIMBS, angles_of
from posefit.geometry.symmetry import exchanged_limbs
from posefit_exemplars import kernels
from posefit_exemplars.beam import Beam, diverse_best, joined, yaw_bins
from posefit_exemplars.cost_model import (
    JUMP_COST,
    TURN_SPREAD,
    ClipSteps,
    root_costs,
    squared_distances,
)
from posefit_exemplars.estimate import Estimate
from posefit_exemplars.exemplars import SAME_TURN, Exemplars
from posefit_exemplars.fits import (
    FEW_POSES,
    PosesAndPlaces,
    continued_evaluations,
    fresh_evaluations,
)
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.hypotheses import Hypotheses, same_distance
from posefit_exemplars.kernels import Rows
from posefit_exemplars.lookup import YAW_TOLERANCE, Lookup

BEAM_STATES = 200  # states that a frame keeps
# Share of the smaller of two parts: of the states where clips continue among all that
# are proposed, the others being for a search everywhere; of poses similar to the
# cheapest ones in such a search; and of reflections among the fresh hypotheses.
SMALLER_SHARE = 0.25

FRESH_SHARE = 0.45  # share of the evaluations for fresh hypotheses
LIMB_ROUNDS = 2  # how often each limb is tried
LIMB_ANGLES = [angles_of(bones) for bones in LIMBS.values()]


def limb_evaluations() -> float:
    """Return the evaluations of a search for the cheapest limbs of a pose."""
    return LIMB_ROUNDS * len(LIMBS) * (FEW_POSES + 1.0)


def min_fit_evaluations() -> float:
    """Return the least evaluations of fits: two fresh ones and one that continues."""
    return 2.0 * fresh_evaluations() + continued_evaluations()


def next_states(exemplars: Exemplars, steps: ClipSteps, count: int) -> Beam:
    """Return the states that a beam reaches most cheaply in one step, at most `count`.

    The costs are those of `ClipSteps.costs`, without that of an aligned root. Steps
    that cost as much as a jump are left out. Each pose that is reached gets the yaw at
    which its parent's clip continues, and one a little to either side.
    """
    beam = steps.beam
    sources = kernels.Sources(
        beam.totals,
        steps.codes,
        exemplars.near_groups(steps.codes),
    )
    least = beam.totals.min()
    bounds = kernels.Bounds(steps.pose_cost, least, least + JUMP_COST, count)
    slots = len(exemplars.tiles.states)
    buffers = kernels.Buffers(
        np.full(slots, np.inf),
        np.empty(slots, np.int64),
        np.empty(slots, np.int64),
    )
    bins = yaw_bins(steps.yaws)
    cheapest_first = np.argsort(beam.totals, kind="stable")
    # bin by bin, because a pose may be reached at several yaws, once in each bin
    by_bin: list[tuple[Rows, Rows, Array]] = []
    for number in np.unique(bins):
        rows = cheapest_first[bins[cheapest_first] == number]
        by_bin.append(
            kernels.cheapest_steps(sources, rows, exemplars.tiles, buffers, bounds)
        )
    states, parents, totals = map(np.concatenate, zip(*by_bin, strict=True))
    # In order before they are repeated: three runs in order are merged in a fraction of
    # the time that it takes to sort them.
    order = np.argsort(totals, kind="stable")
    states = states[order]
    parents = parents[order]
    turns = candidate_turns(steps.step.turn)[:, None]
    # turn by turn
    states = np.tile(states, len(turns))
    yaws = (steps.yaws[parents] + turns).ravel()
    totals = (totals[order] + steps.turn_costs(turns)).ravel()
    rows = diverse_best(exemplars, states, yaws, totals, count)
    places = steps.places[parents[rows % len(parents)]]
    return Beam(states[rows], yaws[rows], totals[rows], places)


def candidate_turns(spread: float) -> Array:
    """Return the turns (3,) at which a candidate is tried: none, and either way."""
    return np.array([0.0, -spread, spread])


def fresh_count(evaluations: float) -> int:
    """Return how many hypotheses of a frame are fresh, two or more."""
    return max(int(FRESH_SHARE * evaluations / fresh_evaluations()), 2)


def reflected_count(fresh: int) -> int:
    """Return how many of the fresh hypotheses are reflections."""
    return int(SMALLER_SHARE * fresh)


class StateProposals:
    """Proposes the states that a frame may be in."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._lookup = Lookup(task)
        self.exemplars = self._lookup.exemplars

    def first(
        self, frame_costs: FrameCosts, count: int, rng: np.random.Generator
    ) -> tuple[Beam, Array, int]:
        """Return at most `count` states of the first frame.

        They are near the first pose of the track, if one is known, and from anywhere.

        Returns:
            The states, their poses (n, 66), and the number of small pictures that the
            search used.
        """
        if self._task.first_pose is None:
            beam, used = self._anywhere(frame_costs, None, count, rng)
        else:
            near_count = int(SMALLER_SHARE * count)
            near = self._near_first_pose(self._task.first_pose, near_count)
            beam, used = self._anywhere(frame_costs, None, count - near_count, rng)
            beam = joined(replace(beam, totals=beam.totals + JUMP_COST), near)
        return *self._placed(frame_costs, beam), used

    def next(
        self,
        frame_costs: FrameCosts,
        steps: ClipSteps,
        count: int,
        everywhere: bool,
        rng: np.random.Generator,
    ) -> tuple[Beam, Array, int]:
        """Return at most `count` states of a frame after the first one.

        They are where clips continue and, if `everywhere`, states from anywhere.

        Returns:
            The states, their poses (n, 66), and the number of small pictures that the
            search used.
        """
        continued_count = int(SMALLER_SHARE * count)
        beam = next_states(self.exemplars, steps, continued_count)
        used = 0
        if everywhere:
            other, used = self._anywhere(
                frame_costs, steps.beam, count - continued_count, rng
            )
            beam = joined(other, beam)
        expected = beam.places
        beam, poses = self._placed(frame_costs, beam)
        if self._task.translation != "known":
            costs = root_costs(
                beam.places, expected, frame_costs.camera_position, steps.step.pose
            )
            beam = replace(beam, totals=beam.totals + costs)
        return beam, poses, used

    def _anywhere(
        self,
        frame_costs: FrameCosts,
        before: Beam | None,
        count: int,
        rng: np.random.Generator,
    ) -> tuple[Beam, int]:
        """Return at most `count` states from anywhere that fit.

        A look-up of the silhouette suggests poses and yaws. They are random if no
        camera shows the whole person. Poses similar to the cheapest ones are returned.

        Returns:
            The states, and the number of small pictures that were evaluated.
        """
        group_count = max(int(SMALLER_SHARE * count) // FEW_POSES, 1)
        tried = max(count - group_count * FEW_POSES, 1)
        known = frame_costs.yaw
        if before is None and known is None:
            known = self._task.yaw
        nearest = self._lookup.nearest(frame_costs.observation, tried, known)
        if nearest is not None:
            states = np.resize(nearest[0], tried)
            yaws = np.resize(nearest[1], tried)
            # the yaws of the table are `SAME_TURN` apart
            yaws += SAME_TURN * rng.uniform(-0.5, 0.5, tried)
        else:
            middle = 0.0 if known is None else known
            reach = np.pi if known is None else YAW_TOLERANCE
            states = self.exemplars.draw(tried, rng)
            yaws = middle + rng.uniform(-reach, reach, tried)
        beam, poses = self._placed(frame_costs, self._after_jump(states, yaws, before))
        costs = frame_costs.small(poses, beam.places)
        cheapest = np.argsort(costs, kind="stable")
        states, rows = self._similar(states[cheapest], count - tried, rng)
        yaws = yaws[cheapest[rows]]
        return self._after_jump(states, yaws, before), len(beam)

    def _similar(
        self, states: Rows, count: int, rng: np.random.Generator
    ) -> tuple[Rows, Rows]:
        """Return `count` states similar to the first of some states.

        Of the group of each state at most a few poses are drawn.

        Returns:
            The states (count,), and the rows (count,) of `states` that they are
            similar to.
        """
        members = self.exemplars.members
        starts = self.exemplars.starts
        drawn = list[Rows]()
        total = 0
        for group in self.exemplars.groups[states]:
            similar = members[starts[group] : starts[group + 1]]
            if len(similar) > FEW_POSES:
                similar = rng.choice(similar, FEW_POSES, replace=False)
            drawn.append(similar[: count - total])
            total += len(drawn[-1])
            if total == count:
                break
        rows = np.repeat(np.arange(len(drawn)), [len(similar) for similar in drawn])
        return np.concatenate(drawn), rows

    def _near_first_pose(self, angles: Array, count: int) -> Beam:
        """Return at most `count` states nearest to a first pose with angles (63,)."""
        yaw = self._task.yaw or 0.0
        codes = self.exemplars.codes
        code = self.exemplars.coding.of_poses(np.array([[yaw, 0.0, 0.0, *angles]]))[0]
        # squared distances up to a constant, which does not change their order
        squares = (codes**2).sum(axis=1) - 2.0 * (codes @ code)
        turns = candidate_turns(TURN_SPREAD)
        pose_count = min(count // len(turns), BEAM_STATES)
        nearest = np.argsort(squares, kind="stable")[:pose_count]
        states = np.tile(nearest, len(turns))
        yaws = yaw + np.repeat(turns, len(nearest))
        return self._after_jump(states, yaws, None)

    def _after_jump(self, states: Rows, yaws: Array, before: Beam | None) -> Beam:
        """Return states that a jump from `before` reaches, or that start a track."""
        total = 0.0
        place = self._task.anchor
        if before is not None:
            best = int(before.totals.argmin())
            total = before.totals[best] + JUMP_COST
            place = before.places[best]
        return Beam(
            states,
            yaws,
            np.full(len(states), total),
            np.repeat(place[None], len(states), axis=0),
        )

    def _placed(self, frame_costs: FrameCosts, beam: Beam) -> tuple[Beam, Array]:
        """Return states at the known root, or with aligned roots, and their poses."""
        poses = poses_of(self.exemplars, beam)
        places = frame_costs.aligned(poses, beam.places)
        return replace(beam, places=places), poses


def poses_of(exemplars: Exemplars, beam: Beam) -> Array:
    """Return the poses (n, 66) of a beam's states."""
    return exemplars.with_yaws(beam.states, beam.yaws)


class Counts(NamedTuple):
    """The numbers of hypotheses of a frame."""

    fresh: int
    diverse: int  # fresh ones from diverse states; others: the path and reflections
    continued: int


class HypothesisProposals:
    """Proposes where the hypotheses of a frame begin.

    Args:
        task: The task.
        exemplars: The poses of clips.
        evaluations: The budget of the fits in each frame.
    """

    def __init__(self, task: Task, exemplars: Exemplars, evaluations: float) -> None:
        self._task = task
        self._exemplars = exemplars
        self._evaluations = evaluations

    def counts(self, frame_costs: FrameCosts) -> Counts:
        """Return the numbers of hypotheses of a frame.

        There are fewer if several cameras show the person, because they leave less
        open. In the only frame of a track nothing continues, so all evaluations are for
        fresh hypotheses.
        """
        evaluations = self._evaluations / frame_costs.camera_count
        evaluations = max(evaluations, min_fit_evaluations())
        if frame_costs.alone:
            fresh = race_count(evaluations)
            continued = 0
        else:
            fresh = fresh_count(evaluations)
            rest = evaluations - fresh * fresh_evaluations()
            continued = int(rest / continued_evaluations())
        diverse = fresh - 1 - reflected_count(fresh)
        return Counts(fresh, diverse, continued)

    def continuing(
        self, hypotheses: Hypotheses, totals: Array, frame_costs: FrameCosts
    ) -> Rows:
        """Return the hypotheses that continue: the cheapest, without duplicates.

        Args:
            hypotheses: The n hypotheses of the frame before.
            totals: (n,) the costs of the likeliest sequences to them.
            frame_costs: The costs of the frame.
        """
        count = self.counts(frame_costs).continued
        flat = hypotheses.joints.reshape(len(hypotheses.joints), -1)  # (n, 81)
        joints = flat.astype(np.float32)
        reach = same_distance(frame_costs.camera_count)
        same = squared_distances(joints, joints) < reach**2 * len(JOINTS)
        rows: list[int] = []
        for row in np.argsort(totals, kind="stable"):
            if not same[row, rows].any():
                rows.append(int(row))
                if len(rows) == count:
                    break
        return np.array(rows)

    def fresh(
        self,
        estimate: Estimate,
        latest: Hypotheses,
        rows: Rows,
        rng: np.random.Generator,
    ) -> PosesAndPlaces:
        """Return the poses (n, 66) and places (n, 3) that fresh hypotheses begin at.

        They are the path, diverse states, and reflections of the likeliest hypotheses.
        If there is an earlier track, its pose is added: unchanged, with exchanged legs,
        with exchanged arms, and with limbs of clips.

        Args:
            estimate: The estimate of the frame on the path.
            latest: The hypotheses of the frame before.
            rows: The rows of `latest` that continue.
            rng: The random numbers.
        """
        frame_costs = estimate.frame_costs
        other_poses, other_places = estimate.alternatives
        poses = np.concatenate([estimate.pose[None], other_poses])
        places = np.concatenate([estimate.place[None], other_places])
        if not frame_costs.usable:
            return poses, places
        starts = [(poses, places)]
        likeliest = (poses, places)
        if len(rows):
            likeliest = latest.continued(rows)
        reflections = self.counts(frame_costs).fresh - len(poses)
        if reflections > 0:
            starts.append(self._reflected(estimate, likeliest, reflections))
        if frame_costs.earlier is not None:
            starts += self._from_earlier_track(frame_costs, *frame_costs.earlier, rng)
        all_poses, all_places = zip(*starts, strict=True)
        return np.concatenate(all_poses), np.concatenate(all_places)

    def _reflected(
        self, estimate: Estimate, likeliest: PosesAndPlaces, count: int
    ) -> PosesAndPlaces:
        """Return `count` reflections of the likeliest poses, at their places.

        There are fewer if there are too few poses. Each has a reflection per camera.
        """
        frame_costs = estimate.frame_costs
        needed = -(-count // frame_costs.camera_count)
        poses = likeliest[0][:needed]
        places = likeliest[1][:needed]
        reflected = frame_costs.reflected(poses, estimate.place)[:count]
        return reflected, np.resize(places, (len(reflected), 3))

    def _from_earlier_track(
        self,
        frame_costs: FrameCosts,
        earlier_pose: Array,
        earlier_place: Array,
        rng: np.random.Generator,
    ) -> list[PosesAndPlaces]:
        """Return the pose (66,) that an earlier track reported, and variants of it.

        The variants have exchanged legs, exchanged arms, or limbs of clips.
        """
        pose = earlier_pose[None]
        place = earlier_place[None]
        skeleton = self._task.body.skeleton
        return [
            (pose, place),
            (exchanged_limbs(skeleton, pose, "legs"), place),
            (exchanged_limbs(skeleton, pose, "arms"), place),
            self._with_other_limbs(frame_costs, pose, place, rng),
        ]

    def _with_other_limbs(
        self,
        frame_costs: FrameCosts,
        pose: Array,
        place: Array,
        rng: np.random.Generator,
    ) -> PosesAndPlaces:
        """Return a pose (1, 66) with the cheapest limbs, at its place (1, 3).

        Each limb is the cheapest among the pose's own and a few random poses of clips.
        The motion of one arm says little about the other, so a few clips combine to
        many gestures, as in the crossover of Deutscher and Reid (2005).
        """
        places = np.repeat(place, FEW_POSES + 1, axis=0)
        for limb in LIMB_ANGLES * LIMB_ROUNDS:
            poses = np.repeat(pose, FEW_POSES + 1, axis=0)
            drawn = self._exemplars.draw(FEW_POSES, rng)
            poses[1:, limb] = self._exemplars.angles[drawn][:, limb]
            pose = poses[frame_costs.full(poses, places).argmin()][None]
        return pose, place
