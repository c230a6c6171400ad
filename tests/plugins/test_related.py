"""The related work as plugins: rules of their kinds, a few frames of a made walk, masks without a known place."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import posefit
from posefit import Silhouette
from posefit.plugin import (
    Observation,
    check_optimiser,
    check_prior,
    check_tracker,
    contour_fit,
)
from posefit.registry import registry
from posefit.testing.tracker_rules import scene
from posefit_related.frames import costs_of, frame_of, place_of
from posefit_related.isomap import IsomapPrior
from tests.cases import each

METHODS = [
    "hpso@pca",
    "haga@pca",
    "psopf@pca",
    "local@pca",
    "sapso@isomap",
    "sapso@gplvm",
]
TRACKERS = ["smoothing", "gradient", "regression"]


@pytest.mark.slow
@each(
    "kind, name",
    [
        *(("optimiser", name) for name in ("hpso", "haga", "psopf", "local")),
        *(("prior", name) for name in ("isomap", "gplvm")),
        *(("tracker", name) for name in TRACKERS),
    ],
)
def test_each_follows_the_rules_of_its_kind(kind: str, name: str) -> None:
    offer = registry().offer(kind, name)
    report = {
        "optimiser": partial(check_optimiser, next_frame=offer.next_frame),
        "prior": check_prior,
        "tracker": partial(check_tracker, looks_ahead=offer.looks_ahead),
    }[kind](offer.factory)
    assert report, str(report)


@each("method", [*METHODS, *TRACKERS])
def test_a_walk_is_followed_better_than_by_its_mean_pose(method: str) -> None:
    seeds = range(1 if method == "regression" else 5)
    how = {"frames": (0, 4), "evaluations": 800}
    tracks = [posefit.track("walk", method=method, seed=seed, **how) for seed in seeds]
    errors = [track.summary["error_degrees"]["mean"] for track in tracks]
    assert np.median(errors) < tracks[0].summary["baselines_degrees"]["mean_pose"]


@each("method", TRACKERS)
def test_a_place_that_is_not_known_is_found_in_the_masks(method: str) -> None:
    how = {
        "settings": {"regression.samples": 300} if method == "regression" else {},
        "translation": "aligned",
    }
    track = posefit.track("walk", method=method, frames=(0, 4), evaluations=800, **how)
    assert track.summary["iou"] > 0.3
    assert np.isfinite(track.motion.translations).all()


def test_without_training_there_is_reported_in_one_line() -> None:
    task = replace(scene()[0], training=())
    for name in TRACKERS:
        with pytest.raises(ValueError, match="training must contain a motion"):
            list(
                registry()
                .offer("tracker", name)
                .factory(task)
                .track(scene()[2], np.random.default_rng(0))
            )
    for name in ("isomap", "gplvm"):
        with pytest.raises(ValueError, match="angles must contain at least"):
            registry().offer("prior", name).factory().fit(np.zeros((3, 63)))


def test_a_pose_is_moved_to_the_contours_of_its_masks() -> None:
    task, motion, observations = scene()
    free = np.flatnonzero(task.body.skeleton.free)
    pose = motion.poses[0].copy()
    pose[free] += np.radians(4.0) * np.random.default_rng(0).standard_normal(len(free))
    after, place, used = contour_fit(
        task, observations[0], (pose, motion.translations[0]), (0.1, 0.003), 400
    )

    def error(angles: Any) -> float:
        joints = task.body.skeleton.joints(angles[None], motion.translations[:1])
        return float(np.linalg.norm(joints - motion.joints[:1], axis=-1).mean())

    assert error(after) < error(pose)
    assert used == 12 * 27  # never more than twelve steps
    assert (
        contour_fit(task, observations[0], (pose, place), (0.1, 0.003), 60)[2] == 2 * 27
    )


def test_a_camera_that_knows_nothing_does_not_count() -> None:
    task, _, (observation, *_) = scene()
    nothing = Silhouette.of(
        *np.zeros((2, task.cameras[0].height, task.cameras[0].width), dtype=bool)
    )
    blind = replace(observation, silhouettes=[observation.silhouettes[0], nothing])
    pose = task.training[0].poses[:1]
    place = task.anchor[None]
    costs = []
    for cameras, views in (
        (1, replace(observation, silhouettes=observation.silhouettes[:1])),
        (2, blind),
    ):
        part = replace(task, cameras=[task.cameras[0]] * cameras)
        costs += [
            costs_of(part, views, pose, place)[0],
            frame_of(part, views, pose[0], place[0], 0).cost,
        ]
    assert len(set(costs)) == 1


def test_a_mask_gives_the_position_of_the_root() -> None:
    task, motion, (observation, *_) = scene()
    pose = motion.poses[0]
    place = motion.translations[0]
    # known
    assert place_of(task, observation, pose, np.zeros(3))[0] == pytest.approx(place)
    unknown = Observation(observation.silhouettes)
    moved, drawn = place_of(task, unknown, pose, place + [0.1, 0.05, 0.2])
    assert np.linalg.norm(moved - place) < 0.08  # a pixel of 120 rows is 3 cm
    assert drawn == 1


def test_a_latent_is_feasible_within_reach_of_the_nearest_training_pose() -> None:
    prior = IsomapPrior()
    prior.centres = np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]])
    prior.reach = 2.0
    # distances by hand: 1.1 sqrt(3) = 1.905, 1.2 sqrt(3) = 2.078, on both sides
    for latent, near in (
        ([1.1, 1.1, 1.1], True),
        ([-1.1, -1.1, -1.1], True),
        ([1.2, 1.2, 1.2], False),
        ([-1.2, -1.2, -1.2], False),
        ([2.0, 0.0, 0.0], True),
        ([5.0, 0.0, 0.0], False),
        ([8.5, 0.0, 0.0], True),
        ([11.2, -1.2, 1.2], False),
    ):
        assert prior.feasible(np.array([latent])).tolist() == [near], latent
