"""Paths that are drawn from the posterior: the ranks of the truth among them, and what frames report."""

from typing import Any

import numpy as np
import pytest
from scipy import stats

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.geometry.rotation import wrapped
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit_exemplars.beam import Beam, Steps, Transition, transition_costs
from posefit_exemplars.exemplars import Exemplars
from posefit_exemplars.window import FrameStates, Sampler, frame_states
from tests.exemplars.conftest import Walk

FRAMES, PATHS, PROBLEMS, NOISE = 6, 9, 600, 0.1  # metres
QUICK: dict[str, Any] = {"refiner": "none", "smoothing": 0.0}


def everywhere(clips: Exemplars) -> tuple[Beam, Array]:
    """Return all poses as the states of a frame, and what steps between them cost."""
    many = len(clips)
    beam = Beam(np.arange(many), np.zeros(many), np.full(many, -1), np.zeros(many), np.zeros((many, 3)))
    steps = Steps(0.1, np.radians(20.0), 6.0, 0.01, 0.03, 0.008)
    return beam, transition_costs(Transition(clips, beam, beam, 1 / 30, np.zeros(3), None), steps=steps)


def prior_path(steps: Array, rng: np.random.Generator) -> list[int]:
    """Return the states of a path drawn by the costs of its steps alone, with backward messages."""
    kernel, weights = np.exp(-steps), [np.ones(len(steps))]
    for _ in range(FRAMES - 1):
        weights.append(kernel @ weights[-1])
    path: list[int] = []
    for k in range(FRAMES):
        likely = weights[FRAMES - 1 - k] * (kernel[path[-1]] if path else 1.0)
        path.append(int(rng.choice(len(steps), p=likely / likely.sum())))
    return path


def ranks_of(clips: Exemplars, power: float) -> Array:
    """Return the ranks of the truth among sampled paths (problems, 4), by four figures of a path.

    Three are where the body goes, the fourth is how well that fits the observations: without it, paths drawn from the
    prior would pass (Modrák et al. 2023).
    """
    beam, steps = everywhere(clips)
    rng = np.random.default_rng(17)
    ranks = np.empty((PROBLEMS, 4), dtype=np.int64)
    directions = rng.normal(size=(3, FRAMES, clips.codes.shape[1]))
    for number in range(PROBLEMS):
        true = prior_path(steps, rng)
        observed = clips.codes[true] + NOISE * rng.normal(size=(FRAMES, clips.codes.shape[1]))
        frames: list[FrameStates] = []
        for k in range(FRAMES):
            fits = 0.5 * ((clips.codes - observed[k]) ** 2).sum(axis=1) / NOISE**2
            frames.append(frame_states(beam, fits, frames[-1] if k else None, steps if k else None))
        sampler = Sampler(clips, PATHS, power, rng)
        sampled = []
        for k in range(FRAMES):
            paths = sampler.draw(frames[k:], 0)
            assert paths is not None
            sampled.append(clips.coding.coded(paths.poses))
        codes = np.array([*np.swapaxes(sampled, 0, 1), clips.codes[true]])  # the truth is the last
        fit = ((codes - observed) ** 2).sum(axis=(1, 2))
        figures = np.column_stack([np.einsum("ftd,ktd->kf", directions, codes), fit]).round(4)
        figures = figures + 1e-6 * rng.random(figures.shape)  # of equal paths any may be the first
        ranks[number] = (figures[:-1] < figures[-1]).sum(axis=0)
    return ranks


def p_values(ranks: Array) -> list[float]:
    return [float(stats.chisquare(np.bincount(column, minlength=PATHS + 1)).pvalue) for column in ranks.T]


@pytest.fixture(scope="module")
def few() -> Exemplars:
    return Exemplars.of([built_in.motion(name, frames=12) for name in ("walk-a", "run-a")], average_skeleton())


def test_the_truth_has_any_rank_among_the_paths_with_the_same_probability(few: Exemplars) -> None:
    # simulation-based calibration, Talts et al. 2018: drawn from the prior, the truth is one more draw
    assert min(p_values(ranks_of(few, 1.0))) > 0.01


def test_a_posterior_too_narrow_or_too_wide_fails(few: Exemplars) -> None:
    assert min(p_values(ranks_of(few, 4.0))) < 1e-4
    assert min(p_values(ranks_of(few, 0.1))) < 1e-4


def test_reported_poses_do_not_depend_on_the_number_of_samples(walker: Walk) -> None:
    plain, sampled = (walker.track(0, 10, seed=3, samples=samples) for samples in (0, 5))
    for none, some in zip(plain, sampled, strict=True):
        np.testing.assert_array_equal(none.pose, some.pose)
        assert none.posterior is None
        assert some.posterior is not None
        assert len(some.posterior) == 5
        assert some.posterior.coherent


def sampled_poses(frames: list[Frame]) -> Array:
    return np.array([frame.posterior.poses for frame in frames if frame.posterior is not None])


def test_a_greater_posterior_temperature_spreads_the_samples(walker: Walk) -> None:
    spreads = [
        sampled_poses(walker.track(0, 8, samples=40, posterior_temperature=temperature, **QUICK)).std(axis=1).mean()
        for temperature in (0.5, 4.0, 32.0)
    ]
    assert spreads == sorted(set(spreads))


def test_a_sampled_path_is_one_movement(walker: Walk) -> None:
    yaws = sampled_poses(walker.track(samples=12, **QUICK))[:, :, 0]
    turns = np.abs(wrapped(np.diff(yaws, axis=0)))
    assert np.median(turns) < np.radians(5.0)
    assert float(np.mean(turns > np.radians(30.0))) < 0.05
