"""Hypotheses of each frame: what steps cost, which go on, and people as no clip shows them."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from posefit import Observation, exchanged_limbs, turned_poses
from posefit.arrays import Array
from posefit.fitting.tracker import Task
from posefit.geometry.skeleton import JOINTS, LIMBS, angles_of
from posefit.motion import built_in
from posefit.silhouette.mask import Silhouette
from posefit_exemplars.cost_model import PARTS, motion_step_costs
from posefit_exemplars.estimate import Estimate
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.hypotheses import SAME_DISTANCE, Hypotheses
from posefit_exemplars.proposals import Counts
from posefit_exemplars.tracker import ExemplarTracker
from tests.cases import each
from tests.exemplars.conftest import Walk, walk_of

BUDGET = 9760


def single(code: float, rate: float, joint: str = "lwrist") -> Hypotheses:
    """Return a hypothesis one joint of which is so far from the origin, and moves so far a frame, in codes' metres."""
    joints, rates = np.zeros((2, 1, len(JOINTS), 3))
    joints[0, JOINTS.index(joint), 1], rates[0, JOINTS.index(joint), 1] = np.sqrt(
        len(JOINTS)
    ) * np.array([code, rate])
    still = np.zeros((1, 66))
    nothing = np.zeros((1, 3))
    return Hypotheses(still, nothing, joints, still, nothing, rates)


def test_what_steps_cost_by_hand() -> None:
    def cost(code: float, rate: float, later: float, later_rate: float) -> float:
        return float(
            motion_step_costs(0.03, single(code, rate), single(later, later_rate))[0, 0]
        )

    # it goes on as it does
    np.testing.assert_allclose(cost(0.0, 0.06, 0.06, 0.06), 0.0, atol=1e-5)
    np.testing.assert_allclose(cost(0.1, 0.0, 0.1, 0.0), 0.0, atol=1e-5)
    # it stops for a frame, at speed 0
    np.testing.assert_allclose(cost(0.0, 0.06, 0.0, 0.06), 0.3, atol=1e-5)
    # half as fast
    np.testing.assert_allclose(cost(0.0, 0.06, 0.03, 0.06), 0.1, atol=1e-5)
    # off by a spread, a half; at the speed 1.4 it is off by 0.09 - 0.084: 0.02 and 0.15
    np.testing.assert_allclose(cost(0.0, 0.06, 0.09, 0.06), 0.17, atol=1e-5)
    # at rest, then at a spread's rate: 0.015 off and the rates a spread apart, an eighth
    # and a half; at speed 0.5, 0.0075 off and half the rates, and 0.1
    np.testing.assert_allclose(
        cost(0.0, 0.0, 0.0, 0.03), 1 / 32 + 1 / 8 + 0.1, atol=1e-5
    )


def test_every_joint_is_in_one_part() -> None:
    assert sorted(np.concatenate(PARTS)) == list(range(len(JOINTS)))


def test_each_limb_changes_its_speed_by_itself() -> None:
    def both(wrist: tuple[float, float], ankle: tuple[float, float]) -> Hypotheses:
        one = single(*wrist)
        other = single(*ankle, joint="rfoot")
        return one._replace(
            joints=one.joints + other.joints, rates=one.rates + other.rates
        )

    before = both((0.0, 0.06), (0.0, 0.06))
    # the arm stops, and the leg goes on
    after = both((0.0, 0.0), (0.06, 0.06))
    costs = motion_step_costs(0.03, before, after)
    np.testing.assert_allclose(costs, [[0.3]], atol=1e-5)


def test_legs_of_one_clip_go_with_the_arms_of_another() -> None:
    # nobody in the training clips walks with such arms
    walk = built_in.motion("walk-a", frames=12)
    other = built_in.motion("jump", frames=40)
    arms = np.concatenate([angles_of(LIMBS["left arm"]), angles_of(LIMBS["right arm"])])
    poses = walk.poses.copy()
    poses[:, arms] = other.poses[14:26, arms]
    scene = walk_of(replace(walk, name="both", poses=poses), (0.0, 70.0))
    path = list[Array]()
    fitted = list[Array]()
    for seed in range(3):
        frames = scene.track(evaluations=2440, seed=seed)
        fitted.append(scene.errors_mm(frames))
        tracker = ExemplarTracker(replace(scene.task, evaluations=2440))
        estimates = tracker.clip_path.follow(
            scene.observations,
            tracker.hypotheses.proposals,
            np.random.default_rng(seed),
        )
        frames = [
            replace(frames[0], pose=estimate.pose, translation=estimate.place)
            for estimate in estimates
        ]
        path.append(scene.errors_mm(frames))
    assert np.mean(fitted) < 0.6 * np.mean(path)


def estimates(walk: Walk, poses: Array, others: Array) -> Iterator[Estimate]:
    """Yield frames with these poses on the path, and beside each one other hypothesis."""
    places = walk.motion.translations
    for observation, pose, other, place in zip(
        walk.observations, poses, others, places, strict=False
    ):
        yield Estimate(
            pose,
            place,
            FrameCosts(walk.task, observation),
            0.0,
            (other[None], place[None]),
        )


def test_the_right_one_of_two_hypotheses_is_reported_even_where_the_path_is_turned_round(
    walker: Walk,
) -> None:
    truth = walker.motion.poses[:10]
    noise = (
        np.random.default_rng(0).normal(0.0, 0.05, truth.shape)
        * walker.motion.skeleton.free
    )
    follower = ExemplarTracker(replace(walker.task, evaluations=BUDGET)).hypotheses
    frames = list(
        follower.follow(
            estimates(walker, turned_poses(truth), truth + noise),
            np.random.default_rng(0),
        )
    )
    skeleton = walker.motion.skeleton
    apart = skeleton.joints(
        np.array([frame.pose for frame in frames])
    ) - skeleton.joints(truth)
    assert np.median(np.linalg.norm(apart, axis=2).mean(axis=1)) < 0.04
    assert all(
        frame.paths is not None and len(frame.paths.poses) == 24 for frame in frames
    )


def test_fewer_hypotheses_are_the_same_the_more_cameras_there_are() -> None:
    walk = walk_of(built_in.motion("walk-a", frames=2), (0.0, 90.0))
    joints = np.zeros((3, len(JOINTS), 3))
    # a fifth of the distance of the same pose from the first, and three fifths
    joints[1] += 0.2 * SAME_DISTANCE / np.sqrt(3.0)
    joints[2] += 0.6 * SAME_DISTANCE / np.sqrt(3.0)
    still = np.zeros((3, 66))
    hypotheses = Hypotheses(still, still[:, :3], joints, still, still[:, :3], joints)
    totals = np.array([0.0, 1.0, 2.0])
    task = replace(walk.task, evaluations=BUDGET)
    observation = walk.observations[0]

    def continuing(silhouettes: Sequence[Silhouette]) -> list[int]:
        shown = replace(observation, silhouettes=silhouettes)
        frame_costs = FrameCosts(task, shown)
        proposals = ExemplarTracker(task).hypotheses.proposals
        return proposals.continuing(hypotheses, totals, frame_costs).tolist()

    first, second = observation.silhouettes
    unknown = np.zeros_like(second.valid)
    hidden = Silhouette.of(np.zeros_like(second.mask), unknown)
    assert continuing([first, second]) == [0, 2]
    assert continuing([first, hidden]) == [0]


def test_what_an_earlier_track_had_is_tried_with_exchanged_and_with_other_limbs() -> (
    None
):
    walk = walk_of(built_in.motion("walk-a", frames=2), (0.0, 90.0))
    truth = walk.motion.poses[:1]
    arm = angles_of(LIMBS["left arm"])
    wrong = truth.copy()
    wrong[:, arm] += np.radians(60.0) * walk.motion.skeleton.free[arm]
    follower = ExemplarTracker(walk.task).hypotheses

    def tried(frame_costs: FrameCosts) -> Array:
        estimate = Estimate(
            truth[0],
            walk.motion.translations[0],
            frame_costs,
            0.0,
            (truth[:0], np.empty((0, 3))),
        )
        nothing = np.empty(0, dtype=np.int64)
        return follower.proposals.fresh(
            estimate, Hypotheses.none(), nothing, np.random.default_rng(0)
        )[0]

    observation = walk.observations[0]
    alone = tried(FrameCosts(walk.task, observation))
    earlier = FrameCosts(
        walk.task,
        replace(observation, estimate=(wrong[0], walk.motion.translations[0])),
    )
    *others, same, legs, arms, mended = tried(earlier)
    np.testing.assert_array_equal(others, alone)
    np.testing.assert_array_equal(same, wrong[0])
    for limbs, pose in (("legs", legs), ("arms", arms)):
        np.testing.assert_array_equal(
            pose, exchanged_limbs(walk.motion.skeleton, wrong, limbs)[0]
        )
    costs = earlier.full(np.array([same, mended]), walk.motion.translations[[0, 0]])
    assert costs[1] < 0.9 * costs[0]
    kept = np.setdiff1d(
        np.arange(66), np.concatenate([angles_of(bones) for bones in LIMBS.values()])
    )
    np.testing.assert_array_equal(mended[kept], wrong[0, kept])


@each(("alone", "weight"), [(False, 4.0), (True, 2.0)])
def test_beside_an_earlier_track_clips_count_half_as_much_against_two_views(
    alone: bool, weight: float
) -> None:
    walk = walk_of(built_in.motion("walk-a", frames=2), (0.0, 90.0))
    follower = ExemplarTracker(walk.task).hypotheses
    observation = walk.observations[0]
    place = walk.motion.translations
    poses = walk.motion.poses[[0, 0]]
    poses[1, angles_of(LIMBS["left arm"])] += 0.5
    hypotheses = Hypotheses.of(
        walk.task, poses, place[[0, 0]], np.array([-1, -1]), Hypotheses.none()
    )

    def apart(observation: Observation) -> float:
        frame_costs = FrameCosts(walk.task, observation, alone)
        costs, _ = follower._costs.of_poses(
            frame_costs, hypotheses.poses, hypotheses.places, 1.0
        )
        states, _ = follower._joined(frame_costs, hypotheses, costs, None)
        totals = states.paths.totals
        return float(totals[1] - totals[0])

    off = follower._exemplars.nearest(poses, 1)[1][:, 0] / 0.05**2
    clips = weight * np.log1p(0.5 * off)
    earlier = replace(observation, estimate=(poses[0], place[0]))
    np.testing.assert_allclose(
        apart(observation) - apart(earlier), 0.5 * (clips[1] - clips[0]), rtol=1e-6
    )
    assert clips[1] > clips[0] + 0.25 * weight


def test_a_track_of_one_frame_has_all_its_evaluations_for_fresh_hypotheses() -> None:
    walk = walk_of(built_in.motion("walk-a", frames=2), (0.0,))

    def counts_of(observations: Sequence[Observation], task: Task) -> Counts:
        tracker = ExemplarTracker(task)
        proposals = tracker.hypotheses.proposals
        estimates = tracker.clip_path.follow(
            observations, proposals, np.random.default_rng(0)
        )
        return proposals.counts(next(iter(estimates)).frame_costs)

    one, two = walk.observations[:1], walk.observations[:2]
    alone = counts_of(one, walk.task)
    several = counts_of(two, walk.task)
    assert alone.continued == 0
    assert several.continued > 0
    assert alone.fresh > several.fresh
