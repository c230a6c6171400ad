"""The loops for a GPU, on one where there is one, else in numba's simulator: the areas that a CPU counts, all pixels.

`NUMBA_ENABLE_CUDASIM=1 python -m pytest -m device` asks for the simulator. No figure of a speed comes from it.
"""

from dataclasses import replace

import numpy as np
import pytest

from posefit import Body, Camera, Silhouette, areas, moved_to, project
from posefit.motion.built_in import average_skeleton
from posefit.plugin import Array, draw_population
from posefit.silhouette.drawn import PoseCount
from posefit.testing.problem import pose_problem
from tests.cases import each
from tests.silhouette.twin import random_poses

pytestmark = [
    pytest.mark.device,
    # a body far off the image has coordinates that no float32 holds: on a device as on a CPU these are infinite
    pytest.mark.filterwarnings("ignore::RuntimeWarning"),
]


@pytest.fixture(scope="module")
def body() -> Body:
    return Body.of(average_skeleton())


def assert_equals_the_cpu(
    body: Body, camera: Camera, poses: Array, places: Array
) -> None:
    mask = project(body, camera, poses[0], np.zeros(3))
    # a tenth is not known
    silhouette = Silhouette.of(mask, np.random.default_rng(1).random(mask.shape) < 0.9)
    expected = areas(body, camera, silhouette, poses, places)
    np.testing.assert_array_equal(
        areas(body, camera, moved_to(silhouette, "cuda"), poses, places), expected
    )


# widths about those of a word and of what a thread fills at a time; the body is as large as the image, or larger
@each("size", [(40, 30), (1, 9), (63, 17), (65, 8), (97, 24), (129, 20), (161, 16)])
@each("depth", [3.0, 0.6])
def test_200_poses_have_the_areas_that_a_cpu_counts(
    body: Body, size: tuple[int, int], depth: float
) -> None:
    rng = np.random.default_rng(2)
    camera = Camera.around(np.zeros(3), 0.4, depth, size, field_of_view=0.9)
    count = 32 if size == (40, 30) else 12
    assert_equals_the_cpu(
        body,
        camera,
        random_poses(rng, count),
        rng.normal(0.0, 0.4, (count, 3)) * [1.0, 1.0, 0.2],
    )


def test_a_body_off_the_image_across_the_near_plane_or_behind_the_camera_has_the_same_areas(
    body: Body,
) -> None:
    camera = Camera.around(np.zeros(3), 0.4, 4.0, (40, 30))
    towards = camera.rotation.T @ np.array([0.0, 0.0, -1.0])
    across = np.array(
        [
            [0.9, 0.5, 0.0],
            [-0.9, 0.3, 0.0],
            [0.2, -0.9, 0.0],
            [9.0, 0.0, 0.0],
            [0.0, -9.0, 0.0],
        ]
    )
    places = [
        *across,
        *(depth * towards for depth in (3.2, 3.7, 3.95, 4.0, 4.4, 9.0)),
        np.full(3, 1e300),
    ]
    assert_equals_the_cpu(
        body,
        camera,
        random_poses(np.random.default_rng(3), len(places)),
        np.array(places),
    )


def test_parts_on_their_way_are_put_together_in_order(
    body: Body, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("posefit_cuda.areas.PART", 3)
    rng = np.random.default_rng(6)
    camera = Camera.around(np.zeros(3), 0.4, 3.0, (24, 20))
    assert_equals_the_cpu(
        body, camera, random_poses(rng, 13), rng.normal(0.0, 0.2, (13, 3))
    )


def test_a_problem_of_several_views_costs_the_same_bits_on_a_device() -> None:
    one = pose_problem().coarser(4)
    seen = one.silhouettes[0]
    around = Camera.around(one.space.anchor, 2.0, 3.5, (33, 20))
    on_cpu = replace(
        one,
        cameras=[*one.cameras, around],
        silhouettes=[seen, Silhouette.of(np.eye(20, 33))],
    )
    on_device = replace(
        on_cpu, silhouettes=[moved_to(view, "cuda") for view in on_cpu.silhouettes]
    )
    proposals = draw_population(on_cpu.space, np.random.default_rng(7), 6)
    count = PoseCount()
    with count.counting():
        np.testing.assert_array_equal(on_device(proposals), on_cpu(proposals))
    # of each view on the device and on the CPU, in one a quarter as large
    assert count.poses == 2 * (6 + 6 / 16)
    half = on_device.coarser(2), on_cpu.coarser(2)
    np.testing.assert_array_equal(*(size(proposals) for size in half))
