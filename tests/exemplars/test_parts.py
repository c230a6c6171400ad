"""Poses composed of parts: what steps cost, which candidates are chosen, and people as no clip shows them."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.fitting.tracker import Observation
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import BONES, LIMBS, turns_of
from posefit.geometry.symmetry import turned_poses
from posefit.motion import built_in
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.parts import HIGHEST, OUTER, PARTS, Composer, Window, part_steps, parts_of
from posefit_exemplars.tracker import ExemplarTracker
from tests.exemplars.conftest import Walk, walk_of

YAW = 0.4  # metres that a radian counts


def test_every_bone_and_every_angle_is_in_one_part(two: Exemplars) -> None:
    assert sorted(bone for bones in PARTS.values() for bone in bones) == sorted(BONES)
    assert sorted(np.concatenate([part.turns for part in parts_of(two, YAW)])) == list(range(66))


def test_a_part_is_as_far_from_another_as_its_joints_are(two: Exemplars) -> None:
    trunk, *limbs = parts_of(two, YAW)
    for name, part in zip(OUTER, limbs, strict=True):
        poses = np.zeros((2, 66))
        poses[:, part.turns] = part.angles[[0, 20]]
        joints = two.coding.skeleton.joints(poses)
        codes = part.coded(part.angles[[0, 20]])
        # the other joints are at rest in both
        expected = np.sqrt(((joints[0] - joints[1]) ** 2).sum(axis=1).mean())
        np.testing.assert_allclose(np.linalg.norm(codes[0] - codes[1]), expected, rtol=1e-4, err_msg=name)
    turned = np.repeat(trunk.angles[:1], 2, axis=0)
    turned[1, 0] += 0.5
    np.testing.assert_allclose(np.linalg.norm(np.diff(trunk.coded(turned), axis=0)), 0.5 * YAW, rtol=1e-5)


def test_rates_are_those_of_the_clip_and_groups_hold_every_state_once(two: Exemplars) -> None:
    for part in parts_of(two, YAW):
        rows = np.arange(1, two.lasts[0])  # of the first clip, inside
        apart = part.codes[rows + 1] - part.codes[rows - 1]
        if part.yaw:  # states face the same way; their rates do not
            apart, rates = apart[:, :-1], part.rates[rows, :-1]
        else:
            rates = part.rates[rows]
        np.testing.assert_allclose(rates, apart / (two.times[rows + 1] - two.times[rows - 1])[:, None], atol=1e-3)
        assert sorted(np.concatenate(part.members)) == list(range(len(part.angles)))
        assert all(centre in members for centre, members in zip(part.centres, part.members, strict=True))


def test_what_steps_cost_by_hand() -> None:
    def cost(code: float, rate: float, later: float, later_rate: float) -> float:
        numbers = [np.array([[value]], dtype=np.float32) for value in (code, rate, later, later_rate)]
        return float(part_steps(0.03, *numbers)[0, 0])

    np.testing.assert_allclose(cost(0.0, 0.06, 0.06, 0.06), 0.0, atol=1e-6)  # it goes on as it does
    np.testing.assert_allclose(cost(0.1, 0.0, 0.1, 0.0), 0.0, atol=1e-6)
    np.testing.assert_allclose(cost(0.0, 0.06, 0.0, 0.06), 0.3, atol=1e-6)  # it stops for a frame, at speed 0
    np.testing.assert_allclose(cost(0.0, 0.06, 0.03, 0.06), 0.1, atol=1e-6)  # half as fast
    # off by a spread at speed 1, a half; at the speed 1.4 it is off by 0.09 - 0.084, which is 0.02, and 0.15
    np.testing.assert_allclose(cost(0.0, 0.06, 0.09, 0.06), 0.17, atol=1e-6)
    # at rest, then at a spread's rate: 0.015 off and the rates a spread apart, an eighth and a half; at speed 0.5,
    # 0.0075 off and half the rates, 1/32 and 1/8, and 0.1
    np.testing.assert_allclose(cost(0.0, 0.0, 0.0, 0.03), 1 / 32 + 1 / 8 + 0.1, atol=1e-6)
    assert cost(0.0, 0.0, 1.0, 0.0) == HIGHEST


def test_legs_of_one_clip_go_with_the_arms_of_another() -> None:
    # nobody in the training clips walks with such arms
    walk, other = built_in.motion("walk-a", frames=12), built_in.motion("jump", frames=40)
    arms = np.concatenate([turns_of(LIMBS["left arm"]), turns_of(LIMBS["right arm"])])
    poses = walk.poses.copy()
    poses[:, arms] = other.poses[14:26, arms]
    scene = walk_of(replace(walk, name="both", poses=poses), (0.0, 70.0))
    training = [*scene.task.training, replace(other, skeleton=walk.skeleton)]
    scene = replace(scene, task=replace(scene.task, training=training, evaluations=2440))
    errors = {
        parts: np.mean([scene.errors_mm(scene.track(parts=parts, seed=seed)).mean() for seed in range(3)])
        for parts in (False, True)
    }
    assert errors[True] < 0.7 * errors[False]


def test_a_composed_pose_is_reported_after_the_lag_within_the_budget(walker: Walk) -> None:
    for lag in (0, 4, 15):
        taken: list[Observation] = []
        stream = (taken.append(one) or one for one in walker.observations)
        tracker = ExemplarTracker(replace(walker.task, evaluations=1000), lag=lag, parts=True)
        for number, frame in enumerate(tracker.track(stream, np.random.default_rng(0)), 1):
            assert len(taken) - number <= tracker.lag
            assert 500 < frame.evaluations <= 1000
        assert tracker.lag == (lag + 6 if lag else 0)


def test_two_windows_are_fused_part_by_part(walker: Walk) -> None:
    tracker = ExemplarTracker(walker.task, parts=True)
    assert tracker.composer is not None
    composer, rows = tracker.composer, range(4)
    looks = [FrameCosts(walker.task, walker.observations[k]) for k in rows]
    truth, places = walker.motion.poses[:4], walker.motion.translations[:4]
    window, other = (Window(looks, truth.copy(), places.copy(), 0, np.zeros(66)) for _ in range(2))
    wrong = {"left arm": 0.9, "right leg": -0.5}
    for one, (name, off) in zip((window, other), wrong.items(), strict=True):
        one.poses[:, turns_of(LIMBS[name])[0]] += off
    assert composer.fused(window, other) == 4 * 2**5
    np.testing.assert_allclose(window.poses, truth)


def test_the_likeliest_of_several_poses_is_a_sequence(walker: Walk) -> None:
    tracker = ExemplarTracker(walker.task, parts=True)
    assert tracker.composer is not None
    composer, rng = tracker.composer, np.random.default_rng(0)
    looks = [FrameCosts(walker.task, walker.observations[k]) for k in range(4)]
    truth, places = walker.motion.poses[:4], walker.motion.translations[:4]
    window = Window(looks, turned_poses(truth), places.copy(), 1, np.zeros(66))
    window.poses[0] = truth[0]  # told already: it stays
    both = [np.stack([turned, pose]) for turned, pose in zip(window.poses, truth, strict=True)]
    alone = [composer.alone(looks[t], both[t], np.repeat(places[t : t + 1], 2, axis=0), 2.0, rng) for t in (1, 2, 3)]
    assert [used for _, used in alone] == [2.0, 2.0, 2.0]  # too few to change anything: their costs alone
    through = composer.through(window, [None, *(whole for whole, _ in alone)])
    np.testing.assert_allclose(wrapped(through.poses - truth), 0.0, atol=1e-9)


def test_a_frame_of_one_camera_uses_at_most_its_evaluations(walker: Walk) -> None:
    for evaluations, parts in ((1000, True), (2440, True), (9760, None)):
        tracker = ExemplarTracker(replace(walker.task, evaluations=evaluations), parts=parts)
        frames = list(tracker.track(walker.observations[:12], np.random.default_rng(0)))
        assert 0.5 * evaluations < max(frame.evaluations for frame in frames) <= evaluations
    assert ExemplarTracker(replace(walker.task, evaluations=2440)).composer is None


def test_sweeps_use_at_most_their_evaluations(walker: Walk, monkeypatch: pytest.MonkeyPatch) -> None:
    compose, over = Composer.compose, []

    def watched(composer: Composer, window: Window, evaluations: float, rng: np.random.Generator) -> float:
        used = compose(composer, window, evaluations, rng)
        over.append(used - evaluations * sum(look.usable for look in window.looks[window.fixed :]))
        return used

    monkeypatch.setattr(Composer, "compose", watched)
    for evaluations in (300, 700, 1000, 1700, 2440):
        tracker = ExemplarTracker(replace(walker.task, evaluations=evaluations), parts=True)
        list(tracker.track(walker.observations, np.random.default_rng(0)))
    assert max(over) < 1e-6
