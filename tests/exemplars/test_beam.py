"""Steps from the states of one frame to those of the next, against twins that look at every pair."""

from dataclasses import replace

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.rotation import wrapped
from posefit_exemplars import kernels
from posefit_exemplars.beam import (
    BINS,
    FACINGS,
    MAX_EXCESS_COST,
    MAX_SHARES,
    SPEEDS,
    SPIN_COST,
    TURN,
    Beam,
    Steps,
    Transition,
    bins_of,
    diverse_best,
    jump_states,
    merged,
    next_states,
    root_deviation_costs,
    squared_distances,
    transition_costs,
)
from posefit_exemplars.exemplars import Exemplars, about_vertical
from tests.cases import cases

STEPS = Steps(0.03, np.radians(8.0), 12.0, 0.01, 0.03, 0.008)
SECONDS = 1.0 / 30.0
MOST = 4000
OWN = SPEEDS.index(1.0)


def beam(states: list[int], yaws: list[float], totals: list[float], places: Array | None = None) -> Beam:
    many = len(states)
    where = np.zeros((many, 3)) if places is None else places
    return Beam(np.array(states), np.array(yaws), np.full(many, -1), np.array(totals), where)


def costs_of_steps(exemplars: Exemplars, before: Beam, root: Array | None) -> Array:
    """Return what a step from each state to each pose costs (n, K), pair by pair; whoever it is does not turn away."""
    costs = np.full((len(before), len(exemplars)), np.inf)
    for row, state in enumerate(before.states):
        for speed in SPEEDS:
            code, _, way = exemplars.after(np.array([state]), SECONDS * speed)
            pace = 0.0
            if root is not None:
                off = before.places[row] + about_vertical(way, before.yaws[row : row + 1])[0] - root
                pace = np.log1p(off @ off / 2.0 / STEPS.pace**2)
            for pose in range(len(exemplars)):
                away = ((code[0] - exemplars.codes[pose]) ** 2).sum() / (2.0 * STEPS.spread**2)
                costs[row, pose] = min(costs[row, pose], away + min(pace, STEPS.jump))
    return costs


@pytest.mark.pure
def test_each_pose_is_reached_by_its_cheapest_step() -> None:
    for limit in cases([np.inf, 3.0]):
        rng = np.random.default_rng(0)
        ahead = rng.normal(size=(3, 5, 8)).astype(np.float32)
        ways, totals = rng.random((3, 5)), rng.random(5)
        codes = rng.normal(size=(20, 8)).astype(np.float32)
        bounds = np.array([0, 4, 9, 9, 15, 20])  # one group is empty
        rows, near = np.array([0, 2, 3]), rng.integers(0, 4, (5, 2))  # nobody looks at the last group
        least, owners, touched = np.full(20, np.inf), np.zeros(20, dtype=np.int64), np.zeros(20, dtype=np.int64)
        count = kernels.cheapest_steps(
            ahead, ways, totals, rows, near, codes, bounds, 0.25, limit, least, owners, touched
        )
        twin = np.full((5, 20), np.inf)
        for r in rows:
            for k in range(20):
                if any(bounds[g] <= k < bounds[g + 1] for g in near[r]):
                    away = [((ahead[s, r] - codes[k]) ** 2).sum() for s in range(3)]
                    twin[r, k] = min(totals[r] + ways[s, r] + 0.25 * away[s] for s in range(3))
        best = twin.min(axis=0)
        found = np.flatnonzero(best < limit)
        assert 0 < len(found) < 20
        assert sorted(touched[:count].tolist()) == found.tolist()
        np.testing.assert_allclose(least[found], best[found], rtol=1e-5)
        np.testing.assert_array_equal(owners[found], twin.argmin(axis=0)[found])


def test_a_step_costs_what_the_slow_twin_says(small: Exemplars) -> None:
    for known in cases([False, True]):
        root = np.array([0.0, 0.0, 0.05]) if known else None
        before = beam([3, 11, 25], [0.1, 0.1, 2.0], [0.0, 2.5, 1.0])
        found = next_states(small, before, SECONDS, STEPS, MOST, root)
        steps = costs_of_steps(small, before, root) + before.totals[:, None]
        codes, turned, _ = small.after(before.states, SECONDS)
        twin: dict[tuple[int, int], float] = {}
        for row in range(3):
            for state in range(len(small)):
                for turn in (-TURN, 0.0, TURN):
                    facing = np.array([before.yaws[row] + turned[row] + turn])
                    place = state, int(bins_of(facing)[0])
                    cost = steps[row, state] + 0.5 * (turn / STEPS.turning) ** 2
                    twin[place] = min(twin.get(place, np.inf), cost)
        mine = dict(
            zip(zip(found.states.tolist(), bins_of(found.yaws).tolist(), strict=True), found.totals, strict=True)
        )
        assert len(mine) == len(found)
        for place, cost in mine.items():
            assert cost == pytest.approx(twin[place], rel=1e-4, abs=1e-3)
        assert min(mine.values()) == pytest.approx(min(twin.values()), abs=1e-3)
        for row in range(3):  # what a clip does next is among the found
            following = int(squared_distances(codes[row : row + 1], small.codes).argmin())
            assert following in found.states
        assert (
            found.totals.max() < before.totals.min() + STEPS.jump + MAX_EXCESS_COST + 0.5 * (TURN / STEPS.turning) ** 2
        )


def test_a_step_says_where_it_came_from_and_leads(small: Exemplars) -> None:
    places = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 5.0]])
    before = beam([3, 25], [0.0, 3.0], [0.0, 0.0], places)
    found = next_states(small, before, SECONDS, STEPS, MOST)
    _, turned, ways = small.after(before.states, SECONDS)
    expected = places + about_vertical(ways, before.yaws)
    np.testing.assert_allclose(found.places, expected[found.parents])
    turns = wrapped(found.yaws - (before.yaws + turned)[found.parents])
    np.testing.assert_allclose(np.abs(turns)[np.abs(turns) > 1e-9], TURN)


def test_a_known_root_is_borne_to_be_anywhere_at_the_cost_of_a_jump(small: Exemplars) -> None:
    before = beam([3], [0.0], [0.0])
    near = next_states(small, before, SECONDS, STEPS, MOST, small.after(np.array([3]), SECONDS)[2][0])
    free = next_states(small, before, SECONDS, STEPS, MOST).totals.min()
    assert free <= near.totals.min() < free + 0.2
    far = next_states(small, before, SECONDS, STEPS, MOST, np.array([1e6, 0.0, 0.0]))
    assert far.totals.min() == pytest.approx(STEPS.jump + free, abs=0.2)


def test_there_are_at_most_so_many_and_a_yaw_has_its_share_of_them(small: Exemplars) -> None:
    before = beam([3, 3, 3], [0.0, 2.0, 4.0], [0.0, 0.0, 0.0])
    every = next_states(small, before, SECONDS, STEPS, MOST)
    few = next_states(small, before, SECONDS, STEPS, 8)
    assert len(few) <= 8 < len(every)
    for yaw in (0.0, 2.0, 4.0):  # of 8 / FACINGS poses, each with three yaws
        share = int((np.abs(wrapped(few.yaws - yaw)) < 0.5).sum())
        assert 0 < share <= 3 * (8 // FACINGS)
    assert few.totals.min() == pytest.approx(every.totals.min())


def test_of_those_alike_only_the_best_few_are_kept(small: Exemplars) -> None:
    rng = np.random.default_rng(1)
    many = beam(rng.integers(0, len(small), 300).tolist(), rng.uniform(-4.0, 4.0, 300).tolist(), [0.0] * 300)
    totals, most = rng.random(300), 2 * MAX_SHARES
    kept = diverse_best(small, many, totals, most)
    kinds = list(zip(small.kinds[many.states].tolist(), bins_of(many.yaws).tolist(), strict=True))
    twin, had = [], dict.fromkeys(kinds, 0)
    for row in np.argsort(totals):
        had[kinds[row]] += 1
        if had[kinds[row]] <= 2:
            twin.append(int(row))
    assert kept.tolist() == twin[:most]


def test_a_clip_that_goes_on_costs_next_to_nothing(small: Exemplars) -> None:
    # poses are two centimetres apart, and the spread is three
    assert next_states(small, beam([3], [0.0], [0.0]), SECONDS, STEPS, MOST).totals.min() < 0.5 * (2.0 / 3.0) ** 2


def test_one_pose_in_one_bin_is_one_state_the_cheapest() -> None:
    width = 2.0 * np.pi / BINS
    both = merged(beam([5, 5], [0.0, width], [3.0, 1.0]), beam([5, 6], [0.1 * width, 0.0], [2.0, 7.0]))
    assert sorted(zip(both.states.tolist(), both.totals.tolist(), strict=True)) == [(5, 1.0), (5, 2.0), (6, 7.0)]


def test_a_jump_comes_from_the_best_and_costs_the_same_anywhere() -> None:
    before = beam([1, 2], [0.0, 0.0], [4.0, 3.0], np.array([[0.0] * 3, [1.0, 2.0, 3.0]]))
    found = jump_states(np.array([7, 9]), np.array([1.0, 2.0]), before, STEPS)
    assert found.parents.tolist() == [1, 1]
    assert found.totals.tolist() == [15.0, 15.0]
    assert found.places.tolist() == [[1.0, 2.0, 3.0]] * 2


def test_a_root_strays_more_easily_along_the_line_of_sight_than_across_it() -> None:
    eye, place = np.zeros(3), np.array([[0.0, 0.0, 5.0]])
    along, across = np.array([[0.0, 0.0, 5.03]]), np.array([[0.01, 0.0, 5.0]])
    # a standard deviation either way: log(1 + 1 / 2)
    for expected in (along, across):
        assert root_deviation_costs(place, expected, eye, STEPS)[0] == pytest.approx(np.log(1.5), rel=1e-6)
    # with cameras on all sides there is no such line: 3 standard deviations
    assert root_deviation_costs(place, along, None, STEPS)[0] == pytest.approx(np.log(1.0 + 4.5))
    assert root_deviation_costs(place, place, eye, STEPS)[0] == 0.0
    both = root_deviation_costs(np.repeat(place, 2, axis=0), np.stack([along, across]).repeat(2, axis=1), eye, STEPS)
    np.testing.assert_allclose(both, np.log(1.5), rtol=1e-6)


def test_between_two_beams_a_step_costs_what_the_twin_says_and_never_more_than_a_jump(small: Exemplars) -> None:
    for known in cases([False, True]):
        root = np.array([0.0, 0.01, 0.04]) if known else None
        eye = np.array([3.0, 1.0, 0.0])
        before = beam([3, 11, 25], [0.1, 6.2, 2.0], [0.0, 2.5, 1.0])
        after = beam([4, 12, 26, 3], [0.15, -0.1, 2.1, 0.1], [0.0] * 4, np.full((4, 3), 0.02))
        found = transition_costs(Transition(small, before, after, SECONDS, root, eye), steps=STEPS)
        _, turned, ways = small.after(before.states, SECONDS)
        twin = costs_of_steps(small, before, root)[:, after.states]
        for i in range(3):
            for j in range(4):
                twin[i, j] += 0.5 * (wrapped(after.yaws[j] - before.yaws[i] - turned[i]) / STEPS.turning) ** 2
                if root is None:
                    went = before.places[i] + about_vertical(ways[i : i + 1], before.yaws[i : i + 1])
                    twin[i, j] += root_deviation_costs(after.places[j : j + 1], went, eye, STEPS)[0]
        np.testing.assert_allclose(found, np.minimum(twin, STEPS.jump), rtol=1e-3, atol=1e-3)
        assert found.max() == STEPS.jump
        assert found[0, 0] < 8.0  # the clip goes on


def test_a_turn_costs_as_much_to_the_left_as_to_the_right(small: Exemplars) -> None:
    before = beam([3], [0.0], [0.0])
    facing = float(small.after(before.states, SECONDS)[1][0])
    root = small.after(before.states, SECONDS)[2][0]
    after = beam([4] * 5, [facing + turn for turn in (-0.2, -0.1, 0.0, 0.1, 0.2)], [0.0] * 5)
    costs = transition_costs(Transition(small, before, after, SECONDS, root, None), steps=STEPS)[0]
    np.testing.assert_allclose(costs, costs[::-1], atol=1e-9)
    np.testing.assert_allclose(costs[3:] - costs[2], 0.5 * (np.array([0.1, 0.2]) / STEPS.turning) ** 2)
    # nor does a whole turn make a difference
    round_ = replace(after, yaws=after.yaws + 2.0 * np.pi)
    np.testing.assert_allclose(
        transition_costs(Transition(small, before, round_, SECONDS, root, None), steps=STEPS)[0], costs, atol=1e-9
    )


def test_a_step_that_turns_farther_than_anybody_does_costs_more_than_a_jump(small: Exemplars) -> None:
    before = beam([3], [0.0], [0.0])
    after = beam([30] * 4, [0.0, 0.2, 0.3, np.pi + 0.1], [0.0] * 4)
    steps = replace(STEPS, fastest=0.25)
    costs = transition_costs(Transition(small, before, after, SECONDS, None, None), steps=steps)[0]
    farther = np.array([0.0, 0.0, 0.05, np.pi - 0.35])
    np.testing.assert_allclose(costs, STEPS.jump + SPIN_COST * farther, rtol=1e-9)
