"""Does an optimiser search: does it heed the start, carry its particles, and find more than chance does?"""

import time
from collections.abc import Iterator
from typing import cast

import numpy as np

from posefit.fitting.box import Space, Start, draw_population
from posefit.fitting.optimiser import Filter, Niching, Optimiser
from posefit.testing.case import Evaluate, OptimiserCase, check_population, checklist
from posefit.testing.problem import pose_problem
from posefit.testing.results import SkippedError, expect
from posefit.testing.toy import Toy, ball, sphere

BUDGET = 800
SEEDS = range(5)
BEATS = 0.95  # a cost below so much of chance's beats it
SLOW = 0.05  # seconds a proposal: twenty thousand times what a pose costs


@checklist
def start(case: OptimiserCase) -> str:
    """The first population comes from the start that the space gives."""
    if case.next_frame == "forget":
        raise SkippedError("it is registered to forget")
    mean = np.where(np.arange(6) % 2, 0.5, -0.4)
    given = Start(mean, np.full(6, 0.02), np.zeros(6))
    first = case.build(Toy(6, start=given)).ask()
    away = float(np.median(np.abs(first - mean)))
    expect(away < 0.1, f"the first population must be around the start, spread 0.02, got {away:.3g} away from it")
    return f"{away:.3g} away, spread 0.02"


@checklist
def next_frame(case: OptimiserCase) -> str:
    """A filter carries its particles into the next frame; another optimiser has no such method."""
    if case.next_frame != "carry":
        raise SkippedError(f"it is registered to {case.next_frame}, not to carry")
    space = Toy(4)
    optimiser = case.build(space)
    expect(hasattr(optimiser, "advance"), "what is registered to carry must have advance(space), got none")
    for _ in range(3):
        for _ in _frame(optimiser):
            pass
        cast(Filter, optimiser).advance(space)
    proposals = optimiser.ask()
    expect(len(proposals), "after advance, ask must return a population, got an empty one")
    check_population(proposals, space)
    near, chance = sphere(proposals).mean(), sphere(draw_population(space, np.random.default_rng(0), 1000)).mean()
    expect(
        near < 0.7 * chance, f"particles must be carried, got a mean cost of {near:.3g} where chance has {chance:.3g}"
    )
    return f"mean cost {near:.3g}, by chance {chance:.3g}"


def _frame(optimiser: Optimiser) -> Iterator[None]:
    """Yield after each population of a frame."""
    while len(proposals := optimiser.ask()):
        optimiser.tell(proposals, sphere(proposals))
        yield


@checklist
def modes(case: OptimiserCase) -> str:
    """What modes returns are proposals that were told, the best first."""
    space = Toy(3, ball)
    optimiser = case.build(space)
    if not hasattr(optimiser, "modes"):
        raise SkippedError("it has no modes")
    seen = np.concatenate([proposals for proposals, _ in case.steps(optimiser, space, sphere, 12)])
    found = cast(Niching, optimiser).modes()
    check_population(found, space)
    expect(len(found), "after twelve populations, modes must return at least one proposal, got (0, 3)")
    known = {row.tobytes() for row in seen}
    strangers = sum(row.tobytes() not in known for row in np.asarray(found))
    expect(not strangers, f"modes must return proposals that were told, got {strangers} others")
    costs = sphere(found)
    expect((np.diff(costs) >= 0.0).all(), "modes must return the best first, got a dearer one before a cheaper")
    lowest = float(sphere(seen).min())
    expect(costs[0] <= lowest, f"modes must begin with the best there was, cost {lowest:.4g}, got {costs[0]:.4g}")
    return f"{len(found)} modes"


@checklist
def sphere_problem(case: OptimiserCase) -> str:
    """A sphere is solved better than by chance."""
    return _beats_chance(case, Toy(6), sphere)


@checklist
def real_problem(case: OptimiserCase) -> str:
    """A real pose problem is solved better than by chance."""
    problem = pose_problem()
    return _beats_chance(case, problem.space, problem.evaluate)


def _beats_chance(case: OptimiserCase, space: Space, evaluate: Evaluate) -> str:
    if case.baseline:
        raise SkippedError("it is the baseline itself")
    chance = float(np.median([_by_chance(space, evaluate, seed) for seed in SEEDS]))
    found: list[float] = []
    for seed in SEEDS:
        found.append(case.best(space, evaluate, seed, BUDGET))
        if sum(cost < BEATS * chance for cost in found) > len(SEEDS) // 2:
            break  # whatever the others find, the median is below, too
    best = float(np.median(found))
    expect(best < BEATS * chance, f"the median cost after {BUDGET} must beat chance's {chance:.4g}, got {best:.4g}")
    return f"cost {best:.4g}, by chance {chance:.4g}, {BUDGET} evaluations"


def _by_chance(space: Space, evaluate: Evaluate, seed: int) -> float:
    drawn = draw_population(space, np.random.default_rng(seed), BUDGET)
    return float(evaluate(drawn).min())


@checklist
def speed(case: OptimiserCase) -> str:
    """A proposal costs less than 50 ms to make."""
    space = Toy(9)
    spent, count = np.inf, 0
    for seed in range(3):
        optimiser = case.build(space, seed)
        began, count = time.perf_counter(), 0
        for proposals, _ in case.steps(optimiser, space, sphere, 10):
            count += len(proposals)
        spent = min(spent, (time.perf_counter() - began) / max(count, 1))
    expect(spent < SLOW, f"a proposal must take less than {1e3 * SLOW:g} ms, got {1e3 * spent:.3g}")
    return f"{1e6 * spent:.1f} us a proposal"
