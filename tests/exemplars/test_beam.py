"""Steps from the states of one frame to those of the next, against twins that compare every pair."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_exemplars.beam import Beam, diverse_best, yaw_bins
from posefit_exemplars.cost_model import (
    JUMP_COST,
    ClipSteps,
    Step,
    lines_of_sight,
    root_deviation_costs,
    squared_distances,
)
from posefit_exemplars.exemplars import (
    Exemplars,
    about_vertical,
)
from posefit_exemplars.proposals import candidate_turns, next_states

SECONDS = 1.0 / 30.0
STEP = Step(SECONDS, 0.03, np.radians(8.0))
MOST = 4000


def beam(
    states: list[int],
    yaws: list[float],
    totals: list[float] | None = None,
    places: Array | None = None,
) -> Beam:
    where = np.zeros((len(states), 3)) if places is None else places
    return Beam(
        np.array(states), np.array(yaws), np.array(totals or [0.0] * len(states)), where
    )


def costs_of_steps(exemplars: Exemplars, before: Beam) -> Array:
    """Return what a step from each state to each pose costs (n, K), pair by pair, without a turn."""
    costs = np.full((len(before), len(exemplars)), np.inf)
    for row, state in enumerate(before.states):
        code = exemplars.continuation(np.array([state]), SECONDS)[0][0]
        for pose in range(len(exemplars)):
            away = ((code - exemplars.codes[pose]) ** 2).sum()
            costs[row, pose] = away / (2.0 * STEP.pose**2)
    return costs


def test_next_states_are_those_of_the_slow_twin(small: Exemplars) -> None:
    places = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    before = beam([3, 11, 25], [0.1, 0.1, 2.0], [0.0, 2.5, 1.0], places)
    beams = next_states(small, ClipSteps.of(small, before, STEP), MOST)
    steps = costs_of_steps(small, before) + before.totals[:, None]
    codes, turned, ways = small.continuation(before.states, SECONDS)
    twin: dict[tuple[int, int], float] = {}
    for row in range(3):
        for state in range(len(small)):
            for turn in candidate_turns(STEP.turn):
                facing = np.array([before.yaws[row] + turned[row] + turn])
                key = state, int(yaw_bins(facing)[0])
                twin[key] = min(
                    twin.get(key, np.inf),
                    steps[row, state] + 0.5 * (turn / STEP.turn) ** 2,
                )
    keys = zip(beams.states.tolist(), yaw_bins(beams.yaws).tolist(), strict=True)
    totals = dict(zip(keys, beams.totals, strict=True))
    assert len(totals) == len(beams)
    for key, total in totals.items():
        assert total == pytest.approx(twin[key], rel=1e-4, abs=1e-3)
    assert min(totals.values()) == pytest.approx(min(twin.values()), abs=1e-3)
    highest = before.totals.min() + JUMP_COST + 0.5
    assert beams.totals.max() < highest
    for row in range(3):  # the next pose of each clip is among them
        assert (
            int(squared_distances(codes[row : row + 1], small.codes).argmin())
            in beams.states
        )
    expected = before.places + about_vertical(ways, before.yaws)
    turns = candidate_turns(STEP.turn)
    yaws_off = np.abs(
        wrapped(beams.yaws[:, None, None] - (before.yaws + turned)[:, None] - turns)
    )
    places_off = np.linalg.norm(beams.places[:, None] - expected, axis=2)[:, :, None]
    # both of the same parent
    np.testing.assert_allclose((yaws_off + places_off).min(axis=(1, 2)), 0.0, atol=1e-9)


def test_a_beam_is_limited_to_the_cheapest_states(small: Exemplars) -> None:
    before = beam([3, 3, 3], [0.0, 2.0, 4.0])
    steps = ClipSteps.of(small, before, STEP)
    every, few = (next_states(small, steps, most) for most in (MOST, 8))
    assert len(few) <= 8 < len(every)
    assert few.totals.min() == pytest.approx(every.totals.min())


def test_only_the_best_few_of_similar_states_are_kept(small: Exemplars) -> None:
    rng = np.random.default_rng(1)
    many = beam(
        rng.integers(0, len(small), 300).tolist(), rng.uniform(-4.0, 4.0, 300).tolist()
    )
    totals = rng.random(300)
    most = 2 * small.coarse_count
    kinds = list(
        zip(
            small.coarse_groups[many.states].tolist(),
            yaw_bins(many.yaws).tolist(),
            strict=True,
        )
    )
    twin = []
    counts = dict.fromkeys(kinds, 0)
    keys = list(zip(many.states.tolist(), yaw_bins(many.yaws).tolist(), strict=True))
    seen: set[tuple[int, int]] = set()
    for row in np.argsort(totals):
        # of equal poses with equal yaw bins only the cheapest counts
        if keys[row] in seen:
            continue
        seen.add(keys[row])
        counts[kinds[row]] += 1
        if counts[kinds[row]] <= 2:
            twin.append(int(row))
    assert len(seen) < len(many)
    rows = diverse_best(small, many.states, many.yaws, totals, most)
    assert rows.tolist() == twin[:most]


def test_a_root_strays_more_easily_along_the_line_of_sight() -> None:
    camera = np.zeros(3)
    place = np.array([[0.0, 0.0, 5.0]])
    along = np.array([[0.0, 0.0, 5.03]])
    across = np.array([[0.01, 0.0, 5.0]])
    # a standard deviation either way costs log(1 + 1 / 2); without a line of sight the first is 3 of them
    expected = np.stack([along, across, place])
    sights = lines_of_sight(place, camera)
    costs = root_deviation_costs(place - expected, sights, 0.03)[:, 0]
    np.testing.assert_allclose(costs, [np.log(1.5), np.log(1.5), 0.0], rtol=1e-6)
    assert root_deviation_costs(place - along, None, 0.03)[0] == pytest.approx(
        np.log(1.0 + 4.5)
    )


def test_turns_beyond_the_fastest_cost_more_than_a_jump(small: Exemplars) -> None:
    after = beam([30] * 4, [0.0, 0.2, 0.3, np.pi + 0.1])
    step = STEP._replace(max_turn=0.25)
    costs = ClipSteps.of(small, beam([3], [0.0]), step).costs(small, after)[0]
    assert costs.tolist() == [JUMP_COST, JUMP_COST, 2.0 * JUMP_COST, 2.0 * JUMP_COST]
