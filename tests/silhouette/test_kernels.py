"""The rasteriser against a slow twin, pixel for pixel, wherever the body is."""

import multiprocessing
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from posefit import Body, Camera, Silhouette
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.geometry.skeleton import ANGLES, Skeleton
from posefit.silhouette.cost import areas, drawing_of, mismatch, project
from posefit.silhouette.drawn import PoseCount, count_poses
from posefit.silhouette.kernels import count_areas
from posefit.silhouette.outlines import FAR, NEAR
from posefit.silhouette.sharing import parts_of, work_through
from tests.cases import each
from tests.silhouette.twin import TIE, body_distance, random_poses


def assert_equals_the_twin(
    body: Body, camera: Camera, pose: Array, translation: Array
) -> bool:
    """Compare the masks; return whether no pixel was so near a border that rounding may decide it."""
    distance = body_distance(body, camera, pose, translation)
    drawn = project(body, camera, pose, translation)
    clear = np.abs(distance) > TIE
    np.testing.assert_array_equal(drawn[clear], (distance <= 0.0)[clear])
    return bool(clear.all())


def test_a_body_is_cut_by_any_image_and_the_near_plane_and_both_focal_lengths_count(
    body: Body, camera: Camera
) -> None:
    towards = camera.rotation.T @ np.array([0.0, 0.0, -1.0])
    aside = [(0.9, 0.0), (-0.9, 0.3), (0.0, 0.8), (0.2, -0.9), (9.0, 0.0), (0.0, -9.0)]
    cases = [(camera, np.array([*shift, 0.0]), 5) for shift in aside]
    cases += [(camera, depth * towards, 3) for depth in (3.2, 3.7, 3.95, 4.0, 4.4, 9.0)]
    cases += [
        (replace(camera, focal=np.array(focal)), np.zeros(3), 10)
        for focal in ([90.0, 140.0], [140.0, 90.0])
    ]
    for seed, (view, place, count) in enumerate(cases):
        for pose in random_poses(np.random.default_rng(seed), count):
            assert_equals_the_twin(body, view, pose, place)
    assert not project(body, camera, np.zeros(ANGLES), 9.0 * towards).any()
    for width in [1, 2, 63, 64, 65, 127, 129, 321]:
        view = Camera.around(np.zeros(3), 0.0, 3.0, (width, 61), field_of_view=0.6)
        poses = random_poses(np.random.default_rng(width), 12)
        assert (
            sum(assert_equals_the_twin(body, view, pose, np.zeros(3)) for pose in poses)
            >= 4
        )


def test_the_same_bits_for_any_number_of_poses_and_threads_and_many_calls_at_once(
    body: Body, camera: Camera
) -> None:
    rng = np.random.default_rng(8)
    poses = random_poses(rng, 1000)
    translations = rng.uniform(-0.5, 0.5, (1000, 3))
    silhouette = Silhouette.of(project(body, camera, poses[0], translations[0]))
    together = areas(body, camera, silhouette, poses, translations)

    def some(count: int, threads: int) -> Array:
        return areas(
            body, camera, silhouette, poses[:count], translations[:count], threads
        )

    asked = [(count, threads) for count in (1, 40, 1000) for threads in (1, 2)] * 3
    with ThreadPoolExecutor(4) as pool:
        for (count, _), counted in zip(
            asked, pool.map(some, *zip(*asked, strict=True)), strict=True
        ):
            np.testing.assert_array_equal(counted, together[:count])


def _in_a_child(
    body: Body,
    camera: Camera,
    mask: Array,
    poses: Array,
    queue: "multiprocessing.Queue[Array]",
) -> None:
    queue.put(
        areas(body, camera, Silhouette.of(mask), poses, np.zeros((len(poses), 3)), 2)
    )


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_forked_child_can_use_threads_too(body: Body, camera: Camera) -> None:
    poses = random_poses(np.random.default_rng(10), 80)
    mask = project(body, camera, poses[0], np.zeros(3))
    here = areas(body, camera, Silhouette.of(mask), poses, np.zeros((80, 3)), 2)
    context = multiprocessing.get_context("fork")
    queue = context.Queue()
    # a daemon: a child that waits for ever fails this test and does not hold up the end of the run
    child = context.Process(
        target=_in_a_child, args=(body, camera, mask, poses, queue), daemon=True
    )
    child.start()
    np.testing.assert_array_equal(queue.get(timeout=600), here)
    child.join(30)
    assert child.exitcode == 0


def one_cone(bone: Array, r0: float, r1: float) -> Body:
    """Return a body of one bone (3,) that starts in the root; all else is points without width."""
    offsets = np.zeros((26, 3))
    radii = np.zeros((26, 2))
    offsets[0], radii[0] = bone, (r0, r1)
    return Body(Skeleton("one", offsets, np.tile(np.eye(3), (26, 1, 1)), ()), radii)


# At a depth of 1 m a metre is 100 pixels, and the world's origin is the image's top left corner.
FLAT = Camera(
    120, 90, np.array([100.0, 100.0]), np.zeros(2), np.eye(3), np.array([0.0, 0.0, 1.0])
)


def flat_cone(
    u: float, v: float, du: float, dv: float, r0: float, r1: float
) -> tuple[Body, Camera, Array, Array]:
    """Return what `project` wants for a cone given in pixels."""
    cone = one_cone(np.array([du, dv, 0.0]) / 100, r0 / 100, r1 / 100)
    return cone, FLAT, np.zeros(ANGLES), np.array([u, v, 0]) / 100


def test_cones_by_hand() -> None:
    # a cylinder of radius 5: 20.1 to 60.1 along row 30.2, rows 25 to 34 have their centres within 25.2 to 35.2
    lying = flat_cone(20.1, 30.2, 40.0, 0.0, 5.0, 5.0)
    upright = flat_cone(30.2, 20.1, 0.0, 40.0, 5.0, 5.0)
    for mask in (project(*lying), project(*upright).T):
        assert np.flatnonzero(mask[:, 40]).tolist() == list(range(25, 35))
        # centres within 15.1 and 65.1
        assert np.flatnonzero(mask[30]).tolist() == list(range(15, 65))
    # a disc of radius 1.6 on a pixel's centre: the 3 x 3 block (its corners are 1.41 away), and nothing at 2
    mask = project(*flat_cone(50.5, 40.5, 0.0, 0.0, 1.6, 1.6))
    assert mask.sum() == 9
    assert mask[39:42, 49:52].all()
    # a large disc hides a small one within it
    alone = project(*flat_cone(50.3, 40.7, 0.0, 0.0, 20.0, 20.0))
    np.testing.assert_array_equal(
        project(*flat_cone(50.3, 40.7, 3.0, 1.0, 20.0, 2.0)), alone
    )


def test_counted_areas_equal_the_masks_for_any_size_and_place(body: Body) -> None:
    for depth in [3.0, 0.9, 0.2]:
        for size in [
            (1, 1),
            (63, 40),
            (64, 8),
            (65, 9),
            (127, 61),
            (130, 7),
            (321, 50),
            (1920, 1080),
        ]:
            rng = np.random.default_rng(13)
            camera = Camera.around(np.zeros(3), 0.0, depth, size, field_of_view=0.8)
            poses = random_poses(rng, 8)
            translations = rng.normal(0.0, 0.4, (8, 3)) * [1.0, 1.0, 0.2]
            valid = rng.random(size[::-1]) < 0.9
            observed = (rng.random(size[::-1]) < 0.5) & valid
            masks = [
                project(body, camera, p, t) & valid
                for p, t in zip(poses, translations, strict=True)
            ]
            expected = [
                [(observed & ~m).sum(), (m & ~observed).sum(), (m & observed).sum()]
                for m in masks
            ]
            counted = areas(
                body, camera, Silhouette.of(observed, valid), poses, translations
            )
            np.testing.assert_array_equal(counted, expected)


def test_a_joint_is_drawn_from_5_cm_to_the_far_end() -> None:
    for depth in [NEAR - 1e-9, NEAR + 1e-9, FAR - 1e-3, FAR + 1e-3]:
        camera = Camera(
            40, 30, np.full(2, 10.0), np.array([20.0, 15.0]), np.eye(3), np.zeros(3)
        )
        # a disc of radius 5 pixels, whatever its depth
        point = one_cone(np.zeros(3), 0.5 * depth, 0.5 * depth)
        mask = project(point, camera, np.zeros(ANGLES), np.array([0.0, 0.0, depth]))
        assert mask.any() == (NEAR <= depth <= FAR)


def test_a_pose_that_is_nan_spoils_no_other_and_is_not_drawn(body, camera) -> None:
    rng = np.random.default_rng(15)
    poses = random_poses(rng, 5)
    translations = rng.uniform(-0.3, 0.3, (5, 3))
    silhouette = Silhouette.of(project(body, camera, poses[0], translations[0]))
    expected = areas(body, camera, silhouette, poses, translations)
    drawing = drawing_of(body, camera, silhouette)
    for bad in [np.nan, np.inf, -np.inf, 1e300, 1e20]:
        for angle in [0, 9, slice(None), None]:
            odd = poses.copy()
            places = translations.copy()
            if angle is None:
                places[2] = bad
            else:
                odd[2, angle] = bad
            counted = np.empty((5, 3), dtype=np.int64)
            count_areas(*drawing, odd, places, counted)
            np.testing.assert_array_equal(
                np.delete(counted, 2, axis=0), np.delete(expected, 2, axis=0)
            )
            assert counted[2, 0] + counted[2, 2] == silhouette.mask.sum()
            assert (counted[2] >= 0).all()
            assert angle is not None or counted[2].tolist() == [
                silhouette.mask.sum(),
                0,
                0,
            ]


def test_invalid_poses_and_invalid_areas_are_refused(
    body: Body, camera: Camera
) -> None:
    silhouette = Silhouette.of(np.eye(camera.height, camera.width))
    pose = np.zeros(ANGLES)
    place = np.zeros(3)
    for bad in (np.nan, np.inf):
        odd = np.where(np.arange(ANGLES) == 9, bad, pose)
        for poses, places, name in (
            (odd, place, "pose"),
            (pose, np.array([bad, bad, 0.0]), "translation"),
        ):
            count = 1 if name == "pose" else 2
            with pytest.raises(
                InputError,
                match=f"^{name}s must be finite, got {count} numbers that are not$",
            ):
                areas(body, camera, silhouette, poses[None], places[None])
            with pytest.raises(
                InputError,
                match=f"^{name} must be finite, got {count} numbers that are not$",
            ):
                project(body, camera, poses, places)
    for counts in (
        np.zeros((4, 2, 3)),
        np.zeros(3),
        np.zeros((4, 2)),
        [["1", "2", "3"]],
        [[None] * 3],
    ):
        with pytest.raises(
            InputError,
            match=r"^areas must be numbers of shape \(n, 3\), got .* of shape \(",
        ) as caught:
            mismatch(counts)  # type: ignore[arg-type]
        assert len(str(caught.value)) < 100
    assert mismatch([[1, 1, 1]]).tolist() == [50.0]  # type: ignore[arg-type]


@pytest.mark.pure
# rows that no disc crosses
@pytest.mark.filterwarnings("ignore:invalid value encountered in sqrt")
def test_small_images_equal_the_twin_even_uncompiled(body: Body) -> None:
    camera = Camera.around(np.zeros(3), 0.4, 4.0, (40, 30))
    towards = camera.rotation.T @ np.array([0.0, 0.0, -1.0])
    poses = random_poses(np.random.default_rng(16), 5)
    # in the middle, cut by the image's edge, across the near plane, behind the camera, far away
    places = [
        0.0 * towards,
        np.array([0.9, 0.5, 0.0]),
        3.9 * towards,
        9.0 * towards,
        -1e4 * towards,
    ]
    for pose, place in zip(poses, places, strict=True):
        assert_equals_the_twin(body, camera, pose, place)


@each("threads", [1, 2])
def test_an_error_in_a_part_is_raised(threads: int) -> None:
    def work(part: slice) -> None:
        if part.start <= 500 < part.stop:
            raise ValueError("row 500")

    with pytest.raises(ValueError, match="row 500"):
        work_through(parts_of(1000, threads), threads, lambda part: (), work)


def test_poses_drawn_by_other_threads_count_for_the_caller() -> None:
    counts = [PoseCount(), PoseCount()]

    def ask(count: PoseCount, n: int) -> None:
        with count.counting():
            work_through(
                parts_of(n, 3),
                3,
                lambda part: (),
                lambda part: count_poses(part.stop - part.start),
            )

    with ThreadPoolExecutor(2) as pool:
        for job in [
            pool.submit(ask, count, n)
            for count, n in zip(counts, (1000, 3000), strict=True)
        ]:
            job.result(timeout=60)
    assert [count.poses for count in counts] == [1000, 3000]
