"""Bodies that are fitted to the borders of masks: what the border says, and that a body which is off comes back."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from posefit.fitting.shape import NAMES, Shape, shaped
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.mask import Silhouette
from posefit.tracking.smoothing import contours, kernels
from posefit.tracking.smoothing.contours import (
    BONE_STARTS,
    MaskContours,
    build_jacobian,
    distances_outside,
    fit_contours,
    pose_jacobian,
    projected_body,
)
from posefit.tracking.smoothing.path import Squares, Visibility
from posefit.tracking.smoothing.smooth import smoothed_frames
from posefit.uncertainty.modes import Posterior
from tests.cases import each

CAMERA = Camera.around(np.array([0.0, 0.9, 0.0]), 0.4, 4.0, (200, 200))


def footage(frames: int = 14, views: tuple[float, ...] = (60.0,), girth: float = 1.0) -> tuple[Scene, Motion]:
    """Return footage of a walk by somebody whose limbs are thicker than those of the body that is fitted to it."""
    motion = built_in.motion("walk", frames=60).frames(5, 5 + frames)
    scene = synthetic(motion, views, (160, 160), (), (None, None))
    factors = np.ones(len(NAMES))
    factors[NAMES.index("thighs girth")] = factors[NAMES.index("torso girth")] = girth
    body, observations = scene.body, list(scene.observations)
    if girth != 1.0:
        thick = replace(scene.observations, body=shaped(body, factors))  # type: ignore[type-var]
        observations = [thick[k] for k in range(len(motion))]
    observations = [replace(one, translation=None) for one in observations]
    return replace(scene, truth=None, observations=observations), motion


def off(motion: Motion, degrees: float = 5.0, seed: int = 0) -> Motion:
    """Return a motion whose angles are off, smoothly, as a tracker finds it."""
    rng = np.random.default_rng(seed)
    times = np.arange(len(motion))[:, None] / motion.fps
    waves = np.sin(2.0 * np.pi * times + rng.uniform(0.0, 6.0, 66)) * rng.uniform(0.5, 1.0, 66)
    return replace(motion, poses=motion.poses + np.radians(degrees) * waves * motion.skeleton.free)


def seen_by(scene: Scene) -> Visibility:
    eye = scene.cameras[0].position if len(scene.cameras) == 1 else np.full(3, np.nan)
    return Visibility(np.array([one.usable for one in scene.observations]), np.tile(eye, (scene.count, 1)))


def away(motion: Motion, truth: Motion) -> float:
    """Return how far joints are off, metres, the mean."""
    first, second = (one.skeleton.joints(one.poses, one.translations) for one in (motion, truth))
    return float(np.linalg.norm(first - second, axis=2).mean())


def average_shape(scene: Scene) -> Shape:
    return Shape(scene.body, np.ones(len(NAMES)), np.zeros(len(NAMES)), 0.0)


def frame(pose: np.ndarray, place: np.ndarray, posterior: Posterior | None = None) -> Frame:
    return Frame(pose, place, 0.0, np.zeros((1, 3), np.int64), 0, 0.0, np.empty(0), posterior=posterior)


@each("radii", [(5.0, 2.0), (2.0, 5.0), (3.0, 3.0), (30.0, 2.0), (1.0, 40.0)])
def test_the_distance_from_a_cone_is_that_from_the_nearest_of_all_its_discs(radii: tuple[float, float]) -> None:
    rng = np.random.default_rng(1)
    start, end = np.array([10.0, 20.0]), np.array([28.0, 12.0])
    shares = np.linspace(0.0, 1.0, 20_001)[:, None]
    for x, y in rng.uniform(-10.0, 50.0, (40, 2)):
        far = np.linalg.norm((x, y) - (start + shares * (end - start)), axis=1)
        expected = (far - (radii[0] + shares[:, 0] * (radii[1] - radii[0]))).min()
        found, share, across, down = kernels.cone_distance(x, y, *start, radii[0], *end, radii[1])
        assert found == pytest.approx(expected, abs=1e-4)
        assert 0.0 <= share <= 1.0
        assert np.hypot(across, down) == pytest.approx(1.0)


def test_pixels_know_how_far_they_are_outside_and_nothing_where_nobody_knows() -> None:
    mask, around = np.zeros((1, 7), dtype=bool), np.ones((1, 7), dtype=bool)
    mask[0, 2:5] = True
    around[0, 2:5] = around[0, 6] = False
    # the border is between pixels, half a pixel from the middles of either
    np.testing.assert_allclose(distances_outside(mask, around), [[1.5, 0.5, -0.5, -1.5, -0.5, 0.5, 0.0]], atol=1e-6)


def test_the_border_of_a_mask_is_where_it_meets_what_is_known_to_be_empty() -> None:
    mask, valid = np.zeros((60, 60), dtype=bool), np.ones((60, 60), dtype=bool)
    mask[20:40, 20:40] = True
    valid[:, 40:] = False  # its right border is not seen
    mask[5, 5] = True  # and a speck is not the person
    some = [Observation([Silhouette.of(mask, valid)]), Observation([Silhouette.of(mask, valid)], usable=False)]
    camera = Camera.around(np.zeros(3), 0.0, 4.0, (60, 60))
    found = MaskContours.of(camera, 0, some, np.zeros((2, 3)))
    assert found.starts.tolist() == [0, 60, 60]  # of four sides of 20 pixels three; a frame that shows too little none
    assert (found.points[:, 0].min(), found.points[:, 0].max()) == (20.0, 39.5)
    assert (found.points[:, 1].min(), found.points[:, 1].max()) == (20.0, 40.0)
    assert found.metres == pytest.approx([camera.focal[0] / 4.0] * 2)


def test_of_a_large_mask_every_so_many_pixels_are_looked_at_and_mean_the_same_place() -> None:
    mask = np.zeros((800, 800), dtype=bool)
    mask[200:600, 300:500] = True
    camera = Camera.around(np.zeros(3), 0.0, 4.0, (800, 800))
    found = MaskContours.of(camera, 0, [Observation([Silhouette.of(mask)])], np.zeros((1, 3)))
    factor = round(800 / found.camera.width)
    assert factor == int(camera.focal[0] / 4.0 / 80.0) == 3
    point, small = (one.project(np.array([0.3, 0.2, 0.1]))[0] for one in (camera, found.camera))
    middle = 0.5 * (found.points.min(axis=0) + found.points.max(axis=0))
    np.testing.assert_allclose(factor * (small - middle), point - [400.0, 400.0], atol=factor)


def test_what_is_drawn_changes_with_poses_places_and_builds_as_its_slopes_say() -> None:
    body, rng = Body.of(built_in.average_skeleton()), np.random.default_rng(2)
    poses, places = rng.normal(0.0, 0.3, (3, 66)), rng.normal(0.0, 0.2, (3, 3)) + [0.0, 0.9, 0.0]
    angles = [0, 1, 9, 30]
    here = projected_body(body, CAMERA, poses, places)
    np.testing.assert_allclose(here[:, :54].reshape(3, 27, 2), CAMERA.project(body.skeleton.joints(poses, places))[0])
    step = rng.normal(0.0, 1e-3, (3, 7))
    turned = poses.copy()
    turned[:, angles] += step[:, 3:]
    there = projected_body(body, CAMERA, turned, places + step[:, :3])
    slopes = pose_jacobian(body, CAMERA, poses, places, angles)
    np.testing.assert_allclose(there - here, np.einsum("tqn,tn->tq", slopes, step), atol=2e-3)
    growth = rng.normal(0.0, 1e-3, len(NAMES))
    there = projected_body(shaped(body, np.exp(growth), 1.7), CAMERA, poses, places)
    here = projected_body(shaped(body, np.ones(len(NAMES)), 1.7), CAMERA, poses, places)
    slopes = build_jacobian(body.scaled(1.7 / body.stature, 1.7 / body.stature), CAMERA, poses, places, 1.7)
    np.testing.assert_allclose(there - here, slopes @ growth, atol=2e-3)


def test_the_gradient_of_the_borders_squares_is_that_of_their_sum() -> None:
    body, rng = Body.of(built_in.average_skeleton()), np.random.default_rng(3)
    numbers = projected_body(body, CAMERA, np.zeros((1, 66)), np.array([[0.0, 0.9, 0.0]]))
    points = rng.uniform(40.0, 160.0, (30, 2))
    nothing = np.zeros((1, 1, 1), np.float32), np.zeros((1, 2), np.int64), np.ones((1, 2), np.int64)

    def pulled(numbers: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        out = np.zeros((1, 106, 106)), np.zeros((1, 106))
        drawn = numbers[:, :54].reshape(1, 27, 2), numbers[:, 54:].reshape(1, 26, 2)
        kernels.pull_to_borders(BONE_STARTS, *drawn, *nothing, points, np.array([0, 30]), 1.0, np.array([1e9]), out)
        return out

    def half_sum(numbers: np.ndarray) -> float:
        (joints,), (radii,), total = numbers[:, :54].reshape(1, 27, 2), numbers[:, 54:].reshape(1, 26, 2), 0.0
        for x, y in points:
            total += 0.5 * min(
                kernels.cone_distance(x, y, *joints[p], r[0], *joints[b + 1], r[1])[0]
                for b, (p, r) in enumerate(zip(BONE_STARTS, radii, strict=True))
            ) ** 2  # fmt: skip
        return total

    curves, slopes = pulled(numbers)
    for k in range(0, 106, 3):
        step = 1e-4 * np.eye(106)[k]
        expected = (half_sum(numbers + step) - half_sum(numbers - step)) / 2e-4
        assert slopes[0, k] == pytest.approx(expected, abs=1e-3 + 1e-3 * abs(expected))
    assert np.linalg.eigvalsh(curves[0]).min() > -1e-6


def point_of(joints, radii, parents, bone, share, normal):  # type: ignore[no-untyped-def]
    """Return the point of a bone's border at a share of it, in the direction of a normal."""
    ends = np.array([1.0 - share, share])
    return ends @ joints[[parents[bone], bone + 1]] + (ends @ radii[bone]) * normal


def field_at(field: np.ndarray, x: float, y: float, corner: np.ndarray) -> float:
    """Return what a field says between the middles of four pixels."""
    where = [[y - corner[1] - 0.5], [x - corner[0] - 0.5]]
    return float(map_coordinates(field.astype(np.float64), where, order=1)[0])


def border_of(joint: np.ndarray, radii: np.ndarray, spacing: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return points of the border of a bone between two joints (2, 2): their shares of the bone, normals and pixels."""
    way = joint[1] - joint[0]
    length = float(np.linalg.norm(way))
    axis = way / length
    tilt = np.arccos((radii[0] - radii[1]) / length)
    sides, caps = max(int(length / spacing) + 1, 2), (np.arange(3) + 0.5) / 3.0
    ends = np.full(sides + 1, length * np.sin(tilt) / sides)
    ends[[0, -1]] *= 0.5  # the sides' points are closed off by half a step at either end
    near, far = (np.pi - tilt) / 3.0, tilt / 3.0
    shares = np.concatenate([np.arange(sides + 1) / sides, np.ones(3), np.zeros(3)])
    angles = np.concatenate([np.full(sides + 1, tilt), tilt * caps, tilt + (np.pi - tilt) * caps])
    weights = np.concatenate([ends, np.full(3, radii[1] * far), np.full(3, radii[0] * near)])
    both = [np.cos(angles)[:, None] * axis + side * np.sin(angles)[:, None] * [-axis[1], axis[0]] for side in (1, -1)]
    return np.tile(shares, 2), np.concatenate(both), np.tile(weights, 2)


def test_the_gradient_of_the_bones_squares_is_that_of_their_points_in_the_field() -> None:
    parents, rng = np.array([0, 1]), np.random.default_rng(5)
    joints, radii = np.array([[12.3, 14.1], [30.2, 20.4], [44.6, 41.7]]), np.array([[4.2, 3.1], [2.9, 5.3]])
    field = cv2.GaussianBlur(rng.normal(0.0, 30.0, (64, 70)), (0, 0), 6.0).astype(np.float32)
    corner, scale = np.array([-3, -4]), 1.5
    seen = []  # (bone, share, normal, weight) of the points that no other bone covers
    for b, parent in enumerate(parents):
        other = 1 - b
        for share, normal, weight in zip(*border_of(joints[[parent, b + 1]], radii[b], 2.0), strict=True):
            x, y = point_of(joints, radii, parents, b, share, normal)
            off = kernels.cone_distance(
                x, y, *joints[parents[other]], radii[other, 0], *joints[other + 1], radii[other, 1]
            )
            if off[0] >= -kernels.COVERED:
                seen.append((b, share, normal, weight / (1.0 + (field_at(field, x, y, corner) / scale) ** 2)))
    assert 20 < len(seen) < 100

    def offs(numbers: np.ndarray) -> np.ndarray:
        """Return how far the points are outside, each times the root of its weight: normals stay as they were."""
        moved, grown = numbers[:6].reshape(3, 2), numbers[6:].reshape(2, 2)
        places = [point_of(moved, grown, parents, b, share, normal) for b, share, normal, _ in seen]
        return np.array(
            [np.sqrt(one[-1]) * field_at(field, x, y, corner) for one, (x, y) in zip(seen, places, strict=True)]
        )

    out = np.zeros((1, 10, 10)), np.zeros((1, 10))
    kernels._pull_bones(field, corner, np.array(field.shape), parents, joints, radii, 2.0, scale, out[0][0], out[1][0])
    here = np.concatenate([joints.ravel(), radii.ravel()])
    steps = 1e-4 * np.eye(10)
    slopes = np.array([(offs(here + step) - offs(here - step)) / 2e-4 for step in steps])
    np.testing.assert_allclose(out[1][0], slopes @ offs(here), rtol=1e-4, atol=1e-4)
    np.testing.assert_allclose(out[0][0], slopes @ slopes.T, rtol=1e-4, atol=1e-4)


def test_steps_for_other_slopes_are_those_that_they_alone_would_ask_for() -> None:
    rng = np.random.default_rng(4)
    squares = Squares.of(5, 2)
    squares.add(slice(0, 2), np.eye(2) * 3.0, rng.normal(size=(5, 2)))
    squares.add_bends(slice(0, 1), rng.normal(size=(5, 1)), 2.0)
    others = rng.normal(size=(5, 2, 3))
    found = squares.steps_for(others)
    for k in range(3):
        np.testing.assert_allclose(Squares(squares.curves, others[..., k]).least(), found[..., k], atol=1e-12)


@each("views", [(60.0,), (0.0, 90.0)])
def test_poses_that_are_off_come_back_to_what_is_seen(views: tuple[float, ...]) -> None:
    scene, truth = footage(views=views)
    found = off(truth)
    told, shape = fit_contours(scene, found, seen_by(scene), None)
    assert shape is None
    assert away(told, truth) < 0.65 * away(found, truth)
    assert told.skeleton is scene.body.skeleton


def test_limbs_that_are_thicker_than_the_bodys_become_as_thick() -> None:
    scene, truth = footage(girth=1.25)
    _, shape = fit_contours(scene, off(truth, 2.0), seen_by(scene), average_shape(scene))
    assert shape is not None
    found = dict(zip(NAMES, shape.factors, strict=True))
    assert found["thighs girth"] == pytest.approx(1.25, abs=0.1)
    assert found["torso girth"] == pytest.approx(1.25, abs=0.1)
    assert found["shanks girth"] == pytest.approx(1.0, abs=0.1)
    np.testing.assert_allclose(shape.body.radii, shaped(scene.body, shape.factors).radii)


def test_a_fit_that_costs_more_than_what_it_began_with_is_not_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    def astray(part: contours._Part, pulled: object, *, build: bool) -> contours._Part:
        return replace(part, places=part.places + 1.0, body=shaped(part.body, np.full(len(NAMES), 0.9)))

    scene, motion = footage(6)
    shape = average_shape(scene)
    monkeypatch.setattr(contours, "_stepped", astray)
    told, found = fit_contours(scene, motion, seen_by(scene), shape)
    assert found is shape
    np.testing.assert_array_equal(told.poses, motion.poses)
    np.testing.assert_array_equal(told.translations, motion.translations)


def test_a_build_stays_within_what_the_opening_searches() -> None:
    scene, motion = footage(6, girth=4.0)  # three spreads of 0.3 make a girth at most 2.46 times as thick
    _, shape = fit_contours(scene, motion, seen_by(scene), average_shape(scene))
    assert shape is not None
    assert 1.5 < shape.factors.max() <= np.exp(0.9) + 1e-9


def test_a_build_as_tall_as_was_said_stays_so_tall() -> None:
    scene, truth = footage(girth=1.25)
    shape = replace(average_shape(scene), height=scene.body.stature)
    _, fitted = fit_contours(scene, truth, seen_by(scene), shape)
    assert fitted is not None
    assert fitted.body.stature == pytest.approx(scene.body.stature)


def test_a_long_track_is_fitted_in_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, truth = footage(20)
    found = off(truth)
    whole, _ = fit_contours(scene, found, seen_by(scene), None)
    monkeypatch.setattr(contours, "WINDOW", 10)
    monkeypatch.setattr(contours, "OVERLAP", 6)
    parts, _ = fit_contours(scene, found, seen_by(scene), None)
    assert away(parts, whole) < 0.1 * away(found, whole)
    tall = replace(average_shape(scene), height=scene.body.stature)
    again, shape = fit_contours(scene, found, seen_by(scene), tall)
    assert shape is not None
    assert away(again, whole) < 0.5 * away(found, whole)
    assert again.skeleton is shape.body.skeleton


def test_frames_that_show_too_little_go_with_those_around_them() -> None:
    scene, truth = footage()
    observations = list(scene.observations)
    observations[6] = replace(observations[6], usable=False)
    empty = replace(scene, observations=[replace(one, usable=False) for one in observations])
    scene = replace(scene, observations=observations)
    found = off(truth)
    told, _ = fit_contours(scene, found, seen_by(scene), None)
    assert away(told.frames(6, 7), truth.frames(6, 7)) < 0.8 * away(found.frames(6, 7), truth.frames(6, 7))
    assert fit_contours(empty, found, seen_by(empty), None)[0] is found


@each("frames", [1, 2, 3])
def test_the_shortest_footage_is_told(frames: int) -> None:
    scene, truth = footage(frames)
    told, _ = fit_contours(scene, truth, seen_by(scene), average_shape(scene))
    assert len(told) == frames
    assert np.isfinite(told.poses).all()


def test_a_second_time_the_same_comes_out_bit_by_bit() -> None:
    scene, truth = footage(6)
    one, other = (fit_contours(scene, off(truth), seen_by(scene), average_shape(scene)) for _ in range(2))
    np.testing.assert_array_equal(one[0].poses, other[0].poses)
    assert one[1] is not None
    assert other[1] is not None
    np.testing.assert_array_equal(one[1].factors, other[1].factors)


def test_frames_tell_the_cost_of_the_build_that_is_told_and_what_else_they_may_be_goes_along() -> None:
    scene, truth = footage(girth=1.25)
    found = off(truth, 3.0)
    posterior = Posterior(found.poses[:2], found.translations[:2], np.ones(2))
    frames = [frame(pose, place, posterior) for pose, place in zip(found.poses, found.translations, strict=True)]
    alone, none = smoothed_frames(scene, frames, 0.5)
    told, shape = smoothed_frames(scene, frames, 0.5, average_shape(scene))
    assert none is None
    assert shape is not None
    assert np.mean([one.cost for one in told]) < 0.7 * np.mean([one.cost for one in alone])
    assert shape.cost == pytest.approx(np.mean([one.cost for one in told]))
    moved = told[0].posterior
    assert moved is not None
    np.testing.assert_allclose(
        moved.poses - posterior.poses, np.tile(told[0].pose - frames[0].pose, (2, 1)), atol=1e-12
    )
    np.testing.assert_allclose(
        moved.translations[1] - told[0].translation, found.translations[1] - found.translations[0]
    )
