"""The variable-structure multiple-model tracker, CN101894278: every step but the filter itself, on cases done by hand."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posefit import Body, Camera, Task
from posefit.arrays import Array
from posefit.motion import built_in
from posefit_vsmm import joints
from posefit_vsmm.groups import TOPOLOGY, Topology
from posefit_vsmm.imm import Belief, Measurement
from posefit_vsmm.joints import (
    JointFilter,
    default_rules,
    detect,
    nearest_crossings,
    patent_rules,
    two_crossings,
)
from posefit_vsmm.measurement import JointCameras, JointMeasurement
from posefit_vsmm.motion import MotionModels, library, lifted, ridge, without_heading
from posefit_vsmm.preprocess import Lines, lines_of
from posefit_vsmm.state import (
    AT,
    ENDS,
    ERROR,
    HELD_ANGLES,
    POINTS,
    decode,
    encode,
    inverse_tangents,
    minus,
    plus,
    tangents,
)
from posefit_vsmm.switching import (
    PatentForm,
    Switching,
    limb_angles,
    normalised,
    regrouped,
    requested_group,
)
from posefit_vsmm.tracker import VSMM, TrackFilter
from tests.cases import each

SIZE = (240, 320)  # rows, columns


def canvas() -> np.ndarray:
    return np.zeros(SIZE, dtype=np.uint8)


def lines(image: np.ndarray) -> Lines:
    return lines_of(image > 0)


def test_gaps_of_a_pixel_close_and_specks_go() -> None:  # VSMM 1.3
    image = canvas()
    image[50:150, 100:140] = 1
    image[100, 100:140] = 0  # a line through the body: a gap of one pixel
    image[20:23, 20:23] = 1  # nine pixels, a speck
    bar = lines(image)
    assert len(bar.pixels) == 100 * 40
    assert np.allclose(bar.pixels.mean(axis=0), [120.0, 100.0])


def test_a_bar_has_its_outline_and_its_middle_line() -> None:  # VSMM 1.4
    image = canvas()
    image[100:111, 60:161] = 1  # 11 rows, 101 columns
    bar = lines(image)
    assert set(bar.contour[:, 1]) == {k + 0.5 for k in range(100, 111)}
    assert len(bar.contour) == 2 * (11 + 101) - 4  # each pixel of the border once
    inner = bar.skeleton[(bar.skeleton[:, 0] > 70) & (bar.skeleton[:, 0] < 150)]
    assert np.allclose(inner[:, 1], 105.5, atol=1.0)
    left, right = sorted(bar.ends[:, 0])
    assert left < 70 < 150 < right


def test_a_bump_of_the_outline_is_no_end_point() -> None:
    image = canvas()
    image[60:200, 100:130] = 1
    cv2.circle(image, (131, 120), 5, 1, -1)  # a bump on the bar's right side
    assert all(abs(end[1] - 120) > 40 for end in lines(image).ends)
    assert lines_of(np.zeros(SIZE, dtype=bool)) is None


def figure() -> tuple[np.ndarray, Array]:
    """Return a stick figure with thick limbs, and where its 17 points are."""
    places = {
        "head": (160, 50), "root": (160, 130), "torso": (160, 105), "left clavicle": (165, 80),
        "right clavicle": (155, 80), "left shoulder": (175, 80), "right shoulder": (145, 80),
        "left elbow": (205, 90), "right elbow": (115, 90), "left hand": (235, 100), "right hand": (85, 100),
        "left hip": (168, 135), "right hip": (152, 135), "left knee": (180, 175), "right knee": (140, 175),
        "left foot": (192, 215), "right foot": (128, 215),
    }  # fmt: skip
    image = canvas()
    cv2.circle(image, places["head"], 14, 1, -1)
    cv2.line(image, (160, 60), (160, 130), 1, 17)
    for side in ("left", "right"):
        cv2.line(image, places[f"{side} shoulder"], (160, 80), 1, 9)
        cv2.line(image, places[f"{side} shoulder"], places[f"{side} hand"], 1, 7)
        cv2.line(image, places[f"{side} hip"], (160, 130), 1, 9)
        cv2.line(image, places[f"{side} hip"], places[f"{side} foot"], 1, 9)
    return image, np.array([places[name] for name in POINTS], dtype=np.float64)


def detection() -> tuple[dict[str, Array], dict[str, float], Array]:
    """Return the points detected in the stick figure, the rules' confidence, and where points were expected."""
    image, places = figure()
    expected = places + np.random.default_rng(0).normal(0.0, 6.0, places.shape)
    points, confidence, _ = joints_in(image, expected)
    return (
        dict(zip(POINTS, points, strict=True)),
        dict(zip(POINTS, confidence, strict=True)),
        expected,
    )


def joints_in(image: np.ndarray, expected: Array) -> tuple[Array, Array, int]:
    rules = default_rules()._replace(bias=np.zeros((len(POINTS), 2)))
    return detect(lines(image), expected, np.full(len(POINTS), 30.0), 85.0, 14.0, rules)


def test_the_head_is_where_a_ring_catches_most_of_the_contour() -> None:  # VSMM 2.1
    points, sure, _ = detection()
    assert np.linalg.norm(points["head"] - [160.5, 50.5]) < 3.0
    assert sure["head"] > 0.5


def test_the_root_is_the_centroid() -> None:  # VSMM 2.2
    points, _, _ = detection()
    rows, columns = np.nonzero(figure()[0])
    assert np.allclose(
        points["root"], [columns.mean() + 0.5, rows.mean() + 0.5], atol=0.5
    )


def test_the_torso_is_carried_along_with_the_root() -> None:  # VSMM 2.3
    points, _, expected = detection()
    moved = points["root"] - expected[AT["root"]]
    for name in ("torso", "left clavicle", "right shoulder", "left hip"):
        assert np.allclose(points[name], expected[AT[name]] + moved)


def test_end_points_are_hands_and_feet() -> None:  # VSMM 2.4
    points, sure, _ = detection()
    _, places = figure()
    for name in ("left hand", "right hand", "left foot", "right foot"):
        assert np.linalg.norm(points[name] - places[AT[name]]) < 6.0
        assert sure[name] > 0.0


def test_an_end_point_out_of_reach_is_not_assigned() -> None:  # Interpretation V15
    image, places = figure()
    expected = places.copy()
    expected[AT["left hand"]] += [0.0, 60.0]
    points, sure, unassigned = joints_in(image, expected)
    assert sure[AT["left hand"]] == 0.0
    assert np.array_equal(points[AT["left hand"]], expected[AT["left hand"]])
    assert unassigned == 1


# Interpretation V15
def test_to_the_letter_the_nearest_end_point_is_taken_first_and_by_one_joint() -> None:
    # by hand, on a line: the left foot at 0 and the right one at 3, end points at 2 and -9: the right foot is nearest
    # to 2, and the left one, which is nearest to it too, takes the other; together they would be 2 + 12 or 1 + 9
    _, expected = figure()
    ends = np.array([[130.0, 215.0], [60.0, 215.0]])
    expected[AT["left foot"]], expected[AT["right foot"]] = (
        (128.0, 215.0),
        (131.0, 215.0),
    )
    for nearest, rules in enumerate((default_rules(), patent_rules())):
        gates = np.full(len(POINTS), 1e3 if nearest else 30.0)
        tips, unassigned = joints._tips(
            ends, expected[joints._TIPS], gates[joints._TIPS], rules.pairs
        )
        assert np.array_equal(tips["right foot"], ends[0])
        assert ("left foot" in tips, unassigned) == (nearest, not nearest)
    assert np.array_equal(tips["left foot"], ends[1])


# Interpretation V8
def test_plain_joint_errors_are_unbiased_and_the_torsos_are_the_roots() -> None:
    (bias, deviation, *_), (plain_bias, plain_deviation, *_) = (
        default_rules(),
        patent_rules(),
    )
    assert bias.any()
    assert not plain_bias.any()
    assert (deviation[AT["torso"]] > deviation[AT["root"]]).all()
    assert np.array_equal(plain_deviation[AT["torso"]], deviation[AT["root"]])


def test_hidden_joints_may_be_imputed() -> None:  # Interpretation V9
    confidence = np.ones(17)
    confidence[AT["left hand"]] = 0.0
    measured = JointMeasurement(
        np.zeros((17, 2)), confidence, np.ones((17, 2)), 0
    ).imputed(np.full((17, 2), 9.0))
    assert (measured.confidence == 1.0).all()
    assert np.array_equal(np.flatnonzero(measured.points[:, 0]), [AT["left hand"]])


# Interpretation V6
def test_a_step_of_the_clip_is_a_quarter_of_one_of_the_video() -> None:
    video, clip = (running(variant=variant).models for variant in ("default", "patent"))
    assert (video.share, clip.share) == (1.0, 0.25)


# VSMM 2.5
def test_knees_are_where_the_parallel_to_the_feet_crosses_the_legs() -> None:
    points, sure, _ = detection()
    image, _ = figure()
    rows, _ = np.nonzero(image)
    # the feet stand level, and so does the parallel
    height = rows[rows + 0.5 > points["root"][1]].mean() + 0.5
    for name, side in (("left knee", 1.0), ("right knee", -1.0)):
        assert sure[name] > 0.0
        assert abs(points[name][1] - height) < 2.0
        # from the hip (8, 135) to the foot (32, 215)
        leg = 160.5 + side * (8.0 + (height - 135.5) * 24.0 / 80.0)
        assert abs(points[name][0] - leg) < 2.5


def below_the_root(**places: tuple[float, float]) -> Array:
    """Return where points are expected of legs below a root at (50, 90)."""
    expected = np.zeros((len(POINTS), 2))
    for name, place in {"root": (50.0, 90.0), **places}.items():
        expected[AT[name.replace("_", " ")]] = place
    return expected


def upright_legs(*columns: float) -> Lines:
    """Return lines of legs that stand upright around y = 150."""
    legs = np.array([[x, y] for x in columns for y in range(100, 201)])
    return Lines(legs, legs, legs, legs[:0])


def test_the_parallel_leans_as_the_line_between_the_feet_does() -> None:  # VSMM 2.5
    expected = below_the_root(
        left_foot=(0, 210),
        right_foot=(100, 190),
        left_knee=(20, 150),
        right_knee=(80, 150),
    )
    sure, near, wide = (np.full(len(POINTS), value) for value in (1.0, 40.0, 90.0))
    knees = joints._knees(
        upright_legs(20.0, 80.0), expected, sure, expected, near, nearest_crossings
    )
    # the feet's line falls by a fifth from left to right in the picture, and so does the parallel through (50, 150)
    np.testing.assert_allclose(knees["left knee"], [20.0, 156.0], atol=1.1)
    np.testing.assert_allclose(knees["right knee"], [80.0, 144.0], atol=1.1)
    # both legs are one line, with one crossing
    for rules in (default_rules(), patent_rules()):
        assert (
            joints._knees(
                upright_legs(50.0), expected, sure, expected, wide, rules.crossings
            )
            == {}
        )


# Interpretation V15
def test_to_the_letter_the_knees_are_two_crossings_also_where_both_are_expected_at_one() -> (
    None
):
    expected = below_the_root(
        left_foot=(0, 200),
        right_foot=(100, 200),
        left_knee=(16, 150),
        right_knee=(24, 150),
    )
    shape = upright_legs(20.0, 80.0)
    sure = np.ones(len(POINTS))
    gates = np.full(len(POINTS), 1e3)
    assert (
        joints._knees(shape, expected, sure, expected, gates, nearest_crossings) == {}
    )
    knees = joints._knees(shape, expected, sure, expected, gates, two_crossings)
    np.testing.assert_allclose(knees["left knee"], [20.0, 150.0], atol=1.1)
    np.testing.assert_allclose(knees["right knee"], [80.0, 150.0], atol=1.1)


def test_an_elbow_is_as_far_from_the_hand_as_from_the_shoulder() -> None:  # VSMM 2.6
    points, sure, _ = detection()
    for side in ("left", "right"):
        elbow, hand, shoulder = (
            points[f"{side} {name}"] for name in ("elbow", "hand", "shoulder")
        )
        assert sure[f"{side} elbow"] > 0.0
        assert (
            abs(np.linalg.norm(elbow - hand) - np.linalg.norm(elbow - shoulder)) < 1.5
        )


def test_a_hidden_joint_moves_on_at_its_last_velocity() -> None:  # VSMM 2.7
    points = np.zeros((17, 2))
    sure = np.ones(17)
    variances = np.full((17, 2), 0.01)
    shown = JointFilter(points)
    for k in range(1, 30):
        shown.follow(points + [3.0 * k, -1.0 * k], sure, variances)
    hidden = sure.copy()
    hidden[AT["left hand"]] = 0.0
    assert np.allclose(
        shown.follow(points + 500.0, hidden, variances)[AT["left hand"]],
        [90.0, -30.0],
        atol=0.5,
    )


def test_states_and_poses_lead_back_to_each_other() -> None:
    walk = built_in.motion("walk")
    reliance = library().dependent
    states = encode(walk.poses, walk.translations)
    poses, places = decode(states, reliance)
    assert np.allclose(places, walk.translations)
    assert np.allclose(poses[:, HELD_ANGLES], walk.poses[:, HELD_ANGLES], atol=1e-9)
    assert np.allclose(
        np.linalg.norm(states[:, 3:].reshape(len(states), -1, 4), axis=2), 1.0
    )


def test_plus_and_minus_undo_each_other() -> None:
    rng = np.random.default_rng(0)
    state = encode(built_in.motion("jacks").poses[:1], np.zeros((1, 3)))[0]
    error = rng.normal(0.0, 0.5, ERROR)
    assert np.allclose(minus(plus(state, error), state), error, atol=1e-12)
    turned = Rotation.from_quat(state[3:7], scalar_first=True) * Rotation.from_rotvec(
        error[3:6]
    )
    assert np.allclose(
        Rotation.from_quat(plus(state, error)[3:7], scalar_first=True).as_matrix(),
        turned.as_matrix(),
    )


def test_ridge_regression_is_least_squares_with_more_rows() -> None:  # VSMM 3
    rng = np.random.default_rng(1)
    before = np.column_stack([np.zeros((90, 3)), rng.normal(0.0, 0.3, (90, 40))])
    after = before + rng.normal(0.0, 0.05, before.shape)

    def least_squares(inputs: Array, outputs: Array, weight: float) -> Array:
        rows = np.vstack([inputs, np.sqrt(weight) * np.eye(40)])
        return np.linalg.lstsq(
            rows, np.vstack([outputs, np.zeros((40, 43))]), rcond=None
        )[0]

    inputs = before[:, 3:]
    assert np.allclose(ridge(inputs, after), least_squares(inputs, after, 0.15).T)
    assert np.allclose(ridge(inputs, after, 2.0), least_squares(inputs, after, 2.0).T)


def test_the_errors_of_plain_numbers_equal_those_of_rotations() -> (
    None
):  # Interpretation V4
    states = encode(built_in.motion("jacks").poses[:1], np.ones((1, 3)))
    slow = (
        np.array(
            [plus(states[0], e) - plus(states[0], -e) for e in 1e-6 * np.eye(ERROR)]
        ).T
        / 2e-6
    )
    assert np.allclose(tangents(states)[0], slow, atol=1e-8)
    assert np.allclose(inverse_tangents(states) @ tangents(states), np.eye(ERROR))
    model = library().models.of(["jacks"])
    before = 0.01 * np.eye(ERROR)
    moved, covariances = model.predict_numbers(states, lifted(states, before))
    expected, spreads = model.predict(states, before)
    assert np.allclose(moved, expected)
    back = inverse_tangents(moved)
    assert np.allclose(back @ covariances @ back.swapaxes(1, 2), spreads, atol=1e-7)


def step_of(model: MotionModels, state: Array) -> Array:
    return np.asarray(model.step(state[None, None])[0, 0])


def test_a_models_covariance_grows_as_its_step_turns_errors() -> None:
    for name in ("walk", "jacks", "squat"):
        walk = built_in.motion("march")
        model = library().models.of([name]).fitted_to(walk.skeleton, 25.0)
        state = encode(walk.poses[7:8], walk.translations[7:8])[0]
        before = np.diag(np.linspace(0.01, 0.1, ERROR))
        moved, covariances = model.predict(state[None], before[None])
        assert np.allclose(moved[0], step_of(model, state))
        slow = (
            np.array(
                [
                    minus(step_of(model, plus(state, e)), moved[0])
                    for e in 1e-6 * np.eye(ERROR)
                ]
            ).T
            / 1e-6
        )
        assert (
            np.abs(slow @ before @ slow.T + model.noises[0] - covariances[0]).max()
            < 1e-4
        )


def test_a_models_step_is_the_same_from_any_place_and_heading() -> None:
    jump = built_in.motion("jump")
    model = library().models.of(["jump"]).fitted_to(jump.skeleton, 30.0)
    state = encode(jump.poses[3:4], jump.translations[3:4])[0]
    turn = Rotation.from_euler("y", 1.1)
    other = state.copy()
    other[:3] = turn.apply(state[:3]) + [4.0, -1.0, 2.0]
    other[3:7] = (turn * Rotation.from_quat(state[3:7], scalar_first=True)).as_quat(
        scalar_first=True
    )
    first = step_of(model, state)
    second = step_of(model, other)
    assert np.allclose(second[:3], turn.apply(first[:3]) + [4.0, -1.0, 2.0])
    same = Rotation.from_quat(second[3:7], scalar_first=True).inv() * turn
    assert (same * Rotation.from_quat(first[3:7], scalar_first=True)).magnitude() < 1e-9


def test_the_groups_follow_the_interpretation() -> None:  # VSMM 4
    names = {
        "G1": "stiff-walk walk arms-out",
        "G2": "arms-out jacks jump",
        "G3": "jacks jump squat",
    }
    assert TOPOLOGY.groups == {
        group: tuple(models.split()) for group, models in names.items()
    }
    matrix = TOPOLOGY.transition(("walk", "arms-out", "jacks"))
    assert np.allclose(
        matrix, [[0.92, 0.08, 0.0], [0.04, 0.92, 0.04], [0.0, 0.08, 0.92]]
    )


def running(**settings: Any) -> Switching:
    """Return the models of a tracker of a built-in motion at 30 frames a second, all in force."""
    skeleton = built_in.average_skeleton()
    camera = Camera.around(np.array([0.0, 1.0, 0.0]), 0.0, 4.0, (320, 240))
    task = Task(Body.of(skeleton), [camera], 100, 0.0, np.zeros(3), "aligned")
    return TrackFilter(VSMM(task, **settings), np.random.default_rng(0)).switching


def test_process_noise_is_a_multiple_of_the_models_noise() -> None:  # Interpretation V7
    assert np.allclose(
        running(process_noise=2.0).models.noises, 2.0 * running().models.noises
    )


NOBODY = np.zeros((len(POINTS), 2))  # points that ask for no group


def as_likely(log_likelihoods: Array) -> Measurement:
    """Return a measurement that moves no state, by which states (r,) are so likely, but for a common factor."""
    count = len(log_likelihoods)
    residuals = np.sqrt(2.0 * (log_likelihoods.max() - log_likelihoods))
    return Measurement(residuals[:, None], np.zeros((count, 1, ERROR)), np.eye(1))


def telling(name: str, switching: Switching) -> Callable[[Array], Measurement]:
    """Return a measurement of nothing, but that the model's prediction is the most likely."""

    return lambda _: as_likely(
        np.array([0.0 if model == name else -3.0 for model in switching.active])
    )


def initial(switching: Switching) -> Belief:
    walk = built_in.motion("walk")
    return switching.start(
        encode(walk.poses[:1], walk.translations[:1])[0], 0.01 * np.eye(ERROR)
    )


# by default a second of 30 frames
@each(("variant", "cycles"), [("patent", 10), ("default", 30)])
# VSMM 5
def test_after_some_cycles_over_all_models_the_most_probable_group_stays(
    variant: str, cycles: int
) -> None:
    for model, group in (("walk", "G1"), ("squat", "G3")):
        switching = running(variant=variant)
        state = initial(switching).states[0]
        covariance = 0.01 * np.eye(ERROR)
        belief = switching.start(state, covariance)
        measure = telling(model, switching)
        for _ in range(cycles):
            assert switching.group is None
            belief = switching.cycle(belief, measure, NOBODY)
        assert switching.group == group
        assert len(belief.probabilities) == 3
        assert np.isclose(belief.probabilities.sum(), 1.0)


# VSMM 8.2
def test_a_new_models_prediction_has_its_noise_as_covariance_to_the_letter() -> None:
    switching = running(variant="patent")
    belief = replace(
        initial(switching), log_probabilities=np.log(np.full(6, 1.0 / 6.0))
    )
    belief = switching.keep_only("G1", belief)
    union = switching.union_with("G3")
    both = PatentForm().joined(union, belief)
    states, covariances = (
        PatentForm().first_filter(union).predict(both.states, both.covariances)
    )
    _, usual = union.filter.predict(both.states, both.covariances)
    noises = switching.models.of(union.names).noises
    for k, name in enumerate(union.names):
        expected = usual[k]
        if name not in union.old_names:
            expected = lifted(states[k : k + 1], noises[k])[0]
        np.testing.assert_allclose(covariances[k], expected)
        if name not in union.old_names:
            assert np.trace(covariances[k]) < np.trace(usual[k])


def test_the_points_are_projected_and_their_jacobian_is_right() -> None:  # VSMM 6.1
    jacks = built_in.motion("jacks-a")
    dependent = library().dependent
    camera = Camera.around(np.array([0.0, 1.0, 0.0]), 0.4, 4.0, (320, 240))
    shown = JointCameras(Body.of(jacks.skeleton), [camera], dependent)

    def joints(state: Array) -> Array:
        return jacks.skeleton.joints(
            *(part[0] for part in decode(state[None], dependent))
        )

    def pixels(state: Array) -> Array:
        return camera.project(joints(state)[ENDS].mean(axis=1))[0]

    for k in (0, 9, 21):
        state = encode(jacks.poses[k : k + 1], jacks.translations[k : k + 1])[0]
        (projected,), (jacobian,) = shown.project(camera, state[None])
        assert np.allclose(projected, pixels(state))
        slow = [
            (pixels(plus(state, e)) - pixels(plus(state, -e))) / 2e-5
            for e in 1e-5 * np.eye(ERROR)
        ]
        assert np.abs(np.moveaxis(slow, 0, 2) - jacobian).max() < 1e-4
        # by hand: a point p that a turn by the axis w about a joint j moves goes by w x (p - j), here the left hand
        # (held by the wrist) about the elbow, whose turn is about the axes of the forearm's own frame
        turned = Rotation.from_quat(state[3:7], scalar_first=True).as_matrix()
        arm = joints(state)[ENDS[AT["left hand"], 0]] - state[:3]
        # of the whole body about the root, axis by axis
        moved = np.cross(turned.T, arm)
        depth = (camera.rotation @ (arm + state[:3]) + camera.translation)[2]
        in_camera = moved @ camera.rotation.T
        offset = (projected[AT["left hand"]] - camera.centre) / camera.focal
        by_hand = camera.focal * (in_camera[:, :2] - in_camera[:, 2:] * offset) / depth
        assert np.allclose(jacobian[AT["left hand"], :, 3:6], by_hand.T, atol=1e-4)


def swinging(changes_degrees: Sequence[Sequence[float]]) -> list[Array]:
    """Return points whose thighs and shanks (left, right, left, right) turn by so many degrees from frame to frame."""
    points = figure()[1]
    angles = np.cumsum([[0.0] * 4, *changes_degrees], axis=0)
    frames = []
    for left, right, left_shank, right_shank in np.radians(angles):
        one = points.copy()
        for side, thigh, shank in (
            ("left", left, left_shank),
            ("right", right, right_shank),
        ):
            hip = one[AT[f"{side} hip"]]
            one[AT[f"{side} knee"]] = hip + 40.0 * np.array(
                [np.sin(thigh), np.cos(thigh)]
            )
            one[AT[f"{side} foot"]] = one[AT[f"{side} knee"]] + 40.0 * np.array(
                [np.sin(shank), np.cos(shank)]
            )
        frames.append(one)
    return frames


# Interpretation V15
def test_limb_angles_are_measured_at_thighs_shanks_and_hips() -> None:
    first, second = (
        limb_angles(points) for points in swinging([[10.0, -20.0, 30.0, 5.0]])
    )
    assert np.allclose(np.degrees(second - first), [10.0, -20.0, 30.0, 5.0])


def test_hips_that_turn_twice_as_fast_ask_for_the_third_group() -> None:  # VSMM 7a
    assert requested_group(swinging([[2.0, 2.0, 3.0, 3.0], [4.1, 4.1, 3.0, 3.0]])) == 2
    assert (
        requested_group(swinging([[2.0, 2.0, 3.0, 3.0], [4.1, 3.9, 3.0, 3.0]])) is None
    )


# VSMM 7b
def test_most_limbs_that_turn_twice_as_fast_ask_for_the_second_group() -> None:
    assert requested_group(swinging([[2.0, 2.0, 2.0, 2.0], [5.0, 2.0, 5.0, 5.0]])) == 1
    assert (
        requested_group(swinging([[2.0, 2.0, 2.0, 2.0], [5.0, 2.0, 5.0, 2.0]])) is None
    )


def test_most_limbs_that_turn_half_as_fast_ask_for_the_first_group() -> None:  # VSMM 7c
    assert requested_group(swinging([[4.0, 4.0, 4.0, 4.0], [1.9, 3.0, 1.9, 1.9]])) == 0
    assert (
        requested_group(swinging([[4.0, 4.0, 4.0, 4.0], [1.9, 3.0, 3.0, 1.9]])) is None
    )


def test_a_limb_that_stops_turns_at_most_half_as_fast() -> None:  # VSMM 7c
    assert requested_group(swinging([[4.0, 4.0, 4.0, 4.0], [0.0, 3.0, 0.0, 1.9]])) == 0
    assert requested_group(swinging([[4.0, 4.0, 4.0, 4.0], [0.0, 0.0, 0.0, 0.0]])) == 0
    # two of them stood before
    assert (
        requested_group(swinging([[4.0, 4.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0]])) is None
    )


def test_no_change_asks_for_nothing() -> None:
    assert requested_group(swinging([[0.0] * 4, [0.0] * 4])) is None
    assert requested_group(swinging([[2.0] * 4])) is None  # too few frames


OLD = ("walk", "arms-out")
UNION = ("walk", "arms-out", "jacks")


def believing() -> Belief:
    states = encode(built_in.motion("walk").poses[:2], np.zeros((2, 3)))
    return Belief(
        states,
        np.tile(0.01 * np.eye(ERROR), (2, 1, 1)),
        np.log([0.8, 0.2]),
        np.array([-1.0, -2.0]),
    )


def in_first_group(**settings: Any) -> Switching:
    switching = running(**settings)
    switching.active = ("stiff-walk", "walk", "arms-out")
    switching.group = "G1"
    return switching


def begun_literally() -> tuple[Switching, Belief]:
    """Return the models, and the belief in them when group 3 comes to group 1 in the patent's form."""
    switching = in_first_group(variant="patent")
    state = encode(built_in.motion("jacks").poses[5:6], np.ones((1, 3)))[0]
    belief = replace(
        switching.start(state, 0.01 * np.eye(ERROR)),
        log_probabilities=np.log([1, 6, 1]),
    )
    union = switching.union_with("G3")
    both = PatentForm().joined(union, normalised(belief))
    # it changes nothing: that is for `Switching`
    assert (switching.group, switching.candidate_group) == ("G1", None)
    switching.bring_in("G3")
    assert switching.active == union.names
    return switching, both


# VSMM 9
def test_the_cycle_over_both_groups_is_run_again_and_judged_in_the_frame_of_the_request() -> (
    None
):
    for sign, group, count in ((1.0, "G1", 3), (-1.0, "G3", 3), (0.0, "G1", 6)):
        switching = in_first_group(variant="patent")
        state = encode(built_in.motion("walk").poses[5:6], np.ones((1, 3)))[0]
        belief = switching.start(state, 0.01 * np.eye(ERROR))

        def measure(
            states: Array, sign: float = sign, state: Array = state
        ) -> Measurement:
            # the old group's models keep near to the state
            near = np.abs(states[:, 7:] - state[7:]).sum(axis=1)
            return as_likely(-100.0 * sign * near)

        for points in swinging([[2.0, 2.0, 3.0, 3.0], [4.1, 4.1, 3.0, 3.0]]):
            assert (switching.group, switching.candidate_group) == ("G1", None)
            after = switching.cycle(belief, measure, points)
        assert (switching.group, len(after.probabilities)) == (group, count)


def nothing(states: Array) -> Measurement:
    """Return a measurement of nothing, by which all models are equally likely."""
    return as_likely(np.zeros(len(states)))


def test_a_new_model_is_as_probable_as_the_most_probable_one() -> None:  # VSMM 8.1
    switching, belief = begun_literally()
    assert switching.candidate_group == "G3"
    assert switching.active == (
        "stiff-walk",
        "walk",
        "arms-out",
        "jacks",
        "jump",
        "squat",
    )
    assert np.allclose(belief.probabilities[3:], belief.probabilities[:3].max())
    assert belief.probabilities.sum() == pytest.approx(1.0)


# VSMM 8.3
def test_a_new_model_starts_from_the_captured_state_that_matches_best() -> None:
    switching, belief = begun_literally()
    poses = switching.models.of(["squat"]).captured[0]
    assert any(
        np.allclose(np.abs(belief.states[5][7:]), np.abs(pose[4:])) for pose in poses
    )
    state = encode(built_in.motion("walk").poses[:1], np.ones((1, 3)))[0]
    still = np.concatenate([np.zeros(3), without_heading(state)[1].ravel()])
    away = [
        np.abs(minus(np.concatenate([np.zeros(3), pose]), still)[3:]).reshape(-1, 3)
        for pose in poses
    ]
    nearest = poses[
        int(np.argmin([np.linalg.norm(each, axis=1).sum() for each in away]))
    ]
    assert np.allclose(
        np.abs(switching.models.captured_nearest("squat", state)[7:]),
        np.abs(nearest[4:]),
    )


def test_old_and_new_groups_are_in_force_together() -> None:  # VSMM 8.4
    assert TOPOLOGY.union(("G3", "G1")) == (
        "stiff-walk",
        "walk",
        "arms-out",
        "jacks",
        "jump",
        "squat",
    )
    assert TOPOLOGY.union(("G1", "G2")) == (
        "stiff-walk",
        "walk",
        "arms-out",
        "jacks",
        "jump",
    )


# Interpretation V11
def test_by_default_a_new_model_gets_what_the_transitions_give_it() -> None:
    before = believing()
    new = {"jacks": (before.states[0], before.covariances[0], -np.inf)}
    switching = running()
    switching.active = UNION
    after = switching.imm.mixed(regrouped(before, OLD, UNION, new))
    # walk goes on with 0.92 or to arms-out; arms-out to jacks with 0.04
    assert np.allclose(
        after.probabilities,
        [0.8 * 0.92 + 0.2 * 0.04, 0.8 * 0.08 + 0.2 * 0.92, 0.2 * 0.04],
    )
    # only arms-out changes into jacks
    assert np.allclose(after.states[2], before.states[1])
    assert np.allclose(
        normalised(regrouped(before, OLD, ("arms-out",), {})).probabilities, [1.0]
    )


def latest(probabilities: Sequence[float], likelihoods: Sequence[float]) -> Belief:
    before = believing()
    return Belief(
        before.states, before.covariances, np.log(probabilities), np.log(likelihoods)
    )


def decided(
    steps: Sequence[tuple[Sequence[float], Sequence[float]]],
) -> list[str | None]:
    """Return which of an old and a new group ends frame by frame, of their probabilities and likelihoods."""
    groups = {"old": ("walk",), "new": ("jacks",)}
    switching = Switching(
        library().models, Topology(groups, {"walk": (), "jacks": ()}, {}, 0.9)
    )
    switching.group = "old"
    decisions = []
    switching.bring_in("new")
    for step in steps:
        switching.judged(latest(*step))
        decisions.append(switching.group if switching.candidate_group is None else None)
    return decisions


# VSMM 9
def test_the_patents_test_has_limits_of_09_and_1_on_frames_since_k0() -> None:
    assert decided([([0.6, 0.4], [1.0, 1.0])]) == ["old"]  # 0.4 / 0.6 < 0.9
    assert decided([([0.51, 0.49], [1.0, 1.0])]) == [None]  # 0.96
    assert decided([([0.4, 0.6], [1.0, 2.0])]) == ["new"]
    # the likelihoods' ratio is 0.8
    assert decided([([0.4, 0.6], [1.0, 0.8])]) == ["old"]
    # accumulated: 0.95, then 0.95 * 2 = 1.9
    assert decided([([0.51, 0.49], [1.0, 1.9]), ([0.51, 0.49], [1.0, 0.5])]) == [
        None,
        None,
    ]
    assert decided([([0.51, 0.49], [1.0, 0.95]), ([0.4, 0.6], [1.0, 2.0])]) == [
        None,
        "new",
    ]


def test_the_body_and_its_models_fit_any_frame_rate() -> None:
    skeleton = built_in.average_skeleton()
    slow, fast = (
        library().models.of(["squat"]).fitted_to(skeleton, fps) for fps in (30.0, 60.0)
    )
    state = encode(built_in.motion("squat").poses[5:6], np.zeros((1, 3)))[0]
    whole, half = (minus(step_of(model, state), state) for model in (slow, fast))
    assert np.allclose(whole, 2.0 * half, atol=2e-3)
    assert np.allclose(slow.noises, 2.0 * fast.noises)
