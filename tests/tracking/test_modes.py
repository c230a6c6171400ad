"""Any optimiser tells what silhouettes leave open, in one frame and in every frame that it follows."""

from functools import partial
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.fitting.problem import PoseProblem
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.symmetry import facing, reflected_poses
from posefit.motion import built_in
from posefit.registry import registry
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit.testing.problem import pose_problem, walking_angles
from posefit.tracking.modes import modes
from posefit.uncertainty.modes import Posterior, modes_of
from tests.cases import each

FEW = {"evaluations": 400, "population_size": 40, "size": (160, 120)}


def side_view(frame: int = 0) -> tuple[PoseProblem, Any, Any]:
    """A stride seen from its side, with the true pose and the one whose legs are the other way round."""
    motion = built_in.motion("walk", frames=frame + 1)
    body, place = Body.of(motion.skeleton), motion.translations[frame]
    camera = Camera.around(place, np.pi / 2.0, 3.5, (160, 120))
    mask = project(body, camera, motion.poses[frame], place)
    prior = registry().prior("pca")().fit(walking_angles())
    space = posefit.SearchSpace(prior, np.zeros(3), np.radians([45.0, 15.0, 15.0]), place)
    other = reflected_poses(motion.skeleton, motion.poses[frame:], facing(camera, place))
    return PoseProblem(body, [camera], [Silhouette.of(mask)], space), motion.poses[frame], other[0]


@each("name", ["sapso", "cma", "annealed", "scipy:differential_evolution"])
def test_a_planted_flip_is_found_by_any_optimiser(name: str) -> None:
    problem, truth, other = side_view()
    skeleton = problem.body.skeleton
    posterior = modes(problem, registry().optimiser(name), searches=8, evaluations=2440, rng=np.random.default_rng(0))
    assert posterior.poses.shape == (100, 66)
    np.testing.assert_allclose(posterior.weights, 0.01)
    assert sum(mode.weight for mode in modes_of(skeleton, posterior)) == pytest.approx(1.0)

    assert 0.1 < other_side(problem, posterior, truth, other) < 0.9


def other_side(problem: PoseProblem, posterior: Posterior, truth: Any, other: Any) -> float:
    """Return the weight of the poses that are nearer to the other one than to the truth."""
    joints = problem.body.skeleton.joints(np.concatenate([truth[None], other[None], posterior.poses]))
    joints -= joints[:, :1]
    off = [np.linalg.norm(joints[2:] - one, axis=-1).mean(axis=-1) for one in joints[:2]]
    return float(posterior.weights @ (off[1] < off[0]))


@each("given", [{}, {"searches": 1, "share": 0.2}])
def test_planted_flips_are_found_in_nine_of_ten_frames(given: dict[str, Any]) -> None:
    shares = []
    for frame in range(0, 40, 4):
        problem, truth, other = side_view(frame)
        tell = partial(modes, problem, registry().optimiser("sapso"), evaluations=2440, **given)
        shares.append(other_side(problem, tell(rng=np.random.default_rng(frame)), truth, other))
    assert np.mean([0.1 <= share <= 0.9 for share in shares]) >= 0.9, shares


@each(("temperature", "off"), [(2.0, 0.15), (1.0, 0.25)])
def test_the_weight_of_a_flip_varies_little_between_seeds(temperature: float, off: float) -> None:
    varied = []
    for frame in (0, 12, 24, 36):
        problem, truth, other = side_view(frame)
        tell = partial(modes, problem, registry().optimiser("sapso"), evaluations=2440, temperature=temperature)
        shares = [other_side(problem, tell(rng=np.random.default_rng(seed)), truth, other) for seed in range(5)]
        varied.append(np.abs(np.array(shares) - np.mean(shares)).mean())
    assert np.mean(varied) < off, varied


def test_the_same_generator_tells_the_same() -> None:
    tell = partial(modes, pose_problem(), registry().optimiser("sapso"), searches=2, evaluations=400)
    first, second = (tell(rng=np.random.default_rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first.poses, second.poses)
    assert not np.array_equal(first.poses, tell(rng=np.random.default_rng(4)).poses)


def test_numbers_that_make_no_sense_are_refused() -> None:
    for given, said in [
        ({"searches": 0}, "searches must be at least 1, got 0"),
        ({"evaluations": 0}, "evaluations must be at least 1, got 0"),
        ({"share": 0.0}, "share must be above 0, got 0.0"),
        ({"temperature": 0.0}, "temperature must be above 0, got 0.0"),
    ]:
        settings = {"evaluations": 400, "rng": np.random.default_rng(0), **given}
        with pytest.raises(ValueError, match=said):
            modes(pose_problem(), registry().optimiser("sapso"), **settings)


def test_a_wrong_setting_of_the_tracker_is_one_clear_error() -> None:
    for given, said in [
        ({"modes": -1}, "modes must be 0 or more, got -1"),
        ({"modes": 2.5}, "tracker.modes must be int, got 2.5"),
        ({"modes": 1, "modes_share": 0.0}, "modes_share must be above 0, got 0.0"),
        ({"modes": 1, "posterior_temperature": -1.0}, "posterior_temperature must be above 0, got -1.0"),
    ]:
        with pytest.raises(ValueError, match=said):
            posefit.track(
                "walk", frames=(0, 1), settings={f"tracker.{name}": value for name, value in given.items()}, **FEW
            )


@each(("share", "searches"), [(0.2, 0), (0.5, 1), (2.0, 3)])
def test_all_that_modes_take_is_within_their_share(share: float, searches: int) -> None:
    begun = []

    def counted(space: posefit.Space, rng: np.random.Generator) -> posefit.Optimiser:
        begun.append(space)
        made: posefit.Optimiser = registry().optimiser("sapso")(space, rng)
        return made

    settings = {"tracker.modes": 4, "tracker.modes_share": share}
    given = {**FEW, "evaluations": 2000}
    track = posefit.track("walk", optimiser=counted, frames=(0, 2), settings=settings, **given)
    count = len(begun)
    posefit.track("walk", optimiser=counted, frames=(0, 2), **given)
    # of the two frames; those that would have less than 200 evaluations are not begun
    assert count - (len(begun) - count) == 2 * searches
    for frame in track.estimates:
        assert 1.05 * 2000 < frame.evaluations <= (1.0 + share) * 2000


@each("optimiser", ["sapso", "annealed", "particle"])
@each("searches", [1, 3])
def test_a_track_is_the_same_with_modes_and_without(optimiser: str, searches: int) -> None:
    given = {"method": optimiser, "frames": (0, 3), **FEW}
    without = posefit.track("walk", **given)
    found = posefit.track("walk", settings={"tracker.modes": searches}, **given)
    np.testing.assert_array_equal(found.motion.poses, without.motion.poses)
    for frame, plain in zip(found.estimates, without.estimates, strict=True):
        assert plain.posterior is None
        assert frame.posterior is not None
        assert frame.cost == plain.cost
        own_particles = searches == 1 and optimiser != "sapso"
        assert (frame.evaluations == plain.evaluations) == own_particles
        # a posterior lies about the track: the mean of its joints is nearer than a stride
        joints = found.motion.skeleton.joints(np.concatenate([frame.pose[None], frame.posterior.poses]))
        joints -= joints[:, :1]
        assert np.linalg.norm(frame.posterior.weights @ (joints[1:] - joints[0]).reshape(-1, 81)) / 9.0 < 0.2


def test_a_frame_in_which_nothing_is_seen_has_no_posterior() -> None:
    masks = np.zeros((3, 120, 160), dtype=bool)
    masks[[0, 2], 30:100, 70:90] = True
    observations = [posefit.Observation([Silhouette.of(mask)], np.zeros(3), bool(mask.any())) for mask in masks]
    from posefit.fitting.tracker import Prediction, SynthesisTracker, Task
    from posefit.tracking.modes import WeighingTracker

    motion = built_in.motion("walk", frames=1)
    camera = Camera.around(np.zeros(3), 0.0, 3.5, (160, 120))
    task = Task(Body.of(motion.skeleton), [camera], 400, 0.0, np.zeros(3))
    prior = registry().prior("pca")().fit(walking_angles())
    inner = SynthesisTracker(task, prior, registry().optimiser("sapso"), prediction=Prediction(modes=1))
    frames = list(WeighingTracker(inner).track(observations, np.random.default_rng(0)))
    assert [frame.posterior is None for frame in frames] == [False, True, False]
    assert frames[1].evaluations == 0
