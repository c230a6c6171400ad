"""The variable-structure multiple-model tracker, CN101894278: every step but the filter itself, on cases done by hand."""

from collections.abc import Callable, Sequence
from typing import Any

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit_vsmm.imm import Belief, Measurement, start
from posefit_vsmm.joints import JointFilter, Lines, detected, lines_of, rule_errors
from posefit_vsmm.kernels import minus, plus
from posefit_vsmm.measurement import Figure, JointMeasurement
from posefit_vsmm.motion import (
    VectorModel,
    inverse_tangent,
    library,
    lifted,
    ridge,
    tangent,
    without_heading,
)
from posefit_vsmm.settings import Settings
from posefit_vsmm.state import AT, ENDS, ERROR, HELD_ANGLES, POINTS, decode, encode
from posefit_vsmm.switching import (
    FIRST,
    Models,
    Rivalry,
    limb_angles,
    normalised,
    read_topology,
    regrouped,
    requested_group,
)

SIZE = (240, 320)  # rows, columns
NO_BIAS = np.zeros((len(POINTS), 2))


def canvas() -> np.ndarray:
    return np.zeros(SIZE, dtype=np.uint8)


def lines(image: np.ndarray) -> Lines:
    shape = lines_of(image > 0)
    assert shape is not None
    return shape


def test_gaps_of_a_pixel_close_and_specks_go() -> None:  # VSMM 1.3
    image = canvas()
    image[50:150, 100:140] = 1
    image[100, 100:140] = 0  # a line through the body: a gap of one pixel
    image[20:23, 20:23] = 1  # nine pixels, a speck
    bar = lines(image)
    assert bar.area == 100 * 40
    assert np.allclose(bar.centroid, [120.0, 100.0])


def test_a_bar_has_its_outline_and_its_middle_line() -> None:  # VSMM 1.4
    image = canvas()
    image[100:111, 60:161] = 1  # 11 rows, 101 columns
    bar = lines(image)
    assert set(bar.contour[:, 1]) == {k + 0.5 for k in range(100, 111)}
    assert len(bar.contour) == 2 * (11 + 101) - 4  # each pixel of the border once
    inner = bar.skeleton[(bar.skeleton[:, 0] > 70) & (bar.skeleton[:, 0] < 150)]
    assert np.allclose(inner[:, 1], 105.5, atol=1.0)
    assert len(bar.ends) == 2
    assert sorted(bar.ends[:, 0])[0] < 70
    assert sorted(bar.ends[:, 0])[1] > 150


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
    points, confidence = joints_in(image, expected)
    return dict(zip(POINTS, points, strict=True)), dict(zip(POINTS, confidence, strict=True)), expected


def joints_in(image: np.ndarray, expected: Array, **how: Any) -> tuple[Array, Array]:
    return detected(lines(image), expected, np.full(len(POINTS), 30.0), 85.0, 14.0, NO_BIAS, **how)[:2]


def test_the_head_is_where_a_ring_catches_most_of_the_contour() -> None:  # VSMM 2.1
    points, sure, _ = detection()
    assert np.linalg.norm(points["head"] - [160.5, 50.5]) < 3.0
    assert sure["head"] > 0.5


def test_the_root_is_the_centroid() -> None:  # VSMM 2.2
    points, _, _ = detection()
    rows, columns = np.nonzero(figure()[0])
    assert np.allclose(points["root"], [columns.mean() + 0.5, rows.mean() + 0.5], atol=0.5)


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
    points, sure, unassigned = detected(lines(image), expected, np.full(len(POINTS), 30.0), 85.0, 14.0, NO_BIAS)
    assert sure[AT["left hand"]] == 0.0
    assert np.array_equal(points[AT["left hand"]], expected[AT["left hand"]])
    assert unassigned == 1


def test_the_nearest_end_point_may_be_that_of_two() -> None:  # Interpretation V15
    image, expected = figure()
    expected[AT["left foot"]] = expected[AT["right foot"]] + [20.0, 0.0]
    for assignment, shared in (("optimal", False), ("nearest", True)):
        points, confidence = joints_in(image, expected, assignment=assignment)
        assert np.allclose(points[AT["left foot"]], points[AT["right foot"]]) == shared
        assert (confidence[AT["left foot"]] > 0.0) == shared  # its own end point is out of reach


def test_plain_joint_errors_are_unbiased_and_the_torsos_are_the_roots() -> None:  # Interpretation V8
    (bias, deviation), (plain_bias, plain_deviation) = rule_errors(), rule_errors("plain")
    assert bias.any()
    assert not plain_bias.any()
    assert (deviation[AT["torso"]] > deviation[AT["root"]]).all()
    assert np.array_equal(plain_deviation[AT["torso"]], deviation[AT["root"]])


def test_hidden_joints_may_be_imputed() -> None:  # Interpretation V9
    confidence = np.ones(17)
    confidence[AT["left hand"]] = 0.0
    measured = JointMeasurement(np.zeros((17, 2)), confidence, np.ones((17, 2)), 0, 0.0).imputed(np.full((17, 2), 9.0))
    assert (measured.confidence == 1.0).all()
    assert np.array_equal(np.flatnonzero(measured.points[:, 0]), [AT["left hand"]])


def test_a_step_of_the_clip_is_a_quarter_of_one_of_the_video() -> None:  # Interpretation V6
    video, clip = (models(clip_rate=rate).known["walk"] for rate in ("video", "clip"))
    assert (video.share, clip.share) == (1.0, 0.25)


def test_hips_turn_against_the_trunk_or_the_vertical() -> None:  # Interpretation V15
    first, second = swinging([[10.0, -20.0, 0.0, 0.0]])
    second[AT["root"]] += [5.0, 0.0]  # the trunk leans
    trunk, vertical = (limb_angles(second, way) - limb_angles(first, way) for way in ("trunk", "vertical"))
    assert np.allclose(np.degrees(vertical[4:]), [10.0, -20.0])
    assert np.allclose(trunk[4:] - vertical[4:], -np.arctan2(5.0, 25.0))


def test_knees_are_where_the_parallel_to_the_feet_crosses_the_legs() -> None:  # VSMM 2.5
    points, sure, _ = detection()
    image, _ = figure()
    rows, _ = np.nonzero(image)
    height = rows[rows + 0.5 > points["root"][1]].mean() + 0.5  # the feet stand level, and so does the parallel
    for name, side in (("left knee", 1.0), ("right knee", -1.0)):
        assert sure[name] > 0.0
        assert abs(points[name][1] - height) < 2.0
        leg = 160.5 + side * (8.0 + (height - 135.5) * 24.0 / 80.0)  # from the hip (8, 135) to the foot (32, 215)
        assert abs(points[name][0] - leg) < 2.5


def test_an_elbow_is_as_far_from_the_hand_as_from_the_shoulder() -> None:  # VSMM 2.6
    points, sure, _ = detection()
    for side in ("left", "right"):
        elbow, hand, shoulder = (points[f"{side} {name}"] for name in ("elbow", "hand", "shoulder"))
        assert sure[f"{side} elbow"] > 0.0
        assert abs(np.linalg.norm(elbow - hand) - np.linalg.norm(elbow - shoulder)) < 1.5


def test_a_hidden_joint_goes_on_as_it_went() -> None:  # VSMM 2.7
    points, sure, variances = np.zeros((17, 2)), np.ones(17), np.full((17, 2), 0.01)
    shown = JointFilter(points)
    for k in range(1, 30):
        shown.follow(points + [3.0 * k, -1.0 * k], sure, variances)
    hidden = sure.copy()
    hidden[AT["left hand"]] = 0.0
    assert np.allclose(shown.follow(points + 500.0, hidden, variances)[AT["left hand"]], [90.0, -30.0], atol=0.5)


def test_states_and_poses_lead_back_to_each_other() -> None:
    walk, reliance = built_in.motion("walk"), library().reliance
    states = encode(walk.poses, walk.translations)
    poses, places = decode(states, reliance)
    assert np.allclose(places, walk.translations)
    assert np.allclose(poses[:, HELD_ANGLES], walk.poses[:, HELD_ANGLES], atol=1e-9)
    assert np.allclose(np.linalg.norm(states[:, 3:].reshape(len(states), -1, 4), axis=2), 1.0)


def test_plus_and_minus_undo_each_other() -> None:
    rng = np.random.default_rng(0)
    state = encode(built_in.motion("jacks").poses[:1], np.zeros((1, 3)))[0]
    error = rng.normal(0.0, 0.5, ERROR)
    assert np.allclose(minus(plus(state, error), state), error, atol=1e-12)
    turned = Rotation.from_quat(state[3:7], scalar_first=True) * Rotation.from_rotvec(error[3:6])
    assert np.allclose(Rotation.from_quat(plus(state, error)[3:7], scalar_first=True).as_matrix(), turned.as_matrix())


def test_ridge_regression_is_least_squares_with_more_rows() -> None:  # VSMM 3
    rng = np.random.default_rng(1)
    before = np.column_stack([np.zeros((90, 3)), rng.normal(0.0, 0.3, (90, 40))])
    after = before + rng.normal(0.0, 0.05, before.shape)

    def least_squares(inputs: Array, outputs: Array, weight: float) -> Array:
        rows = np.vstack([inputs, np.sqrt(weight) * np.eye(40)])
        return np.linalg.lstsq(rows, np.vstack([outputs, np.zeros((40, 43))]), rcond=None)[0]

    inputs = before[:, 3:]
    assert np.allclose(ridge(inputs, after), least_squares(inputs, after, 0.15).T)
    assert np.allclose(ridge(inputs, after, 2.0), least_squares(inputs, after, 2.0).T)


def test_the_errors_of_plain_numbers_are_those_of_turns() -> None:  # Interpretation V4
    state = encode(built_in.motion("jacks").poses[:1], np.ones((1, 3)))[0]
    slow = np.array([plus(state, e) - plus(state, -e) for e in 1e-6 * np.eye(ERROR)]).T / 2e-6
    assert np.allclose(tangent(state), slow, atol=1e-8)
    assert np.allclose(inverse_tangent(state) @ tangent(state), np.eye(ERROR))
    model = library().models["jacks"]
    moved, covariance = VectorModel(model).predict(state, lifted(state, 0.01 * np.eye(ERROR)))
    expected, spread = model.predict(state, 0.01 * np.eye(ERROR))
    assert np.allclose(moved, expected)
    back = inverse_tangent(moved)
    assert np.allclose(back @ covariance @ back.T, spread, atol=1e-7)


def test_a_models_jacobian_is_that_of_its_step() -> None:
    for name in ("walk", "jacks", "squat"):
        walk = built_in.motion("march")
        model = library().models[name].fitted_to(walk.skeleton, 25.0)
        state = encode(walk.poses[7:8], walk.translations[7:8])[0]
        moved, jacobian = model.step(state)
        slow = np.array([minus(model.step(plus(state, e))[0], moved) for e in 1e-6 * np.eye(ERROR)]).T / 1e-6
        assert np.abs(slow - jacobian).max() < 1e-4


def test_a_models_step_is_the_same_from_any_place_and_heading() -> None:
    jump = built_in.motion("jump")
    model = library().models["jump"].fitted_to(jump.skeleton, 30.0)
    state = encode(jump.poses[3:4], jump.translations[3:4])[0]
    turn = Rotation.from_euler("y", 1.1)
    other = state.copy()
    other[:3] = turn.apply(state[:3]) + [4.0, -1.0, 2.0]
    other[3:7] = (turn * Rotation.from_quat(state[3:7], scalar_first=True)).as_quat(scalar_first=True)
    first, second = model.step(state)[0], model.step(other)[0]
    assert np.allclose(second[:3], turn.apply(first[:3]) + [4.0, -1.0, 2.0])
    same = Rotation.from_quat(second[3:7], scalar_first=True).inv() * turn
    assert (same * Rotation.from_quat(first[3:7], scalar_first=True)).magnitude() < 1e-9


def test_the_groups_are_those_of_the_reading() -> None:  # VSMM 4
    topology = read_topology(None, library().models)
    assert topology.groups == {
        "G1": ("stiff-walk", "walk", "arms-out"),
        "G2": ("arms-out", "jacks", "jump"),
        "G3": ("jacks", "jump", "squat"),
    }
    matrix = topology.transition(("walk", "arms-out", "jacks"))
    assert np.allclose(matrix, [[0.92, 0.08, 0.0], [0.04, 0.92, 0.04], [0.0, 0.08, 0.92]])


def models(**given: Any) -> Models:
    carried = library()
    return Models(Settings.of(given), carried, read_topology(None, carried.models), built_in.average_skeleton(), 30.0)


def test_process_noise_is_a_multiple_of_the_models_own() -> None:  # Interpretation V7
    single, double = models().known["walk"], models(process_noise=2.0).known["walk"]
    assert np.array_equal(double.noise, 2.0 * single.noise)


def telling(name: str, running: Models) -> Callable[[Array], Measurement]:
    """Return a measurement of nothing, but that the model's prediction is the most likely."""
    asked = iter(range(10**6))

    def measure(_: Array) -> Measurement:
        likely = running.active[next(asked) % len(running.active)] == name
        return Measurement(np.zeros(0), np.zeros((0, ERROR)), np.zeros((0, 0)), 0.0 if likely else -3.0)

    return measure


def begun(running: Models) -> Belief:
    pose = built_in.motion("walk")
    state = encode(pose.poses[:1], pose.translations[:1])[0]
    return start(state, 0.01 * np.eye(ERROR), len(running.active))


def test_after_ten_cycles_over_all_models_the_most_probable_group_stays() -> None:  # VSMM 5
    for model, group in (("walk", "G1"), ("squat", "G3")):
        running = models()
        belief, measure = begun(running), telling(model, running)
        for _ in range(FIRST - 1):
            belief = running.cycle(belief, measure, 0.0)
            assert running.group is None
        belief = running.cycle(belief, measure, 0.0)
        assert running.group == group
        assert len(belief.probabilities) == 3
        assert np.isclose(belief.probabilities.sum(), 1.0)


def test_all_models_come_back_only_where_restarts_are_on() -> None:  # Interpretation V14
    for restart in (True, False):
        running = models(restart=restart, dwell=0)
        running.active, running.group = ("stiff-walk", "walk", "arms-out"), "G1"
        running.cycle(begun(running), telling("walk", running), 5.0)
        assert (running.restarts, len(running.active)) == ((1, 6) if restart else (0, 3))


def test_the_points_are_projected_and_their_jacobian_is_right() -> None:  # VSMM 6.1
    jacks = built_in.motion("jacks-a")
    shown = Figure(jacks.skeleton, library().reliance)
    camera = Camera.around(np.array([0.0, 1.0, 0.0]), 0.4, 4.0, (320, 240))
    for k in (0, 9, 21):
        state = encode(jacks.poses[k : k + 1], jacks.translations[k : k + 1])[0]
        pixels, jacobian = shown.project(camera, state)
        poses, places = decode(state[None], library().reliance)
        assert np.allclose(pixels, camera.project(jacks.skeleton.joints(poses, places)[0][ENDS].mean(axis=1))[0])
        step = 1e-6 * np.eye(ERROR)
        slow = [
            (shown.project(camera, plus(state, e))[0] - shown.project(camera, plus(state, -e))[0]) / 2e-6 for e in step
        ]
        assert np.abs(np.moveaxis(slow, 0, 2) - jacobian).max() < 1e-4


def swinging(changes_degrees: Sequence[Sequence[float]]) -> list[Array]:
    """Return points whose thighs and shanks (left, right, left, right) turn by so many degrees from frame to frame."""
    points = figure()[1]
    angles = np.cumsum([[0.0] * 4, *changes_degrees], axis=0)
    frames = []
    for left, right, left_shank, right_shank in np.radians(angles):
        one = points.copy()
        for side, thigh, shank in (("left", left, left_shank), ("right", right, right_shank)):
            hip = one[AT[f"{side} hip"]]
            one[AT[f"{side} knee"]] = hip + 40.0 * np.array([np.sin(thigh), np.cos(thigh)])
            one[AT[f"{side} foot"]] = one[AT[f"{side} knee"]] + 40.0 * np.array([np.sin(shank), np.cos(shank)])
        frames.append(one)
    return frames


LITERAL = Settings.of({"variant": "patent"})


def test_limb_angles_are_those_of_thighs_shanks_and_hips() -> None:
    first, second = (limb_angles(points) for points in swinging([[10.0, -20.0, 30.0, 5.0]]))
    assert np.allclose(np.degrees(second - first), [10.0, -20.0, 30.0, 5.0, 10.0, -20.0])


def test_hips_that_turn_twice_as_fast_ask_for_the_third_group() -> None:  # VSMM 7a
    assert requested_group(swinging([[2.0, 2.0, 3.0, 3.0], [4.0, 4.0, 3.0, 3.0]]), LITERAL) == 2
    assert requested_group(swinging([[2.0, 2.0, 3.0, 3.0], [4.0, 3.9, 3.0, 3.0]]), LITERAL) is None


def test_most_limbs_that_turn_twice_as_fast_ask_for_the_second_group() -> None:  # VSMM 7b
    assert requested_group(swinging([[2.0, 2.0, 2.0, 2.0], [5.0, 2.0, 5.0, 5.0]]), LITERAL) == 1
    assert requested_group(swinging([[2.0, 2.0, 2.0, 2.0], [5.0, 2.0, 5.0, 2.0]]), LITERAL) is None


def test_most_limbs_that_turn_half_as_fast_ask_for_the_first_group() -> None:  # VSMM 7c
    assert requested_group(swinging([[4.0, 4.0, 4.0, 4.0], [2.0, 3.0, 2.0, 2.0]]), LITERAL) == 0
    assert requested_group(swinging([[4.0, 4.0, 4.0, 4.0], [2.0, 3.0, 3.0, 2.0]]), LITERAL) is None


def test_small_changes_ask_for_nothing_and_changes_are_means_over_frames() -> None:
    assert requested_group(swinging([[0.0] * 4, [0.0] * 4]), LITERAL) is None
    rules = Settings(smoothing=1, floor_degrees=2.0, dwell=0)
    assert requested_group(swinging([[0.1] * 4, [1.9] * 4]), rules) is None
    assert requested_group(swinging([[0.1] * 4, [2.0] * 4]), rules) == 2
    rules = Settings(smoothing=2, floor_degrees=0.0, dwell=0)
    assert requested_group(swinging([[2.0] * 4] * 3), rules) is None  # too few frames
    assert requested_group(swinging([[2.0] * 4, [2.0] * 4, [1.0] * 4, [7.1] * 4]), rules) == 2


OLD, UNION = ("walk", "arms-out"), ("walk", "arms-out", "jacks")


def believing() -> Belief:
    states = encode(built_in.motion("walk").poses[:2], np.zeros((2, 3)))
    return Belief(states, np.tile(0.01 * np.eye(ERROR), (2, 1, 1)), np.log([0.8, 0.2]), np.array([-1.0, -2.0]))


def begun_literally(**given: Any) -> tuple[Models, Belief]:
    """Return the models, and the belief in them when group 3 comes to group 1 in the patent's form."""
    running = models(**{"new": "patent", "smoothing": 1, "floor_degrees": 0.0, "dwell": 0} | given)
    running.active, running.group = ("stiff-walk", "walk", "arms-out"), "G1"
    state = encode(built_in.motion("jacks").poses[5:6], np.ones((1, 3)))[0]
    belief = Belief(np.tile(state, (3, 1)), np.tile(0.01 * np.eye(ERROR), (3, 1, 1)), np.log([1, 6, 1]), np.zeros(3))
    return running, running.joined(normalised(belief), "G3")


def test_the_cycle_over_both_groups_is_run_again_and_judged_in_the_frame_of_the_request() -> None:  # VSMM 9
    for sign, group, count in ((1.0, "G1", 3), (-1.0, "G3", 3), (0.0, "G1", 6)):
        running = models(variant="patent")
        running.active, running.group = ("stiff-walk", "walk", "arms-out"), "G1"
        for points in swinging([[2.0, 2.0, 3.0, 3.0], [4.0, 4.0, 3.0, 3.0]]):
            running.record(points)
        state = encode(built_in.motion("walk").poses[5:6], np.ones((1, 3)))[0]
        belief = running.start(state, 0.01 * np.eye(ERROR))

        def measure(one: Array, sign: float = sign, state: Array = state) -> Measurement:
            near = float(np.abs(one[7:] - state[7:]).sum())  # the old group's models keep near to the state
            return Measurement(np.zeros(0), np.zeros((0, ERROR)), np.zeros((0, 0)), -100.0 * sign * near)

        after = running.cycle(belief, measure, 0.0)
        assert (running.group, len(after.probabilities)) == (group, count)


def test_a_new_model_is_as_probable_as_the_most_probable_one() -> None:  # VSMM 8.1
    running, belief = begun_literally()
    assert running.newcomer == "G3"
    assert running.active == ("stiff-walk", "walk", "arms-out", "jacks", "jump", "squat")
    assert np.allclose(belief.probabilities[3:], belief.probabilities[:3].max())
    assert belief.probabilities.sum() == pytest.approx(1.0)


def test_a_new_models_covariance_is_its_noise() -> None:  # VSMM 8.2
    running, belief = begun_literally()
    assert np.array_equal(belief.covariances[3], running.known["jacks"].noise)


def test_a_new_model_starts_from_the_captured_state_that_matches_best() -> None:  # VSMM 8.3
    for kind in ("captured", "typical"):
        running, belief = begun_literally(poses=kind)
        model = running.known["squat"]
        candidates = model.captured if kind == "captured" else model.poses
        assert any(np.allclose(np.abs(belief.states[5][7:]), np.abs(pose[4:])) for pose in candidates)
    state = encode(built_in.motion("walk").poses[:1], np.ones((1, 3)))[0]
    for kind, candidates in (("typical", model.poses), ("captured", model.captured)):
        still = np.concatenate([np.zeros(3), without_heading(state)[1].ravel()])
        away = [np.abs(minus(np.concatenate([np.zeros(3), pose]), still)[3:]).reshape(-1, 3) for pose in candidates]
        nearest = candidates[int(np.argmin([np.linalg.norm(one, axis=1).sum() for one in away]))]
        assert np.allclose(np.abs(model.nearest(state, kind)[7:]), np.abs(nearest[4:]))


def test_old_and_new_groups_are_in_force_together() -> None:  # VSMM 8.4
    topology = read_topology(None, library().models)
    assert topology.union(("G3", "G1")) == ("stiff-walk", "walk", "arms-out", "jacks", "jump", "squat")
    assert topology.union(("G1", "G2")) == ("stiff-walk", "walk", "arms-out", "jacks", "jump")


def test_by_default_a_new_model_gets_what_the_transitions_give_it() -> None:  # Interpretation V11
    before = believing()
    new = {"jacks": (before.states[0], before.covariances[0], -np.inf)}
    running = models()
    running.active = UNION
    after = running.imm.mixed(regrouped(before, OLD, UNION, new))
    # walk goes on with 0.92 or to arms-out; arms-out to jacks with 0.04
    assert np.allclose(after.probabilities, [0.8 * 0.92 + 0.2 * 0.04, 0.8 * 0.08 + 0.2 * 0.92, 0.2 * 0.04])
    assert np.allclose(after.states[2], before.states[1])  # only arms-out changes into jacks
    assert np.allclose(normalised(regrouped(before, OLD, ("arms-out",), {})).probabilities, [1.0])


def latest(probabilities: Sequence[float], likelihoods: Sequence[float]) -> Belief:
    before = believing()
    return Belief(before.states, before.covariances, np.log(probabilities), np.log(likelihoods))


def decided(steps: Sequence[tuple[Sequence[float], Sequence[float]]], **given: Any) -> list[str | None]:
    """Return the decisions frame by frame between walk and jacks, of their probabilities and likelihoods."""
    rivalry = Rivalry(Settings.of(given), old=("walk",), new=("jacks",))
    return [rivalry.decide(latest(*step), ("walk", "jacks")) for step in steps]


def test_the_patents_test_has_limits_of_09_and_1_on_what_came_since_k0() -> None:  # VSMM 9
    assert decided([([0.6, 0.4], [1.0, 1.0])], test="patent") == ["old"]  # 0.4 / 0.6 < 0.9
    assert decided([([0.51, 0.49], [1.0, 1.0])], test="patent") == [None]  # 0.96
    assert decided([([0.4, 0.6], [1.0, 2.0])], test="patent") == ["new"]
    assert decided([([0.4, 0.6], [1.0, 0.8])], test="patent") == ["old"]  # the likelihoods' ratio is 0.8
    # accumulated: 1.9, then 1.9 * 0.5 = 0.95
    assert decided([([0.49, 0.51], [1.0, 1.9]), ([0.4, 0.6], [1.0, 0.5])], test="patent") == ["new", None]


def test_the_sequential_test_waits_for_evidence_of_99_to_1_but_not_for_ever() -> None:
    even, ratios = [0.5, 0.5], [3.0] * 4 + [1.3]  # 81, then 105
    assert decided([(even, [1.0, ratio]) for ratio in ratios], test="sequential") == [None] * 4 + ["new"]
    assert decided([(even, [1.0, 1.0 / ratio]) for ratio in ratios], test="sequential") == [None] * 4 + ["old"]
    assert decided([([0.4, 0.6], [1.0, 1.0])] * 3, test="sequential", longest=3) == [None, None, "new"]


def test_the_sequential_tests_two_error_rates_are_walds() -> None:
    # Wald, Sequential Analysis, 1947, section 3.2: with alpha the chance to take the new group though the old one is
    # right and beta that of the reverse, the new one is taken at (1 - beta) / alpha and the old one at
    # beta / (1 - alpha). alpha = 0.05, beta = 0.2: 16 and 4 / 19; the other way round they would be 4.75 and 1 / 16.
    for ratios, decision in (([15.9, 16.1 / 15.9], "new"), ([0.22, 0.20 / 0.22], "old")):  # 4 / 19 = 0.2105
        steps = [([0.5, 0.5], [1.0, ratio]) for ratio in ratios]
        assert decided(steps, test="sequential", false_alarm=0.05, miss=0.2) == [None, decision]


def test_the_body_and_its_models_fit_any_frame_rate() -> None:
    body = Body.of(built_in.average_skeleton())
    model = library().models["squat"]
    slow, fast = (model.fitted_to(body.skeleton, fps) for fps in (30.0, 60.0))
    state = encode(built_in.motion("squat").poses[5:6], np.zeros((1, 3)))[0]
    whole, half = (minus(one.step(state)[0], state) for one in (slow, fast))
    assert np.allclose(whole, 2.0 * half, atol=2e-3)
    assert np.allclose(slow.noise, 2.0 * fast.noise)
