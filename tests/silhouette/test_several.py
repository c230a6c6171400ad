"""Several silhouettes with one drawing of each pose."""

import numpy as np
import pytest

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import ANGLES
from posefit.silhouette.cost import areas, areas_of_all, project
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.mask import Silhouette


def silhouettes(body: Body, camera: Camera, count: int) -> list[Silhouette]:
    """Return silhouettes of random poses, each with other unknown pixels; the last knows nothing."""
    rng = np.random.default_rng(1)
    shape = camera.height, camera.width
    known = [rng.random(shape) < share for share in np.linspace(1.0, 0.0, count)]
    poses, places = rng.normal(0.0, 0.4, (count, ANGLES)), rng.uniform(-0.4, 0.4, (count, 3))
    return [Silhouette.of(project(body, camera, p, t), v) for p, t, v in zip(poses, places, known, strict=True)]


@pytest.mark.parametrize("threads", [1, 2])
@pytest.mark.parametrize("count", [1, 2, 7])
def test_each_silhouette_has_the_areas_that_it_has_alone(body: Body, camera: Camera, count: int, threads: int) -> None:
    rng = np.random.default_rng(0)
    poses, places = rng.normal(0.0, 0.4, (300, ANGLES)), rng.uniform(-2.0, 2.0, (300, 3))
    poses[7, 0] = np.nan  # nothing is drawn
    places[8] = 0.0, 0.0, 1e9
    seen = silhouettes(body, camera, count)
    found = areas_of_all(body, camera, seen, poses, places, threads)
    assert found.shape == (count, 300, 3)
    np.testing.assert_array_equal(found, [areas(body, camera, one, poses, places) for one in seen])


@pytest.mark.pure
def test_two_silhouettes_by_counting_even_uncompiled(body: Body) -> None:
    camera = Camera.around(np.zeros(3), 0.4, 4.0, (40, 30))
    seen = silhouettes(body, camera, 2)
    pose, place = np.full((1, ANGLES), 0.1), np.zeros((1, 3))
    drawn = project(body, camera, pose[0], place[0])
    expected = [[[(s.mask & ~drawn).sum(), (drawn & s.valid & ~s.mask).sum(), (s.mask & drawn).sum()]] for s in seen]
    np.testing.assert_array_equal(areas_of_all(body, camera, seen, pose, place), expected)


def test_each_comparison_counts_as_a_pose_and_no_silhouettes_have_no_areas(body: Body, camera: Camera) -> None:
    count, poses, places = PoseCount(), np.zeros((5, ANGLES)), np.zeros((5, 3))
    with count.counting():
        areas_of_all(body, camera, silhouettes(body, camera, 3), poses, places)
    # three to make the silhouettes, and five poses with each
    assert count.poses == 3 + 15
    assert areas_of_all(body, camera, [], poses, places).shape == (0, 5, 3)


def test_a_silhouette_of_another_size_is_refused(body: Body, camera: Camera) -> None:
    seen = [*silhouettes(body, camera, 2), Silhouette.of(np.ones((10, 10)))]
    with pytest.raises(ValueError, match=r"mask must have shape \(72, 96\), got \(10, 10\)"):
        areas_of_all(body, camera, seen, np.zeros((1, ANGLES)), np.zeros((1, 3)))
