"""The look-up of silhouettes: the right mode, refusals, cameras of any attitude, and how a search uses it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import posefit
from posefit import Body, Camera, Observation, Silhouette, Task, project
from posefit.arrays import Array
from posefit.fitting.start import modes_apart
from posefit.geometry.rotation import wrapped
from posefit.motion import built_in
from posefit_exemplars.exemplars import SAME_TURN
from posefit_exemplars.lookup import Lookup, looking_at
from tests.cases import each
from tests.geometry.turns import about

WALK = built_in.motion("walk-a")
BODY = Body.of(WALK.skeleton)
TRAINING = [built_in.motion(style) for style in ("walk-b", "walk-c")]
PLACE = np.array([0.0, 0.1, 0.0])


def camera_at(azimuth: float, elevation: float = 0.0, roll: float = 0.0) -> Camera:
    straight = looking_at(azimuth, elevation)
    rolled = about(2, roll) @ straight.rotation
    return Camera(
        160, 160, np.full(2, 200.0), np.full(2, 80.0), rolled, straight.translation
    )


def observed_by(cameras: list[Camera], pose: Array) -> Observation:
    return Observation(
        [Silhouette.of(project(BODY, camera, pose, PLACE)) for camera in cameras]
    )


def task_of(cameras: list[Camera], yaw: float | None = None) -> Task:
    return Task(BODY, cameras, 1000, yaw, np.zeros(3), "aligned", training=TRAINING)


@cache
def turned(seed: int) -> Array:
    """Return a pose of a walker whom the look-up does not know, at any yaw."""
    rng = np.random.default_rng(seed)
    pose = WALK.poses[rng.integers(len(WALK))].copy()
    pose[0] = rng.uniform(-np.pi, np.pi)
    return pose


def yaws_off(task: Task, observation: Observation, pose: Array) -> Array:
    """Return how far the yaws (modes,) of the modes of an observation are off, radians."""
    modes = modes_apart(BODY.skeleton, Lookup(task).posterior(observation))
    return np.abs([float(wrapped(mode.poses[0, :1] - pose[0])[0]) for _, mode in modes])


@each("seed", range(12))
def test_a_mode_faces_as_the_walker_does(seed: int) -> None:
    pose = turned(seed)
    cameras = [camera_at(0.4)]
    assert yaws_off(task_of(cameras), observed_by(cameras, pose), pose)[
        :3
    ].min() < np.radians(30.0)


@each("seed", range(6))
@each(
    ("elevation", "roll"),
    [(0.0, 0.0), (np.radians(25.0), 0.0), (0.0, np.radians(90.0))],
)
def test_two_cameras_of_any_attitude_decide(
    seed: int, elevation: float, roll: float
) -> None:
    pose = turned(seed)
    cameras = [
        camera_at(0.4, elevation, roll),
        camera_at(0.4 + np.pi / 2.0, elevation, roll),
    ]
    assert yaws_off(task_of(cameras), observed_by(cameras, pose), pose)[0] < np.radians(
        30.0
    )


def test_a_known_yaw_leaves_out_the_others() -> None:
    cameras = [camera_at(0.0)]
    for yaw in (-2.0, 0.3, 1.5):
        posterior = Lookup(task_of(cameras, yaw)).posterior(
            observed_by(cameras, turned(0))
        )
        assert (
            posterior is None
            or np.abs(wrapped(posterior.poses[:, 0] - yaw)).max()
            < np.radians(50.0) + SAME_TURN
        )


def test_a_silhouette_like_none_of_the_clips_is_refused() -> None:
    cameras, rows, columns = [camera_at(0.0)], *np.mgrid[:160, :160]
    dog = (np.abs(rows - 80) < 12) & (np.abs(columns - 80) < 50)
    dog |= (np.abs(rows - 100) < 20) & (
        (np.abs(columns - 40) < 5) | (np.abs(columns - 115) < 5)
    )
    lying = turned(0).copy()
    lying[1] = np.pi / 2.0
    for observation in (Observation([Silhouette.of(dog)]), observed_by(cameras, lying)):
        assert Lookup(task_of(cameras)).posterior(observation) is None


def test_a_silhouette_that_is_cut_is_refused() -> None:
    camera = replace(camera_at(0.0), centre=np.array([80.0, 150.0]))
    observation = observed_by([camera], turned(0))
    assert observation.silhouettes[0].mask[-1].any()
    assert Lookup(task_of([camera])).posterior(observation) is None


def test_comparisons_are_the_square_root_of_the_budget() -> None:
    # of pictures below 32 pixels the small one is the full one
    straight = looking_at(0.4, 0.0)
    camera = Camera(
        30,
        30,
        np.full(2, 37.5),
        np.full(2, 15.0),
        straight.rotation,
        straight.translation,
    )
    observation = observed_by([camera], turned(3))
    for evaluations, compared in ((1, 1), (99, 9), (100, 10)):
        task = replace(task_of([camera]), evaluations=evaluations)
        posterior = Lookup(task).posterior(observation)
        assert posterior is not None
        assert len(posterior.poses) == compared


@each("optimiser", ["sapso", "cma"])
def test_a_search_that_looks_faces_the_right_way(optimiser: str) -> None:
    pose = turned(3)
    cameras = [camera_at(0.4), camera_at(2.0)]
    masks = [mask.mask[None] for mask in observed_by(cameras, pose).silhouettes]
    options = {
        "train": TRAINING,
        "evaluations": 840,
        "height": BODY.stature,
        "camera": cameras,
    }
    fitted = posefit.fit(masks, method=f"{optimiser}@pca", **options)
    assert abs(wrapped(fitted.pose[:1] - pose[:1])[0]) < np.radians(30.0)


def test_one_image_leaves_open_where_the_searches_of_its_modes_end_and_a_film_does_not() -> (
    None
):
    camera = camera_at(0.0)
    masks = np.array(
        [observed_by([camera], turned(k)).silhouettes[0].mask for k in (3, 4)]
    )
    options = {
        "train": TRAINING,
        "evaluations": 400,
        "height": BODY.stature,
        "camera": camera,
        "method": "sapso@pca",
    }
    fitted = posefit.fit(masks[0], **options)
    modes = fitted.frame.modes
    assert sum(mode.weight for mode in modes) == pytest.approx(1.0)
    assert modes[0].weight == max(mode.weight for mode in modes)
    assert fitted.summary["modes"] == [round(mode.weight, 6) for mode in modes]
    assert not any(
        frame.modes for frame in posefit.track(masks, body_frames=0, **options).frames
    )
