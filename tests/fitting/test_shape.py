"""The build of a person: factors on lengths and radii, and how well they are estimated."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from posefit import Camera, Frame, Observation, Silhouette, pose_costs, project
from posefit.fitting import shape
from posefit.fitting.bodies import HeldFrames, scaled_bodies
from posefit.fitting.cost import align
from posefit.fitting.shape import (
    FITTED_COVARIANCE,
    GIRTHS,
    LENGTHS,
    MODEL_SPREAD,
    NAMES,
    PULL,
    Shape,
    fit_shape,
    shaped,
)
from posefit.fitting.tracker import Task
from posefit.geometry.body import Body, varied
from posefit.geometry.skeleton import BONES
from posefit.motion import built_in

AVERAGE = Body.of(built_in.average_skeleton())
WALK = built_in.motion("walk", frames=40).frames(0, 40)
POSES = WALK.poses[::4]
PLACES = WALK.translations[::4]


def frames_at(places: Sequence[np.ndarray]) -> list[Frame]:
    nothing = np.zeros((1, 3), np.int64)
    return [
        Frame(pose, place, 0.0, nothing, 0)
        for pose, place in zip(POSES, places, strict=True)
    ]


def known_roots(cameras: list[Camera]) -> Task:
    return Task(AVERAGE, cameras, 1_000, 0.0, PLACES[0], translation="known")


def observed(body: Body, cameras: list[Camera]) -> list[Observation]:
    placed = zip(POSES, PLACES, strict=True)
    return [
        Observation([Silhouette.of(project(body, camera, *at)) for camera in cameras])
        for at in placed
    ]


def test_every_bone_belongs_to_one_group_of_lengths_and_one_of_girths() -> None:
    for groups in (LENGTHS, GIRTHS):
        plain = [bone for group in groups.values() for bone in group]
        assert len(plain) == len(set(plain))
        assert {
            bone
            for bone in BONES
            for kind in plain
            if bone in (kind, f"l{kind}", f"r{kind}")
        } == set(BONES)


def test_factors_multiply_what_they_name() -> None:
    changed = {"scale": 1.1, "thighs length": 0.9, "arms girth": 1.2}
    made = shaped(AVERAGE, np.array([changed.get(name, 1.0) for name in NAMES]))
    ratio = made.skeleton.lengths / AVERAGE.skeleton.lengths
    thighs_and_shank = [BONES.index(bone) for bone in ("lfemur", "rfemur", "ltibia")]
    assert ratio[thighs_and_shank] == pytest.approx([0.99, 0.99, 1.1])
    wide = made.radii / AVERAGE.radii
    np.testing.assert_allclose(wide[BONES.index("lradius")], 1.32)
    np.testing.assert_allclose(wide[BONES.index("thorax")], 1.1)


def test_a_length_that_is_measured_moves_those_that_go_with_it() -> None:
    thighs = NAMES.index("thighs length")
    weight = 2000.0
    log_length = 0.08

    def cost(factors: np.ndarray) -> np.ndarray:
        return weight * (np.log(factors[:, thighs]) - log_length) ** 2

    estimate = np.log(
        shape._search(cost, np.ones(len(NAMES)), np.random.default_rng(0), 0.5, 400)
    )
    expected = (
        weight
        * log_length
        / (weight * FITTED_COVARIANCE[thighs, thighs] + PULL)
        * FITTED_COVARIANCE[thighs]
    )
    # the least of the cost and the pull, by hand
    np.testing.assert_allclose(estimate, expected, atol=2e-3)
    assert estimate[NAMES.index("torso length")] < -0.03


def test_thigh_and_shank_keep_their_ratio_and_are_as_unsure_as_people_differ() -> None:
    thighs = NAMES.index("thighs length")
    shanks = NAMES.index("shanks length")

    def cost(factors: np.ndarray) -> np.ndarray:
        """Return costs that are least for a short thigh and a long shank."""
        off = np.log(factors[:, [thighs, shanks]]) - [-0.12, 0.08]
        return 2000.0 * (off**2).sum(axis=1)

    estimate = np.log(
        shape._search(cost, np.ones(len(NAMES)), np.random.default_rng(0), 0.5, 400)
    )
    assert estimate[thighs] == pytest.approx(estimate[shanks], abs=2e-3)
    assert estimate[thighs] == pytest.approx(-0.02, abs=5e-3)
    # ANSUR II: 0.049 and 0.044 with a correlation of 0.03, and 0.01 for joints' centres
    ratio = np.sqrt(0.049**2 + 0.044**2 - 2 * 0.03 * 0.049 * 0.044 + 2 * 0.01**2)
    for factor in (thighs, shanks):
        assert MODEL_SPREAD[factor] == pytest.approx(np.hypot(0.03, 0.5 * ratio))


@pytest.mark.parametrize("height", [None, 1.6])
@pytest.mark.parametrize("aligned", [True, False])
def test_many_bodies_cost_in_one_call_what_each_costs_alone(
    height: float | None, aligned: bool
) -> None:
    cameras = [
        Camera.around(WALK.translations.mean(axis=0), azimuth, 3.5, (160, 120))
        for azimuth in (0.0, np.pi / 2)
    ]
    observations = observed(AVERAGE, cameras)
    # a camera that knows nothing of one frame
    blind = Silhouette.of(*np.zeros((2, 120, 160), dtype=bool))
    observations[3] = Observation([blind, observations[3].silhouettes[1]])
    frames = frames_at(PLACES)
    factors = np.exp(0.05 * np.random.default_rng(4).standard_normal((5, len(NAMES))))
    held = HeldFrames.of(AVERAGE, cameras, observations, frames)
    bodies = scaled_bodies(AVERAGE, *shape._scales(factors), height)

    def alone(body: Body) -> float:
        total = 0.0
        for frame, observation in zip(frames, observations, strict=True):
            pose = frame.pose[None]
            place = frame.translation[None]
            views = body, cameras, observation.silhouettes
            if aligned:
                place = align(*views, pose, place)
            total += float(pose_costs(*views, pose, place, 0.4)[0][0])
        return total / len(frames)

    expected = [alone(shaped(AVERAGE, row, height)) for row in factors]
    for threads in (1, 3):
        costs = held.costs(*bodies, aligned, 0.4, threads)
        np.testing.assert_allclose(costs, expected, rtol=1e-12)


def test_varied_people_are_symmetric_and_within_their_percentage() -> None:
    made = varied(AVERAGE, 10.0, np.random.default_rng(3))
    ratio = made.skeleton.lengths / AVERAGE.skeleton.lengths
    assert np.abs(ratio - 1.0).max() <= 0.1
    assert ratio.std() > 0.01
    assert ratio[BONES.index("lfemur")] == pytest.approx(ratio[BONES.index("rfemur")])
    assert varied(AVERAGE, 0.0, np.random.default_rng(3)) is AVERAGE


def test_a_build_is_estimated_where_the_poses_are_known() -> None:
    true = varied(AVERAGE, 10.0, np.random.default_rng(5)).scaled(1.06, 1.06)
    middle = WALK.translations.mean(axis=0)
    rng = np.random.default_rng(0)
    cameras = [
        Camera.around(middle, azimuth, 3.5, (320, 240)) for azimuth in (0.0, np.pi / 2)
    ]
    frames = frames_at(PLACES)
    observations = observed(true, cameras)
    shape = fit_shape(known_roots(cameras), observations, lambda _: frames, rng)
    assert shape.body.stature == pytest.approx(true.stature, rel=0.03)
    for bones in (("lfemur", "ltibia"), ("lhumerus",)):
        limb = [BONES.index(bone) for bone in bones]
        fitted, expected = (
            body.skeleton.lengths[limb].sum() for body in (shape.body, true)
        )
        assert fitted == pytest.approx(expected, rel=0.06)


def test_poses_are_tracked_once_and_then_fitted_to_contours_with_the_new_body() -> None:
    true = varied(AVERAGE, 10.0, np.random.default_rng(5))
    middle = WALK.translations.mean(axis=0)
    cameras = [
        Camera.around(middle, azimuth, 3.5, (320, 240)) for azimuth in (0.0, np.pi / 2)
    ]
    observations = observed(true, cameras)
    # tracked poses that are a little off, as those of an average body are
    off = np.radians(4.0) * np.random.default_rng(1).standard_normal(POSES.shape)
    off *= np.append([False] * 3, AVERAGE.skeleton.free)[3:]
    frames = [
        replace(frame, pose=frame.pose + turn)
        for frame, turn in zip(frames_at(PLACES), off, strict=True)
    ]
    tracked = list[Body]()

    def follow(body: Body) -> list[Frame]:
        tracked.append(body)
        return frames

    task = known_roots(cameras)
    fitted = fit_shape(task, observations, follow, np.random.default_rng(0))
    assert len(tracked) == 1
    # the cost is that of poses nearer to the masks
    held = HeldFrames.of(AVERAGE, cameras, observations, frames)
    bodies = scaled_bodies(AVERAGE, *shape._scales(fitted.factors[None]), None)
    assert fitted.cost < 0.5 * held.costs(*bodies, False, 0.4)[0]


def test_one_camera_that_aligns_takes_the_height_as_known() -> None:
    camera = Camera.around(WALK.translations.mean(axis=0), np.pi / 2, 3.5, (160, 120))
    observations = observed(AVERAGE, [camera])
    places = [
        align(AVERAGE, [camera], observation.silhouettes, pose[None], place[None])[0]
        for observation, pose, place in zip(observations, POSES, PLACES, strict=True)
    ]
    frames = frames_at(places)
    rng = np.random.default_rng(0)
    task = replace(known_roots([camera]), translation="aligned")
    shape = fit_shape(task, observations, lambda _: frames, rng, height=1.55)
    assert shape.body.stature == pytest.approx(1.55)


def test_a_camera_that_knows_nothing_does_not_count_and_beta_does(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("posefit.fitting.shape.ROUNDS", ((0.5, 1),))
    cameras = [
        Camera.around(WALK.translations.mean(axis=0), azimuth, 3.5, (80, 60))
        for azimuth in (0.0, np.pi / 2)
    ]
    nothing = Silhouette.of(*np.zeros((2, 60, 80), dtype=bool))
    observations = observed(AVERAGE.scaled(1.2, 1.2), cameras[:1])
    blind = [
        Observation([*observation.silhouettes, nothing]) for observation in observations
    ]
    frames = frames_at(PLACES)

    def fit(count: int, observations: list[Observation], **known: float) -> Shape:
        rng = np.random.default_rng(0)
        task = known_roots(cameras[:count])
        return fit_shape(task, observations, lambda _: frames, rng, **known)

    alone = fit(1, observations)
    both = fit(2, blind)
    assert both.cost == alone.cost < 50.0
    np.testing.assert_array_equal(both.factors, alone.factors)
    missed = fit(1, observations, beta=1.0)
    rows = zip(observations, POSES[:, None], PLACES[:, None], strict=True)
    costs = [
        pose_costs(missed.body, cameras[:1], seen.silhouettes, *placed, 1.0)[0]
        for seen, *placed in rows
    ]
    assert missed.cost == pytest.approx(np.mean(costs))
