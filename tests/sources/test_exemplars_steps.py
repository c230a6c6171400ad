"""Toyama and Blake 2001, Rabiner 1989, and Godsill et al. 2004: by hand, or against all ways through a small model."""

from collections import Counter
from itertools import combinations, pairwise, product
from typing import NamedTuple

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit_exemplars import markov
from posefit_exemplars.beam import Beam
from posefit_exemplars.cost_model import ClipSteps, Step
from posefit_exemplars.exemplars import Exemplars, farthest_first
from posefit_exemplars.markov import FrameStates, frame_states

SIZES = (3, 4, 2, 3, 4)  # states of each frame: 288 ways


class Model(NamedTuple):
    """Costs over the temperature of silhouettes (n,) and of steps (m, n), and the frames that came of them."""

    fits: list[Array]
    steps: list[Array]
    frames: list[FrameStates]


def model(seed: int) -> Model:
    rng = np.random.default_rng(seed)
    fits = [rng.uniform(0.0, 3.0, size) for size in SIZES]
    steps = [rng.uniform(0.0, 3.0, sizes) for sizes in pairwise(SIZES)]
    frames: list[FrameStates] = []
    for k, fit in enumerate(fits):
        frames.append(
            frame_states(fit, frames[-1] if k else None, steps[k - 1] if k else None)
        )
    return Model(fits, steps, frames)


def ways(model: Model, count: int) -> dict[tuple[int, ...], float]:
    """Return what every way through the first frames costs."""
    return {
        way: sum(float(model.fits[k][row]) for k, row in enumerate(way))
        + sum(float(model.steps[k][way[k], way[k + 1]]) for k in range(count - 1))
        for way in product(*(range(size) for size in SIZES[:count]))
    }


def shares(costs: dict[tuple[int, ...], float], frame: int) -> Array:
    """Return how likely each state of a frame is: the share of all ways that lead through it."""
    found = np.zeros(SIZES[frame])
    for way, cost in costs.items():
        found[way[frame]] += np.exp(-cost)
    return found / found.sum()


# RABINER1989 (forward)
def test_a_state_is_as_likely_as_all_paths_to_it_together() -> None:
    for seed in [0, 1, 2]:
        one = model(seed)
        for k, frame in enumerate(one.frames):
            np.testing.assert_allclose(
                frame.forward, shares(ways(one, k + 1), k), rtol=1e-5
            )


# RABINER1989 (backward)
def test_backward_weights_are_sums_over_all_paths_from_a_state() -> None:
    for seed in [0, 1, 2]:
        one = model(seed)
        for first, count in combinations(range(len(SIZES) + 1), 2):
            expected = shares(ways(one, count), first)
            np.testing.assert_allclose(
                markov.state_weights(one.frames[first:count]), expected, rtol=1e-5
            )


def test_the_reported_path_is_the_cheapest() -> None:  # RABINER1989 (Viterbi)
    for seed in [0, 1, 2]:
        one = model(seed)
        for count in range(1, len(SIZES) + 1):
            costs = ways(one, count)
            best = min(costs, key=lambda way: costs[way])
            assert [
                markov.viterbi_state([frame.paths for frame in one.frames[k:count]])
                for k in range(count)
            ] == list(best)
            each = [
                min(cost for way, cost in costs.items() if way[-1] == row)
                for row in range(SIZES[count - 1])
            ]
            np.testing.assert_allclose(
                one.frames[count - 1].paths.totals,
                np.array(each) - min(each),
                atol=1e-12,
            )


# TOYAMA2001 (exemplars)
def test_exemplars_are_poses_of_the_clips_that_lie_apart() -> None:
    # on a line: after 0 the farthest is 9, after both it is 4 (4 from 0, 5 from 9), then 6
    line = np.array([[0.0], [4.0], [1.0], [9.0], [6.0]], dtype=np.float32)
    assert line[farthest_first(line, 4)[0]].ravel().tolist() == [0.0, 9.0, 4.0, 6.0]
    rng = np.random.default_rng(0)
    codes = rng.normal(size=(200, 4)).astype(np.float32)
    centres, _ = farthest_first(codes, 12)
    for count in range(1, 12):  # the slow twin
        away = np.linalg.norm(codes[:, None] - codes[centres[:count]], axis=-1).min(
            axis=1
        )
        assert centres[count] == away.argmax()


# TOYAMA2001 (likelihood)
def test_likelihood_is_an_exponential_of_the_distance_over_a_temperature() -> None:
    # distances of 6, 6 + 2 ln 2 and 6 + 2 ln 4 over a temperature of 2: likelihoods as 4 : 2 : 1
    found = frame_states((6.0 + 2.0 * np.log([1.0, 2.0, 4.0])) / 2.0)
    np.testing.assert_allclose(found.likelihoods, [1.0, 0.5, 0.25])
    np.testing.assert_allclose(found.forward, [4 / 7, 2 / 7, 1 / 7])


# TOYAMA2001 (dynamics)
def test_a_step_is_as_likely_as_it_is_frequent_in_the_clips() -> None:
    # a clip of 30 frames a second: who does what it did next pays nothing, who is 3 cm off half a unit
    walk = built_in.motion("walk-a", frames=20)
    clips = Exemplars.of([walk], average_skeleton())
    after = int(clips.last_states[0])
    for state in range(after):
        seconds = float(clips.times[state + 1] - clips.times[state])
        yaws = clips.angles[[state, state + 1], 0].astype(float)
        before = Beam(np.array([state]), yaws[:1], np.zeros(1), clips.places[[state]])
        beams = Beam(
            np.array([state + 1, after]),
            np.repeat(yaws[1:], 2),
            np.zeros(2),
            np.zeros((2, 3)),
        )
        steps = ClipSteps.of(clips, before, Step(seconds, 0.03))
        following, last = steps.costs(clips, beams, aligned=False)[0]
        assert following == pytest.approx(0.0, abs=1e-4)
        off = float(((clips.codes[state + 1] - clips.codes[after]) ** 2).sum())
        assert last == pytest.approx(min(0.5 * off / 0.03**2, 12.0), abs=1e-3)


POWERS = (1.0, 0.4)


def tempered(one: Model, power: float) -> Model:
    """Return a model whose silhouettes cost so much less."""
    return one._replace(fits=[power * fit for fit in one.fits])


# GODSILL2004 (messages)
def test_a_message_is_the_share_of_all_paths_from_a_state() -> None:
    for power in POWERS:
        one = model(0)
        found = markov.backward_messages(one.frames[1:], power)
        expected = np.zeros(SIZES[1])
        for way, cost in ways(tempered(one, power), len(SIZES)).items():
            first = (
                power * one.fits[0][way[0]]
                + one.steps[0][way[0], way[1]]
                + power * one.fits[1][way[1]]
            )
            # what comes after; each of the ways before it counts once
            expected[way[1]] += np.exp(first - cost)
        np.testing.assert_allclose(
            found / found.sum(), expected / expected.sum(), rtol=1e-5
        )


def test_paths_are_sampled_as_often_as_they_are_likely() -> None:  # GODSILL2004 (step)
    for power in POWERS:
        one = model(1)
        count = 40_000
        rng = np.random.default_rng(0)
        rows = None
        drawn = []
        for k in range(len(SIZES)):
            rows = markov.sample_states(
                one.frames[k:], rows, markov.Sampling(count, power), rng
            )
            drawn.append(rows)
        costs = ways(tempered(one, power), len(SIZES))
        total = sum(np.exp(-cost) for cost in costs.values())
        came = Counter(zip(*(each.tolist() for each in drawn), strict=True))
        expected = {way: count * np.exp(-cost) / total for way, cost in costs.items()}
        chi = sum((came[way] - each) ** 2 / each for way, each in expected.items())
        # a sum of 287 squares: its mean is 287, its standard deviation the root of 574, 24
        assert abs(chi - (len(costs) - 1)) < 3 * 24
        assert sum(came.values()) == count
