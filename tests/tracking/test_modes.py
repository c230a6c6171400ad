"""The modes that any optimiser reports of one frame and of every frame that it tracks, and which frames are lost."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.fitting.prior import Tilt
from posefit.fitting.problem import PoseProblem
from posefit.fitting.tracker import Prediction, Task
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import joint_distances
from posefit.geometry.symmetry import facing, reflected_poses
from posefit.motion import built_in
from posefit.registry import registry
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.testing.problem import pose_problem, walking_angles
from posefit.tracking.modes import (
    EVEN_COST,
    LOST_STEEPNESS,
    WeighingTracker,
    lost_probability,
    modes,
    proposals_of,
    symmetric_proposals,
)
from posefit.uncertainty.modes import Posterior, modes_of
from tests.cases import each

FEW = {"evaluations": 400, "population_size": 40, "size": (160, 120)}


def side_view(frame: int = 0) -> tuple[PoseProblem, Array, Array]:
    """Return a stride seen from its side, with the true pose and the one whose legs are the other way round."""
    motion = built_in.motion("walk", frames=frame + 1)
    body, place = Body.of(motion.skeleton), motion.translations[frame]
    camera = Camera.around(place, np.pi / 2.0, 3.5, (160, 120))
    mask = project(body, camera, motion.poses[frame], place)
    prior = registry().prior("pca")().fit(walking_angles())
    space = posefit.SearchSpace(prior, np.zeros(3), np.radians([45.0, 15.0, 15.0]), place)
    other = reflected_poses(motion.skeleton, motion.poses[frame:], facing(camera, place))
    return PoseProblem(body, [camera], [Silhouette.of(mask)], space), motion.poses[frame], other[0]


def modes_by(optimiser: str, problem: PoseProblem, **options: Any) -> Callable[..., Posterior]:
    return partial(modes, problem, registry().optimiser(optimiser), **{"evaluations": 2440, **options})


def other_weight(problem: PoseProblem, posterior: Posterior, truth: Array, other: Array) -> float:
    """Return the weight of the poses that are nearer to the other one than to the truth."""
    skeleton = problem.body.skeleton
    joints = skeleton.joints(posterior.poses)
    off = [joint_distances(skeleton.joints(pose), joints).mean(axis=1) for pose in (truth, other)]
    return float(posterior.weights @ (off[1] < off[0]))


@each("optimiser", ["sapso", "cma", "annealed", "scipy:differential_evolution"])
def test_any_optimiser_reports_a_planted_flip(optimiser: str) -> None:
    problem, truth, other = side_view()
    posterior = modes_by(optimiser, problem, searches=8)(rng=np.random.default_rng(0))
    assert posterior.poses.shape == (100, 66)
    np.testing.assert_allclose(posterior.weights, 0.01)
    assert sum(mode.weight for mode in modes_of(problem.body.skeleton, posterior)) == pytest.approx(1.0)
    assert 0.1 < other_weight(problem, posterior, truth, other) < 0.9


def test_numbers_that_make_no_sense_are_refused() -> None:
    for options, message in [
        ({"searches": 0}, "searches must be at least 1, got 0"),
        ({"evaluations": 0}, "evaluations must be at least 1, got 0"),
        ({"share": 0.0}, "share must be above 0, got 0.0"),
        ({"temperature": 0.0}, "temperature must be above 0, got 0.0"),
    ]:
        with pytest.raises(ValueError, match=message):
            modes_by("sapso", pose_problem(), **options)(rng=np.random.default_rng(0))
    for settings, message in [
        ({"tracker.modes": -1}, "modes must be 0 or more, got -1"),
        ({"tracker.modes": 2.5}, "tracker.modes must be int, got 2.5"),
        ({"tracker.modes": 1, "tracker.modes_share": 0.0}, "modes_share must be above 0, got 0.0"),
        ({"tracker.modes": 1, "tracker.posterior_temperature": -1.0}, "posterior_temperature must be above 0, got -1"),
    ]:
        with pytest.raises(ValueError, match=message):
            posefit.track("walk", frames=(0, 1), settings=settings, **FEW)


@each(("share", "searches"), [(0.2, 0), (0.5, 1), (2.0, 3)])
def test_all_that_modes_take_is_within_their_share(share: float, searches: int) -> None:
    spaces = []

    def counted(space: posefit.Space, rng: np.random.Generator) -> posefit.Optimiser:
        spaces.append(space)
        made: posefit.Optimiser = registry().optimiser("sapso")(space, rng)
        return made

    options = {**FEW, "evaluations": 2000, "optimiser": counted, "frames": (0, 2)}
    track = posefit.track("walk", settings={"tracker.modes": 4, "tracker.modes_share": share}, **options)
    with_modes = len(spaces)
    posefit.track("walk", **options)
    # of the two frames; searches that would have less than 200 evaluations are not begun
    assert with_modes - (len(spaces) - with_modes) == 2 * searches
    for frame in track.estimates:
        assert 1.05 * 2000 < frame.evaluations <= (1.0 + share) * 2000


@each(
    ("optimiser", "searches"),
    [(name, searches) for name in ("sapso", "annealed", "particle") for searches in (1, 3)],
)
def test_a_track_is_the_same_with_modes_and_without(optimiser: str, searches: int) -> None:
    options = {"method": optimiser, "frames": (0, 3), **FEW}
    without = posefit.track("walk", **options)
    track = posefit.track("walk", settings={"tracker.modes": searches}, **options)
    np.testing.assert_array_equal(track.motion.poses, without.motion.poses)
    assert [row["lost"] for row in track.frames] == pytest.approx([frame.lost for frame in track.estimates])
    for frame, plain in zip(track.estimates, without.estimates, strict=True):
        assert plain.posterior is plain.lost is None
        assert frame.posterior is not None
        assert frame.lost == pytest.approx(float(lost_probability(np.array(frame.cost))))
        assert frame.cost == plain.cost
        own_particles = searches == 1 and optimiser != "sapso"
        assert (frame.evaluations == plain.evaluations) == own_particles


def test_a_frame_of_an_empty_mask_has_no_posterior() -> None:
    masks = np.zeros((3, 120, 160), dtype=bool)
    masks[[0, 2], 30:100, 70:90] = True
    observations = [posefit.Observation([Silhouette.of(mask)], np.zeros(3), bool(mask.any())) for mask in masks]
    camera = Camera.around(np.zeros(3), 0.0, 3.5, (160, 120))
    task = Task(Body.of(built_in.motion("walk", frames=1).skeleton), [camera], 400, 0.0, np.zeros(3))
    prior = registry().prior("pca")().fit(walking_angles())
    tracker = WeighingTracker(task, prior, registry().optimiser("sapso"), prediction=Prediction(modes=1))
    frames = list(tracker.track(observations, np.random.default_rng(0)))
    assert [frame.posterior is None for frame in frames] == [False, True, False]
    assert frames[1].evaluations == 0


def test_the_probability_to_be_lost_rises_with_the_cost() -> None:
    assert lost_probability(np.array(EVEN_COST)) == pytest.approx(0.5)
    probabilities = lost_probability(np.linspace(0.0, 100.0, 200))
    assert ((probabilities >= 0.0) & (probabilities <= 1.0)).all()
    assert (np.diff(probabilities) >= 0.0).all()
    # by hand: log-odds of twice the even cost are the steepness times ln 2
    twice = lost_probability(np.array(2.0 * EVEN_COST))
    assert np.log(twice / (1.0 - twice)) == pytest.approx(LOST_STEEPNESS * np.log(2.0))


def test_proposals_of_decoded_poses_are_those_that_were_decoded() -> None:
    space = pose_problem().space
    motions = [built_in.motion(name) for name in built_in.other_styles("walk")]
    tilt = Tilt.of(space.prior, motions, 0.99, 0.1)
    for each_space in (space, replace(space, translation="searched"), replace(space, tilt=tilt)):
        proposals = 0.9 * np.random.default_rng(0).uniform(-1.0, 1.0, (5, each_space.dimensions))
        np.testing.assert_allclose(proposals_of(each_space, *each_space.decode(proposals)), proposals, atol=1e-9)


def test_in_a_box_of_all_yaws_bodies_are_turned_and_reflected() -> None:
    problem, truth, _ = side_view()
    space = replace(problem.space, root_range=np.array([np.pi, 0.3, 0.3]))
    towards = facing(problem.cameras[0], space.anchor)
    yaw = towards + 0.3
    proposal = proposals_of(space, np.concatenate([[yaw], truth[1:]])[None], space.anchor[None])[0]
    yaws = space.coordinates(symmetric_proposals(replace(problem, space=space), proposal))[:, 0]
    # a person who comes, turned by 0.3 to one side, goes by as much to the same side; or has turned round
    expected = np.array([2.0 * towards + np.pi - yaw, yaw + np.pi])
    np.testing.assert_allclose(np.cos(yaws - expected), 1.0, atol=1e-9)
