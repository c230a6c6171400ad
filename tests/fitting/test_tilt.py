"""The root's pitch and roll: learned with the latents, followed from pose to pose, never a box around upright."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from posefit import Body, Camera, Motion, SearchSpace, Task
from posefit.arrays import Array
from posefit.fitting.prior import Tilt
from posefit.fitting.synthesis import Prediction, Predictor, SynthesisTracker
from posefit.fitting.tracker import Observation
from posefit.motion import built_in
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit_priors.pca import PCA
from tests.cases import each
from tests.sources.test_sapso import Line

LEFT_HIP = 3  # of a pose: its first joint angle
DEGREE = np.radians(1.0)
WALKS = [built_in.motion(style) for style in built_in.other_styles("walk")]
NOTHING = Observation([], np.zeros(3))


def bending(pitch: Array, roll: Array, hip: Array | float = 0.0) -> Motion:
    poses = np.zeros((len(pitch), 66))
    poses[:, 1], poses[:, 2], poses[:, LEFT_HIP] = pitch, roll, hip
    return Motion(
        "bending", built_in.average_skeleton(), poses, np.zeros((len(pitch), 3)), 30.0
    )


def task_of(*training: Motion, yaw: float | None = 0.3) -> Task:
    return Task(
        Body.of(built_in.average_skeleton()),
        [Camera.around(np.zeros(3), 0.0, 3.0, (8, 8))],
        10,
        yaw,
        np.zeros(3),
        training=training,
    )


def space_of(tilt: Tilt, reach: float = 1.0) -> SearchSpace:
    return SearchSpace(Line(), np.zeros(3), np.full(3, reach), np.zeros(3), tilt=tilt)


def test_bent_hips_tilt_as_in_training() -> None:
    hip = np.linspace(-1.0, 1.0, 201)
    tilt = Tilt.of(
        Line(), [bending(0.2 + 0.9 * hip, -0.1 * hip, hip)], 1.0, 2.0 * DEGREE
    )
    poses = space_of(tilt).decode(
        np.array([[0.0, 0.0, 0.0, -0.8], [0.0, 0.0, 0.0, 0.8]])
    )[0]
    # a third of a latent's variance and a ridge of 0.05: slopes come out smaller by 0.333 / 0.383
    shrunk = 0.8 / (1.0 + 0.05 / np.mean(hip**2))
    np.testing.assert_allclose(
        poses[:, 1], 0.2 + 0.9 * shrunk * np.array([-1.0, 1.0]), rtol=1e-9
    )
    np.testing.assert_allclose(
        poses[:, 2], -0.1 * shrunk * np.array([-1.0, 1.0]), rtol=1e-9
    )
    lost = 0.9 * (1.0 - shrunk / 0.8)  # what the ridge leaves to the range
    np.testing.assert_allclose(
        [tilt.low[0], tilt.high[0]], [-lost - 2.0 * DEGREE, lost + 2.0 * DEGREE]
    )


def test_latents_that_training_never_had_tilt_no_farther_than_training() -> None:
    hip = np.linspace(-0.1, 0.1, 50)
    tilt = Tilt.of(Line(), [bending(4.0 * hip, 0.0 * hip, hip)], 1.0, 0.0)
    pitches = space_of(tilt).decode(
        np.array([[0.0, 0.0, 0.0, -1.0], [0.0, 0.0, 0.0, 1.0]])
    )[0][:, 1]
    assert pitches == pytest.approx(tilt.mean[:2, 0])
    assert pitches[1] < 0.4


@each("turns", [0, 1, -2])
def test_a_roll_past_half_a_turn_is_the_same_as_before_it(turns: int) -> None:
    rolls = np.radians([170.0, 175.0, -175.0, -170.0]) + 2.0 * np.pi * turns
    tilt = Tilt.of(Line(), [bending(np.zeros(4), rolls)], 1.0, DEGREE)
    roll = space_of(tilt).decode(np.zeros((1, 4)))[0][0, 2]
    assert np.cos(roll) == pytest.approx(-1.0)
    np.testing.assert_allclose([tilt.low[1], tilt.high[1]], np.radians([-11.0, 11.0]))


def test_a_turn_over_in_training_may_be_repeated() -> None:
    cartwheel = bending(np.zeros(73), np.linspace(0.0, 2.0 * np.pi, 73))
    predictor = Predictor(task_of(cartwheel), Line(), Prediction())
    space = predictor.space(NOTHING)
    assert space.periodic.tolist() == [False, False, True, False]
    rolls = []
    proposal = np.array([0.0, 0.0, 0.9, 0.0])
    for _ in range(50):  # as far as it goes to one side, from frame to frame
        predictor.commit(proposal)
        rolls.append(space.decode(proposal[None])[0][0, 2])
        space = predictor.space(NOTHING)
    np.testing.assert_allclose(np.diff(rolls), np.radians(0.9 * 15.0))
    assert rolls[-1] - rolls[0] > 2.0 * np.pi
    assert not space.periodic[2]


def test_a_part_of_the_range_moves_with_the_last_pose_and_stays_in_it() -> None:
    rolling = bending(np.zeros(500), np.random.default_rng(0).uniform(-1.0, 1.0, 500))
    tilt = Tilt.of(Line(), [rolling], 1.0, 0.0)
    predictor = Predictor(task_of(rolling), Line(), Prediction(), tilt)
    space = predictor.space(NOTHING)
    np.testing.assert_allclose(
        space.centre[2] + np.array([-1.0, 1.0]) * space.half[2],
        [tilt.low[1], tilt.high[1]],
    )
    centres = []
    for roll in (0.5, 0.0, 1.0, 1.0, 1.0, 1.0, 1.0):
        last = space.coordinates(np.array([0.0, 0.0, roll, 0.0]))
        moved = space.centre[2] + roll * space.half[2]
        predictor.commit(np.array([0.0, 0.0, roll, 0.0]))
        space = predictor.space(NOTHING)
        assert space.half[2] == pytest.approx(np.radians(15.0))
        np.testing.assert_allclose(
            space.coordinates(space.start.mean), last, atol=1e-12
        )
        centres.append(space.centre[2])
        assert centres[-1] == pytest.approx(min(moved, tilt.high[1] - np.radians(15.0)))
    assert centres[-1] == pytest.approx(tilt.high[1] - np.radians(15.0))


@each("how", [Prediction(), Prediction(tilt="box")])
def test_nothing_to_learn_from_or_a_box_is_a_box_around_upright(
    how: Prediction,
) -> None:
    training = [bending(np.full(9, 0.8), np.zeros(9))] if how.tilt == "box" else []
    predictor = Predictor(task_of(*training), Line(), how)
    space = predictor.space(NOTHING)
    assert space.tilt is None
    np.testing.assert_allclose(space.centre[:3], [0.3, 0.0, 0.0])
    np.testing.assert_allclose(space.half[:3], np.radians([45.0, 15.0, 15.0]))
    predictor.commit(np.array([0.5, 1.0, 1.0, 0.0]))
    np.testing.assert_array_equal(predictor.space(NOTHING).centre[1:3], 0.0)


def test_a_first_pose_that_is_given_begins_with_the_tilt_that_goes_with_it() -> None:
    hip = np.linspace(-1.0, 1.0, 100)
    lying = bending(0.9 * hip + np.where(hip > 0.5, 0.8, 0.0), 0.0 * hip, hip)
    task = replace(task_of(lying), first_pose=np.eye(63)[0] * 0.4)
    space = Predictor(task, Line(), Prediction()).space(NOTHING)
    assert space.centre[1] != 0.0
    np.testing.assert_allclose(
        space.coordinates(space.start.mean), [0.3, 0.0, 0.0, 0.4], atol=1e-12
    )


def test_a_learned_prior_has_a_box_unless_its_tilt_is_to_be_learned() -> None:
    task = task_of(*WALKS)
    learned = PCA().fit(task.angles)

    def tilt(choice: TrackOptions) -> Tilt | None:
        follow: Any = prepare(choice, task).follow
        tracker = follow.args[0](task)
        assert isinstance(tracker, SynthesisTracker)
        return (
            Predictor(task, learned, tracker.prediction, tracker.tilt)
            .space(NOTHING)
            .tilt
        )

    before = Tilt.of(Line(), [bending(np.full(4, 0.5), np.zeros(4))], 1.0, DEGREE)
    assert (
        Predictor(task_of(), Line(), Prediction(), before).space(NOTHING).tilt is before
    )
    assert tilt(TrackOptions(method="@pca")) is not None
    assert tilt(TrackOptions(method="@pca", settings={"tracker.tilt": "box"})) is None
    assert tilt(TrackOptions(method=("annealed", learned))) is None
    assert (
        tilt(
            TrackOptions(
                method=("annealed", learned), settings={"tracker.tilt": "learned"}
            )
        )
        is not None
    )
    assert (
        tilt(TrackOptions(method="@pca", settings={"tracker.variant": "paper"})) is None
    )
    # what is set wins: it is not quietly a box
    with pytest.raises(ValueError, match="tilt must be"):
        tilt(
            TrackOptions(
                method="@pca",
                settings={"tracker.variant": "paper", "tracker.tilt": "learned"},
            )
        )
