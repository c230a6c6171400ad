"""Ways that are drawn from the posterior: whether their ranks are those of the truth, and what frames say of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit_exemplars.beam import Beam, Steps, Transition, transition_costs
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.factory import exemplars
from posefit_exemplars.window import FrameStates, SampledPaths, Sampler, frame_states
from tests.cases import cases
from tests.exemplars.conftest import Walk

FRAMES, WAYS, PROBLEMS, NOISE = 6, 9, 600, 0.1  # metres
QUICK = {"refiner": "none", "smoothing": 0.0}


def everywhere(clips: Exemplars) -> tuple[Beam, Array]:
    """Return all poses as the states of a frame, and what steps between them cost."""
    many = len(clips)
    beam = Beam(np.arange(many), np.zeros(many), np.full(many, -1), np.zeros(many), np.zeros((many, 3)))
    steps = Steps(0.1, np.radians(20.0), 6.0, 0.01, 0.03, 0.008)
    return beam, transition_costs(Transition(clips, beam, beam, 1 / 30, np.zeros(3), None), steps=steps)


def drawn_from_the_prior(steps: Array, rng: np.random.Generator) -> list[int]:
    """Return the states of a way that is as likely as its steps are, all of its weights worked out at once."""
    kernel, weights = np.exp(-steps), [np.ones(len(steps))]
    for _ in range(FRAMES - 1):
        weights.append(kernel @ weights[-1])
    way: list[int] = []
    for k in range(FRAMES):
        likely = weights[FRAMES - 1 - k] * (kernel[way[-1]] if way else 1.0)
        way.append(int(rng.choice(len(steps), p=likely / likely.sum())))
    return way


def ranks(clips: Exemplars, power: float) -> Array:
    """Return where the truth stands among the ways that are drawn (problems, 4), by four figures of a way.

    Three are where the body goes, the fourth is how well that fits what was filmed: without one that knows of it, ways
    drawn from the prior would pass (Modrák et al. 2023).
    """
    beam, steps = everywhere(clips)
    rng = np.random.default_rng(17)
    found = np.empty((PROBLEMS, 4), dtype=np.int64)
    directions = rng.normal(size=(3, FRAMES, clips.codes.shape[1]))
    for number in range(PROBLEMS):
        true = drawn_from_the_prior(steps, rng)
        filmed = clips.codes[true] + NOISE * rng.normal(size=(FRAMES, clips.codes.shape[1]))
        frames: list[FrameStates] = []
        for k in range(FRAMES):
            fits = 0.5 * ((clips.codes - filmed[k]) ** 2).sum(axis=1) / NOISE**2
            frames.append(frame_states(beam, fits, frames[-1] if k else None, steps if k else None))
        sampler = Sampler(clips, WAYS, power, rng)
        each = []
        for k in range(FRAMES):
            ways = sampler.drawn(frames[k:], 0)
            assert ways is not None
            each.append(clips.coding.coded(ways.poses))
        codes = np.array([*np.swapaxes(each, 0, 1), clips.codes[true]])  # the truth is the last
        fit = ((codes - filmed) ** 2).sum(axis=(1, 2))
        figures = np.column_stack([np.einsum("ftd,ktd->kf", directions, codes), fit]).round(4)
        figures = figures + 1e-6 * rng.random(figures.shape)  # of ways that are the same any may be the first
        found[number] = (figures[:-1] < figures[-1]).sum(axis=0)
    return found


def p_values(found: Array) -> list[float]:
    return [float(stats.chisquare(np.bincount(column, minlength=WAYS + 1)).pvalue) for column in found.T]


@pytest.fixture(scope="module")
def few() -> Exemplars:
    return Exemplars.of([built_in.motion(name, frames=12) for name in ("walk-a", "run-a")], average_skeleton())


def test_the_truth_is_as_likely_to_have_any_rank_among_the_ways(few: Exemplars) -> None:
    # simulation-based calibration, Talts et al. 2018: drawn from the prior, the truth is one more draw
    assert min(p_values(ranks(few, 1.0))) > 0.01


def test_a_posterior_that_is_too_sure_or_not_sure_enough_does_not_pass(few: Exemplars) -> None:
    assert min(p_values(ranks(few, 4.0))) < 1e-4
    assert min(p_values(ranks(few, 0.1))) < 1e-4


def test_ways_that_are_like_the_path_are_moved_to_what_was_told_and_others_stay() -> None:
    poses, places = np.zeros((3, 66)), np.arange(9.0).reshape(3, 3)
    poses[:, 0] = [0.1, 0.3, 3.0]
    pose, place = np.full(66, 0.5), np.array([1.0, 1.0, 1.0])
    found = SampledPaths(poses, places, np.array([True, True, False])).about(pose, place)
    np.testing.assert_allclose(found.poses[:2].mean(axis=0), pose)
    assert found.poses[1, 0] - found.poses[0, 0] == pytest.approx(0.2)
    np.testing.assert_allclose(found.translations[:2], [[-0.5, -0.5, -0.5], [2.5, 2.5, 2.5]])
    np.testing.assert_array_equal(found.poses[2], poses[2])
    np.testing.assert_array_equal(found.translations[2], places[2])
    assert found.coherent


def test_where_no_way_is_like_the_path_all_stay() -> None:
    poses, places = np.ones((2, 66)), np.zeros((2, 3))
    found = SampledPaths(poses, places, np.zeros(2, dtype=bool)).about(np.zeros(66), np.ones(3))
    np.testing.assert_array_equal(found.poses, poses)


def test_what_is_told_is_the_same_however_many_ways_are_drawn(walker: Walk) -> None:
    told = [
        list(exemplars(walker.told(), samples=samples).track(walker.seen[:10], np.random.default_rng(3)))
        for samples in (0, 5)
    ]
    for none, some in zip(*told, strict=True):
        np.testing.assert_array_equal(none.pose, some.pose)
        assert none.posterior is None
        assert some.posterior is not None
        assert len(some.posterior) == 5
        assert some.posterior.coherent


def test_the_greater_the_posteriors_temperature_the_more_its_ways_differ(walker: Walk) -> None:
    def spread(temperature: float) -> float:
        tracker = exemplars(walker.told(), samples=40, posterior_temperature=temperature, **QUICK)
        frames = list(tracker.track(walker.seen[:8], np.random.default_rng(0)))
        return float(np.mean([one.posterior.poses.std(axis=0).mean() for one in frames if one.posterior is not None]))

    assert spread(0.5) < spread(4.0) < spread(32.0)


def test_ways_go_on_as_clips_do(walker: Walk) -> None:
    """One and the same way in all frames: its yaw turns no more than a body can."""
    tracker = exemplars(walker.told(), samples=12, **QUICK)
    frames = list(tracker.track(walker.seen, np.random.default_rng(0)))
    yaws = np.array([one.posterior.poses[:, 0] for one in frames if one.posterior is not None])
    turns = np.abs(wrapped(np.diff(yaws, axis=0)))
    assert np.median(turns) < np.radians(5.0)
    assert float(np.mean(turns > np.radians(30.0))) < 0.05


def test_ways_are_drawn_through_frames_that_show_nothing(walker: Walk) -> None:
    frames = [replace(one, usable=k not in (3, 4)) for k, one in enumerate(walker.seen[:8])]
    found = list(exemplars(walker.told(), **QUICK).track(frames, np.random.default_rng(0)))
    assert all(one.posterior is not None and len(one.posterior) == 24 for one in found)


def test_settings_that_cannot_be_are_estimated(walker: Walk) -> None:
    for name, value in cases([("samples", -1), ("posterior_temperature", 0.0)]):
        expected = "0 or more" if name == "samples" else "above 0 and finite"
        with pytest.raises(ValueError, match=f"{name} must be {expected}, got {value}"):
            exemplars(walker.told(), **{name: value})  # type: ignore[arg-type]
