"""Viterbi's recursion against one that looks at every pair of states."""

import numpy as np
import pytest

from posefit.motion import built_in
from posefit.motion.built_in import average_skeleton
from posefit_exemplars.beam import BINS, SPEEDS, TURN, Beam, Steps, bins_of, joined_beams, jumped, stepped
from posefit_exemplars.exemplars import Exemplars

STEPS = Steps(0.03, np.radians(8.0), 12.0, 0.05)
SECONDS = 1.0 / 30.0


@pytest.fixture(scope="module")
def small() -> Exemplars:
    return Exemplars.of([built_in.motion(name, frames=20) for name in ("walk-a", "walk-b")], average_skeleton())


def beam(states: list[int], yaws: list[float], totals: list[float]) -> Beam:
    many = len(states)
    return Beam(np.array(states), np.array(yaws), np.full(many, -1), np.array(totals), np.zeros((many, 3)))


def test_a_step_costs_what_the_slow_twin_says(small: Exemplars) -> None:
    before = beam([3, 11, 25], [0.1, 0.1, 2.0], [0.0, 2.5, 1.0])
    found = stepped(small, before, SECONDS, STEPS)
    twin: dict[tuple[int, int], float] = {}
    for row in range(3):
        ahead = [small.after(before.states[row : row + 1], SECONDS * speed) for speed in SPEEDS]
        facing = before.yaws[row] + ahead[SPEEDS.index(1.0)][1][0]
        for state in range(len(small)):
            away = min(float(((code[0] - small.codes[state]) ** 2).sum()) for code, *_ in ahead)
            for turn in (-TURN, 0.0, TURN):
                cost = before.totals[row] + away / (2.0 * 0.03**2) + 0.5 * (turn / np.radians(8.0)) ** 2
                place = state, int(bins_of(np.array([facing + turn]))[0])
                twin[place] = min(twin.get(place, np.inf), cost)
    mine = dict(zip(zip(found.states.tolist(), bins_of(found.yaws).tolist(), strict=True), found.totals, strict=True))
    assert len(mine) == len(found)
    for place, cost in mine.items():
        assert cost == pytest.approx(twin[place], rel=1e-4, abs=1e-3)
    # what it leaves out costs more than a jump
    left = [cost for place, cost in twin.items() if place not in mine]
    assert min(left, default=np.inf) > min(twin.values())
    for state in (4, 12):  # the next poses of two of them are among the found
        assert state in found.states


def test_a_clip_that_goes_on_costs_next_to_nothing(small: Exemplars) -> None:
    found = stepped(small, beam([3], [0.0], [0.0]), SECONDS, STEPS)
    assert found.totals.min() < 0.05


def test_one_pose_in_one_bin_is_one_state_the_cheapest() -> None:
    width = 2.0 * np.pi / BINS
    both = joined_beams(beam([5, 5], [0.0, width], [3.0, 1.0]), beam([5, 6], [0.1 * width, 0.0], [2.0, 7.0]))
    assert sorted(zip(both.states.tolist(), both.totals.tolist(), strict=True)) == [(5, 1.0), (5, 2.0), (6, 7.0)]


def test_a_jump_comes_from_the_best_and_costs_the_same_anywhere() -> None:
    found = jumped(np.array([7, 9]), np.array([1.0, 2.0]), beam([1, 2], [0.0, 0.0], [4.0, 3.0]), STEPS)
    assert found.parents.tolist() == [1, 1]
    assert found.totals.tolist() == [15.0, 15.0]


def test_the_best_come_first() -> None:
    assert beam([1, 2, 3], [0.0] * 3, [5.0, 1.0, 2.0]).best(2).states.tolist() == [2, 3]
