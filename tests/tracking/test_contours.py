"""Bodies fitted to the borders of masks: distances and gradients by slow twins, and bodies that come back."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from posefit.arrays import Array
from posefit.fitting import contour_kernels as kernels
from posefit.fitting import contour_residuals as residuals
from posefit.fitting import contour_twists as twists
from posefit.fitting.contours import (
    MaskContours,
    coarseness,
    contour_squares,
    distances_outside,
    precisions,
)
from posefit.fitting.contours import fitted as fitted_to_frame
from posefit.fitting.shape import NAMES, SPREAD, Shape, shaped
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene, synthetic
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.tracking.pipeline import with_turns
from posefit.tracking.smoothing import contours
from posefit.tracking.smoothing.contours import (
    Borders,
    fit_contours,
    growth,
    turned_camera,
)
from posefit.tracking.smoothing.path import Visibility
from posefit.tracking.smoothing.smooth import smooth
from posefit.uncertainty.calibration import Recalibration
from posefit.uncertainty.modes import Posterior
from tests.cases import each

CAMERA = Camera.around(np.array([0.0, 0.9, 0.0]), 0.4, 4.0, (200, 200))


def footage(
    frames: int = 14, views: tuple[float, ...] = (60.0,), girth: float = 1.0
) -> tuple[Scene, Motion]:
    """Return footage of a walk by a person whose limbs are thicker than those of the body that is fitted to it."""
    motion = built_in.motion("walk", frames=60).frames(5, 5 + frames)
    scene = synthetic(motion, views, (160, 160), (), (None, None))
    factors = np.ones(len(NAMES))
    factors[NAMES.index("thighs girth")] = factors[NAMES.index("torso girth")] = girth
    body = shaped(scene.body, factors)
    observations = [
        Observation(
            [Silhouette.of(project(body, camera, *pose)) for camera in scene.cameras]
        )
        for pose in zip(motion.poses, motion.translations, strict=True)
    ]
    return replace(scene, truth=None, observations=observations), motion


def estimate_of(motion: Motion, degrees: float = 5.0, seed: int = 0) -> Motion:
    """Return a motion whose angles are off, smoothly, as those of a tracker."""
    rng = np.random.default_rng(seed)
    times = np.arange(len(motion))[:, None] / motion.fps
    waves = np.sin(2.0 * np.pi * times + rng.uniform(0.0, 6.0, 66)) * rng.uniform(
        0.5, 1.0, 66
    )
    return replace(
        motion, poses=motion.poses + np.radians(degrees) * waves * motion.skeleton.free
    )


def fitted(
    scene: Scene, motion: Motion, shape: Shape | None = None
) -> tuple[Motion, Shape | None]:
    return fit_contours(scene, motion, Visibility.of(scene), shape)[1:]


def distance(motion: Motion, truth: Motion) -> float:
    """Return the mean distance of the joints in metres."""
    return float(np.linalg.norm(motion.joints - truth.joints, axis=2).mean())


def average_shape(scene: Scene) -> Shape:
    return Shape(scene.body, np.ones(len(NAMES)), np.zeros(len(NAMES)), 0.0)


# A slow twin of the kernels: difference quotients of all numbers of a drawn body.

STEP = 1e-5
BONE_STARTS = np.array(PARENTS[1:])
# of a drawn body: pixels of joints, then radii of bones
COUNT = 2 * len(JOINTS) + 2 * len(BONES)


def cone_distance(
    x: float, y: float, points: Array, radii: Array
) -> tuple[float, float, float, float]:
    """Return how far a point is outside the cone of two discs, at which share of it, and its normal."""
    cones = np.empty((1, residuals.CONE))
    discs = np.empty((1, 3))
    residuals.write_cones(
        np.zeros(1, int), np.asarray(points), np.asarray(radii)[None], cones, discs
    )
    distance, *others = residuals.cone_distance(x, y, residuals.cone_of(cones, 0))
    return distance, *others


def drawn_body(body: Body, camera: Camera, joints: Array) -> Array:
    """Return where joints (27, 3) are in the picture, and how wide the bones' ends (106,), in pixels."""
    pixels, far = camera.project(joints)
    metres = np.sqrt(camera.focal.prod()) / far
    radii = np.column_stack(
        [metres[BONE_STARTS] * body.radii[:, 0], metres[1:] * body.radii[:, 1]]
    )
    return np.concatenate([pixels.ravel(), radii.ravel()])


def pulled(
    numbers: Array, mask: residuals.Contour, scale: float
) -> tuple[Array, Array]:
    """Return half the second derivatives (106, 106) and half the gradient (106,) by the numbers of a drawn body."""
    centres, radii = (
        part.reshape(-1, 2) for part in np.split(numbers, [2 * len(JOINTS)])
    )
    blocks = np.zeros((len(BONES), 6, 6))
    forces = np.zeros((len(BONES), 6))
    residuals.accumulate_borders(
        BONE_STARTS, centres, radii, mask, scale, blocks, forces
    )
    curves = np.zeros((COUNT, COUNT))
    slopes = np.zeros(COUNT)
    for b, parent in enumerate(BONE_STARTS):
        rows = [
            2 * parent,
            2 * parent + 1,
            2 * b + 2,
            2 * b + 3,
            *(2 * (len(JOINTS) + b) + np.arange(2)),
        ]
        curves[np.ix_(rows, rows)] += blocks[b]
        slopes[rows] += forces[b]
    return curves, slopes


def pull_of_view(
    view: MaskContours, k: int, place: Array, here: Array, there: Array, reach: float
) -> tuple[Array, Array]:
    """Return half the second derivatives (n, n) and half the gradient (n,) by n parameters, in frame k.

    The root is at `place` (3,). The drawn body's numbers are `here` (106,), and `there` (n, 106) where each parameter is off by `STEP`.
    """
    root = coarseness(view.camera, place[None])[0][0]  # pixels per metre
    points = np.ascontiguousarray(view.points[view.starts[k] : view.starts[k + 1]])
    mask = residuals.Contour(
        view.fields[k],
        view.corners[k],
        view.sizes[k],
        points,
        view.spacing,
        np.full(len(points), -1),
    )
    curves, slopes = pulled(here, mask, max(reach * root, twists.MIN_ROBUST_SCALE))
    deviation = twists.BORDER_DEVIATION**2 + (twists.PIXEL_DEVIATION / root) ** 2
    worth = 1.0 / (root**3 * twists.CORRELATION_LENGTH * deviation)
    ways = (there - here).T / STEP
    return worth * ways.T @ curves @ ways, worth * ways.T @ slopes


def moved_bodies(
    body: Body, camera: Camera, pose: Array, place: Array
) -> tuple[Array, Array]:
    """Return a drawn body's numbers (106,), and those (69, 106) of bodies whose place or an angle is off by `STEP`."""
    steps = STEP * np.eye(3 + len(pose))
    numbers = [
        drawn_body(
            body,
            camera,
            body.skeleton.joints((pose + step[3:])[None], (place + step[:3])[None])[0],
        )
        for step in (np.zeros(3 + len(pose)), *steps)
    ]
    return numbers[0], np.array(numbers[1:])


@each("radii", [(5.0, 2.0), (2.0, 5.0), (3.0, 3.0), (30.0, 2.0), (1.0, 40.0)])
def test_the_distance_from_a_cone_is_that_from_the_nearest_of_all_its_discs(
    radii: tuple[float, float],
) -> None:
    rng = np.random.default_rng(1)
    start = np.array([10.0, 20.0])
    end = np.array([28.0, 12.0])
    shares = np.linspace(0.0, 1.0, 20_001)[:, None]
    for x, y in rng.uniform(-10.0, 50.0, (40, 2)):
        far = np.linalg.norm((x, y) - (start + shares * (end - start)), axis=1)
        expected = (far - (radii[0] + shares[:, 0] * (radii[1] - radii[0]))).min()
        distance, share, across, down = cone_distance(
            x, y, np.array([start, end]), radii
        )
        assert distance == pytest.approx(expected, abs=1e-4)
        assert 0.0 <= share <= 1.0
        assert np.hypot(across, down) == pytest.approx(1.0)


def test_pixels_have_their_distance_from_the_border_if_it_is_known() -> None:
    mask = np.zeros((1, 7), dtype=bool)
    around = np.ones((1, 7), dtype=bool)
    mask[0, 2:5] = True
    around[0, 2:5] = around[0, 6] = False
    # the border is between pixels, half a pixel from the middles of either
    np.testing.assert_allclose(
        distances_outside(mask, around),
        [[1.5, 0.5, -0.5, -1.5, -0.5, 0.5, 0.0]],
        atol=1e-6,
    )


def test_the_border_of_a_mask_is_where_it_meets_known_background() -> None:
    mask = np.zeros((60, 60), dtype=bool)
    valid = np.ones((60, 60), dtype=bool)
    mask[20:40, 20:40] = True
    valid[:, 40:] = False  # its right border is unknown
    mask[5, 5] = True  # and a speck is not the person
    observations = [
        Observation([Silhouette.of(mask, valid)], usable=usable)
        for usable in (True, False)
    ]
    camera = Camera.around(np.zeros(3), 0.0, 4.0, (60, 60))
    borders = MaskContours.of(camera, 0, observations, np.zeros((2, 3)))
    # three sides of 20 pixels; none of a frame that is not usable
    assert borders.starts.tolist() == [0, 60, 60]
    assert borders.points.min(axis=0).tolist() == [20.0, 20.0]
    assert borders.points.max(axis=0).tolist() == [39.5, 40.0]
    per_metre, factor = coarseness(camera, np.zeros((2, 3)))
    assert per_metre == pytest.approx([camera.focal[0] / 4.0] * 2)
    assert factor == 1


def test_the_border_terms_of_a_window_equal_those_of_a_slow_twin() -> None:
    scene, motion = footage(3, (60.0, 150.0))
    body = scene.body
    skeleton = scene.body.skeleton
    poses = estimate_of(motion).poses
    changes = growth(body, body.stature, replace(motion, poses=poses))
    places = motion.translations
    views = [
        MaskContours.of(camera, k, scene.observations, places)
        for k, camera in enumerate(scene.cameras)
    ]
    curves, slopes, mixed, hessian, gradient = contour_squares(
        body, views, poses, places, 0.09, [changes] * 2
    )
    expected = (
        np.zeros((3, 69 + len(NAMES), 69 + len(NAMES))),
        np.zeros((3, 69 + len(NAMES))),
    )
    grown = [
        shaped(body, np.exp(STEP * row), body.stature) for row in np.eye(len(NAMES))
    ]
    for k in range(3):
        for view in views:
            here, there = moved_bodies(
                body, view.camera, poses[k], motion.translations[k]
            )
            joints = [
                one.skeleton.joints(poses[k : k + 1], motion.translations[k : k + 1])[0]
                for one in grown
            ]
            each = zip(grown, joints, strict=True)
            there = np.concatenate(
                [there, [drawn_body(one, view.camera, points) for one, points in each]]
            )
            for whole, part in zip(
                expected,
                pull_of_view(view, k, places[k], here, there, 0.09),
                strict=True,
            ):
                whole[k] += part
    free = np.append([True] * 3, skeleton.free)
    scale = np.abs(expected[0]).max()
    np.testing.assert_allclose(
        curves, expected[0][:, :69, :69][:, free][:, :, free], atol=1e-3 * scale
    )
    np.testing.assert_allclose(
        mixed, expected[0][:, :69, 69:][:, free], atol=1e-3 * scale
    )
    np.testing.assert_allclose(
        hessian, expected[0][:, 69:, 69:].sum(axis=0), atol=3e-3 * scale
    )
    scale = np.abs(expected[1]).max()
    np.testing.assert_allclose(slopes, expected[1][:, :69][:, free], atol=1e-3 * scale)
    np.testing.assert_allclose(
        gradient, expected[1][:, 69:].sum(axis=0), atol=3e-3 * scale
    )


def test_the_gradient_of_the_border_points_is_that_of_their_squares() -> None:
    body = Body.of(built_in.average_skeleton())
    rng = np.random.default_rng(3)
    numbers = drawn_body(
        body,
        CAMERA,
        body.skeleton.joints(np.zeros((1, 66)), np.array([[0.0, 0.9, 0.0]]))[0],
    )
    points = rng.uniform(40.0, 160.0, (30, 2))
    mask = residuals.Contour(
        np.zeros((1, 1), np.float32),
        np.zeros(2, np.int64),
        np.ones(2, np.int64),
        points,
        1.0,
        np.full(len(points), -1),
    )

    def half_sum(numbers: np.ndarray) -> float:
        joints = numbers[:54].reshape(27, 2)
        radii = numbers[54:].reshape(26, 2)
        total = 0.0
        for x, y in points:
            total += 0.5 * min(
                cone_distance(x, y, joints[[p, b + 1]], r)[0]
                for b, (p, r) in enumerate(zip(BONE_STARTS, radii, strict=True))
            ) ** 2  # fmt: skip
        return total

    curves, slopes = pulled(numbers, mask, 1e9)
    for k in range(0, COUNT, 3):
        step = 1e-4 * np.eye(COUNT)[k]
        expected = (half_sum(numbers + step) - half_sum(numbers - step)) / 2e-4
        assert slopes[k] == pytest.approx(expected, abs=1e-3 + 1e-3 * abs(expected))
    assert np.linalg.eigvalsh(curves).min() > -1e-6


def test_the_pull_of_a_bone_equals_the_sum_over_its_whole_border() -> None:
    # the border of two discs' hull, as 4000 short edges, in a field that rises evenly: 0.6 a pixel along, 0.3 down
    joints = np.array([[22.3, 24.1], [44.2, 33.4]])
    radii = np.array([[7.2, 4.1]])
    scale = 9.0
    turn = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    circle = np.column_stack([np.cos(turn), np.sin(turn)])
    hull = ConvexHull(
        (joints[:, None] + radii[0][:, None, None] * circle).reshape(-1, 2)
    )
    vertices = hull.points[[*hull.vertices, hull.vertices[0]]]
    along = np.concatenate(
        [[0.0], np.linalg.norm(np.diff(vertices, axis=0), axis=1).cumsum()]
    )
    even = np.linspace(0.0, along[-1], 4000, endpoint=False)
    corners = np.column_stack([np.interp(even, along, each) for each in vertices.T])
    edges = np.roll(corners, -1, axis=0) - corners
    middles = 0.5 * (np.roll(corners, -1, axis=0) + corners)
    slope = np.array([0.6, 0.3])
    curves = np.zeros((6, 6))
    slopes = np.zeros(6)
    for (x, y), edge in zip(middles, edges, strict=True):
        length = np.linalg.norm(edge)
        off = slope @ [x - 20.0, y - 30.0]
        share = cone_distance(x, y, joints, radii[0])[1]
        outwards = slope @ [edge[1], -edge[0]] / length
        way = np.concatenate(
            [
                np.outer([1.0 - share, share], slope).ravel(),
                outwards * np.array([1.0 - share, share]),
            ]
        )
        weight = length / (1.0 + (off / scale) ** 2)
        curves += weight * np.outer(way, way)
        slopes += weight * off * way
    rows, columns = np.mgrid[:64, :70] + 0.5
    field = (slope[0] * (columns - 20.0) + slope[1] * (rows - 30.0)).astype(np.float32)

    def pulled(
        joints: np.ndarray, parents: list[int], radii: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        blocks = np.zeros((len(parents), 6, 6))
        forces = np.zeros((len(parents), 6))
        mask = residuals.Contour(
            field,
            np.zeros(2, int),
            np.array(field.shape),
            np.zeros((0, 2)),
            0.25,
            np.zeros(0, int),
        )
        residuals.accumulate_borders(
            np.array(parents), joints, radii, mask, scale, blocks, forces
        )
        return blocks[0], forces[0]

    for mine, expected in zip(
        pulled(joints, [0], radii), (curves, slopes), strict=True
    ):
        np.testing.assert_allclose(mine, expected, atol=0.02 * np.abs(expected).max())
    hidden = pulled(
        np.array([*joints, [60.0, 40.0]]), [0, 1], np.array([radii[0], [90.0, 90.0]])
    )
    # the other bone covers it, and has its border beyond the field
    assert not hidden[1].any()


@each("views", [(60.0,), (0.0, 90.0)])
def test_poses_that_are_off_come_back_to_the_masks(views: tuple[float, ...]) -> None:
    scene, truth = footage(views=views)
    estimate = estimate_of(truth)
    motion, shape = fitted(scene, estimate)
    assert shape is None
    assert distance(motion, truth) < 0.65 * distance(estimate, truth)
    assert motion.skeleton is scene.body.skeleton


def test_limbs_become_as_thick_as_the_persons_and_the_height_stays() -> None:
    scene, truth = footage(girth=1.25)
    average = average_shape(scene)
    _, shape = fitted(scene, estimate_of(truth, 2.0), average)
    factors = dict(zip(NAMES, shape.factors, strict=True))
    expected = {"thighs girth": 1.25, "torso girth": 1.25, "shanks girth": 1.0}
    assert {name: factors[name] for name in expected} == pytest.approx(
        expected, abs=0.1
    )
    np.testing.assert_allclose(
        shape.body.radii, shaped(scene.body, shape.factors).radii
    )
    # as a share of people's
    spread = dict(zip(NAMES, shape.spread / SPREAD, strict=True))
    assert 0.0 < spread["thighs girth"] < 0.5 < spread["neck length"] < 1.0
    _, shape = fitted(scene, truth, replace(average, height=scene.body.stature))
    assert shape.body.stature == pytest.approx(scene.body.stature)


def test_cameras_that_are_turned_from_their_calibrations_come_back() -> None:
    scene, truth = footage(14, (0.0, 90.0, 200.0))
    true = scene.cameras
    # of pixels and metres that joints are off, for each placing
    off_by: dict[str, list[tuple[float, float]]] = {"placed": [], "given": []}
    for seed in range(3):
        rng = np.random.default_rng(seed)
        off = [
            turned_camera(camera, np.radians(0.2) * rng.standard_normal(3))
            for camera in true
        ]
        # those that are set up around a known motion are where they are said to be
        for placing, off_by_placing in off_by.items():
            calibrated = replace(scene, cameras=off, placing=placing)
            result, motion, _ = fit_contours(
                calibrated, estimate_of(truth), Visibility.of(calibrated), None
            )
            apart = [
                np.abs(
                    camera.project(motion.joints)[0] - other.project(truth.joints)[0]
                )
                for camera, other in zip(result.cameras, true, strict=True)
            ]
            off_by_placing.append((float(np.mean(apart)), distance(motion, truth)))
    placed, given = (np.array(off_by[placing]) for placing in ("placed", "given"))
    # 0.36 to 0.72 of them in six draws; joints are nearer on average, at 0.76
    assert (given[:, 0] < placed[:, 0]).all()
    assert (given.mean(axis=0) < 0.9 * placed.mean(axis=0)).all()


def test_the_angle_of_turned_cameras_is_reported() -> None:
    scene, _ = footage(3, (0.0, 90.0))
    assert with_turns(scene, scene.cameras) is scene
    turned = replace(
        scene,
        cameras=[
            turned_camera(scene.cameras[0], np.radians([0.0, 0.3, 0.4])),
            scene.cameras[1],
        ],
    )
    # 0.3, 0.4, 0.5: a right triangle
    said = "cameras turned by 0.50, 0.00 degrees, so that their masks agree"
    assert list(with_turns(turned, scene.cameras).guesses) == [*scene.guesses, said]


def test_a_fit_that_costs_more_than_its_start_is_not_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def astray(
        window: contours._Window, borders: object, scale: float
    ) -> contours._Window:
        moved = replace(window.motion, translations=window.motion.translations + 1.0)
        body = shaped(window.body, np.full(len(NAMES), 0.9))
        return replace(window, motion=moved, body=body)

    scene, motion = footage(6)
    average = average_shape(scene)
    monkeypatch.setattr(contours, "_stepped", astray)
    kept, shape = fitted(scene, motion, average)
    assert shape is average
    np.testing.assert_array_equal(kept.poses, motion.poses)
    np.testing.assert_array_equal(kept.translations, motion.translations)


def test_a_long_track_is_fitted_in_windows(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, truth = footage(20)
    estimate = estimate_of(truth)
    whole, _ = fitted(scene, estimate)
    monkeypatch.setattr(contours, "CONTOUR_WINDOW", 10)
    monkeypatch.setattr(contours, "CONTOUR_OVERLAP", 6)
    assert distance(fitted(scene, estimate)[0], whole) < 0.1 * distance(estimate, whole)
    motion, shape = fitted(
        scene, estimate, replace(average_shape(scene), height=scene.body.stature)
    )
    assert distance(motion, whole) < 0.5 * distance(estimate, whole)
    assert motion.skeleton is shape.body.skeleton


def test_unusable_frames_follow_the_usable_frames_around_them() -> None:
    scene, truth = footage()
    observations = list(scene.observations)
    observations[6] = replace(observations[6], usable=False)
    estimate = estimate_of(truth)
    motion, _ = fitted(replace(scene, observations=observations), estimate)
    before, after = (
        distance(each.frames(6, 7), truth.frames(6, 7)) for each in (estimate, motion)
    )
    assert after < 0.8 * before
    empty = replace(
        scene,
        observations=[
            replace(observation, usable=False) for observation in observations
        ],
    )
    assert fitted(empty, estimate)[0] is estimate


@each("frames", [1, 3])
def test_footage_of_any_length_is_fitted(frames: int) -> None:
    scene, truth = footage(frames)
    motion, _ = fitted(scene, estimate_of(truth), average_shape(scene))
    assert len(motion) == frames
    assert np.isfinite(motion.poses).all()


def test_smoothed_frames_have_the_cost_of_the_fitted_build_and_their_posteriors_move_along() -> (
    None
):
    scene, truth = footage(girth=1.25)
    estimate = estimate_of(truth, 3.0)
    sure = Recalibration(joint_spreads=np.append(0.0, np.full(len(JOINTS) - 1, 0.006)))
    posterior = Posterior(
        estimate.poses[:2], estimate.translations[:2], np.ones(2), recalibration=sure
    )
    known = zip(estimate.poses, estimate.translations, strict=True)
    nothing = np.zeros((1, 3), np.int64)
    frames = [Frame(*pose, 0.0, nothing, 0, posterior=posterior) for pose in known]
    (_, alone, none), (_, both, shape) = (
        smooth(scene, frames, each, 0.5) for each in (None, average_shape(scene))
    )
    assert none is None
    costs = [np.mean([frame.cost for frame in each]) for each in (both, alone)]
    assert costs[0] < 0.7 * costs[1]
    assert shape.cost == pytest.approx(costs[0])
    moved = both[0].posterior
    pose = both[0].pose
    assert alone[0].posterior.recalibration is moved.recalibration is sure
    np.testing.assert_allclose(
        moved.poses - posterior.poses,
        np.tile(pose - frames[0].pose, (2, 1)),
        atol=1e-12,
    )
    apart = estimate.translations[1] - estimate.translations[0]
    np.testing.assert_allclose(moved.translations[1] - both[0].translation, apart)


@pytest.mark.parametrize("views", [(90.0,), (0.0, 90.0)])
def test_poses_of_a_frame_are_fitted_alike_alone_together_and_by_several_threads(
    views: tuple[float, ...],
) -> None:
    motion = built_in.motion("walk", frames=6)
    scene = synthetic(motion, views, (160, 120), [], (None, None))
    rng = np.random.default_rng(3)
    poses = motion.poses + 0.1 * rng.standard_normal(motion.poses.shape)
    poses = np.where(scene.body.skeleton.free, poses, 0.0)
    places = np.repeat(motion.translations[2:3], len(poses), axis=0)
    borders = [
        MaskContours.of(camera, view, [scene.observations[2]], places[:1], 0.04)
        for view, camera in enumerate(scene.cameras)
    ]
    aims = poses, precisions(0.1, 0.01), (0.09, 0.045)

    def moved(rows: slice, threads: int) -> list[Array]:
        start = poses[rows], places[rows]
        return [
            *fitted_to_frame(
                scene.body, borders, start, aims[0][rows], *aims[1:], threads
            )
        ]

    together = moved(slice(None), 1)
    assert np.abs(together[0] - poses).max() > 0.01
    for part, whole in zip(moved(slice(None), 3), together, strict=True):
        np.testing.assert_array_equal(part, whole)
    for part, whole in zip(moved(slice(4, 5), 1), together, strict=True):
        np.testing.assert_array_equal(part[0], whole[4])


@each("count", [1, 3])
def test_one_pose_and_several_are_fitted_by_one_compiled_function(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene, motion = footage()
    views = [
        MaskContours.of(
            scene.cameras[0], 0, scene.observations[:1], motion.translations[:1]
        )
    ]
    targets = list[Array]()

    def fit_poses(*arguments: Any) -> None:
        targets.append(arguments[3].means)

    monkeypatch.setattr(kernels, "fit_poses", fit_poses)
    start = motion.poses[:count], motion.translations[:count]
    fitted_to_frame(scene.body, views, start, start[0], precisions(0.1, 0.01), (0.09,))
    # numba compiles a function for each memory order
    assert [each.flags.c_contiguous for each in targets] == [True]


def test_fits_share_the_borders_of_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    scene, motion = footage()
    observations = list(scene.observations)
    # a frame that shows nothing has no points
    observations[6] = replace(observations[6], usable=False)
    (camera,) = scene.cameras
    traced = []

    def of(camera: Camera, view: int, shown: Any, *rest: Any) -> MaskContours:
        traced.append(len(shown))
        return original(camera, view, shown, *rest)

    original = MaskContours.of
    monkeypatch.setattr(MaskContours, "of", of)
    borders = Borders(observations)
    every = np.arange(len(motion))
    borders.of(camera, 0, every, motion.translations)
    places = motion.translations[4:10]
    part = borders.starting_at(3).of(camera, 0, np.arange(1, 7), places)
    assert traced == [len(motion)]
    alone = original(camera, 0, observations[4:10], places)
    assert len(part) == len(alone) == 6
    for name in ("corners", "sizes", "points", "starts"):
        np.testing.assert_array_equal(getattr(part, name), getattr(alone, name))
    for k, (rows, columns) in enumerate(alone.sizes.tolist()):
        box = np.s_[k, :rows, :columns]
        np.testing.assert_array_equal(part.fields[box], alone.fields[box])
    # of other frames, only those that were asked for are kept
    few = Borders(observations)
    few.of(camera, 0, every[:5], motion.translations[:5])
    few.of(camera, 0, every[4:9], motion.translations[4:9])
    few.of(camera, 0, every[:5], motion.translations[:5])
    assert traced == [len(motion), 5, 5, 5]
