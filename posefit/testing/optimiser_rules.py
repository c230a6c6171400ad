"""Rules of an optimiser: protocol, box, costs of every kind, repetition, success."""

import pickle
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space, Start, draw_population
from posefit.fitting.optimiser import Filter, NextFrame, Optimiser
from posefit.fitting.problem import Problem, minimise
from posefit.fitting.validation import BrokenRuleError, Checked
from posefit.settings import planned
from posefit.testing import common
from posefit.testing.common import PluginCase, check_speed, duplicates, unchanged
from posefit.testing.problem import pose_problem
from posefit.testing.results import BrokenError, SkippedError, expect
from posefit.testing.toy import Toy, ball, shell, slope, sphere

EVALUATIONS = 400  # budget of a search unless a check needs a special one
# budget of a search that is as long as a frame's, and its most populations
LONG = 2_440
LONG_ASKS = 100
BUDGET = 800  # budget of the searches that have to beat chance
SEEDS = range(5)
MAX_SHARE_OF_CHANCE = 0.95  # a cost beats chance if it is below this share of chance's
# for the search in a corner of a nine-dimensional box, with the budget that the SAPSO
# paper gives a frame: an optimiser that stops short of the sides keeps a fifth of
# chance's cost
SIDES_BUDGET = 2_440
MAX_SHARE_AT_SIDES = 0.15
SIDES_SEEDS = range(3)
MAX_SECONDS = 0.05  # a proposal: twenty thousand times a pose's cost
TURNS = 24  # populations after which true costs must have helped
LOADED = b"loaded"
# the program of the new process; the plugin's prints go to standard error
TRACING = f"""
import os, pickle, sys
out = os.fdopen(os.dup(1), "wb", 0)
os.dup2(2, 1)
sys.path[:], case = pickle.load(sys.stdin.buffer)
case = pickle.loads(case)
out.write({LOADED!r})
out.write(pickle.dumps(case.trace()))
"""
SPACE = Toy(5, ball)
BOX = Toy(9)

Evaluate = Callable[[Array], Array]


@dataclass(frozen=True)
class Case(PluginCase):
    """An optimiser's factory with its settings and its registered `next_frame`."""

    arguments = "space", "rng"

    next_frame: NextFrame = "start"

    def build(
        self,
        space: Space = BOX,
        seed: int = 0,
        evaluations: int = EVALUATIONS,
        **more: Any,
    ) -> Optimiser:
        """Return a new optimiser of the space."""
        filled = planned(self.factory, {**self.settings, **more}, evaluations)
        optimiser: Optimiser = self.factory(
            space, np.random.default_rng(seed), **filled
        )
        return optimiser

    def use(self, **more: Any) -> None:
        """Check a few populations of an optimiser."""
        for proposals, _ in self.steps(self.build(Toy(5), **more), Toy(5), sphere, 3):
            check_population(proposals, Toy(5))

    def use_fully(self) -> list[Array]:
        """Return the populations of a search."""
        return self.trace()

    def steps(
        self, optimiser: Optimiser, space: Space, evaluate: Evaluate, count: int
    ) -> Iterator[tuple[Array, Array]]:
        """Yield up to `count` populations with their costs.

        A filter that has finished a frame advances to the next one.
        """
        for _ in range(count):
            proposals = optimiser.ask()
            if not len(proposals) and self.next_frame == "carry":
                cast(Filter, optimiser).advance(space)
                proposals = optimiser.ask()
            if not len(proposals):
                return
            expect(
                len(proposals) <= BUDGET,
                f"ask must return at most the budget of {BUDGET} proposals, "
                f"got {len(proposals)}",
            )
            costs = np.asarray(evaluate(proposals), dtype=np.float64)
            # copies, because an optimiser may write into its arrays
            yield proposals.copy(), costs.copy()
            optimiser.tell(proposals, costs)

    def trace(self, seed: int = 0) -> list[Array]:
        """Return six populations that a new optimiser proposes."""
        steps = self.steps(self.build(SPACE, seed), SPACE, sphere, 6)
        return [proposals for proposals, _ in steps]

    def best(
        self, space: Space, evaluate: Evaluate, seed: int, evaluations: int
    ) -> float:
        """Return the lowest cost of a search, for a filter over ten frames."""
        optimiser = self.build(space, seed, evaluations)
        lowest = np.inf
        # a filter has few generations in a frame, and converges over several frames
        for frame in range(10 if self.next_frame == "carry" else 1):
            if frame:
                cast(Filter, optimiser).advance(space)
            problem = Problem(evaluate, space, evaluations)
            minimise(problem, optimiser, budget_known=True)
            lowest = min(lowest, problem.best_cost)
        return lowest

    def valid(self, space: Space, evaluate: Evaluate, count: int = 6) -> str:
        """Check that every proposal of a search is allowed, and count them."""
        total = 0
        for proposals, _ in self.steps(self.build(space), space, evaluate, count):
            check_population(proposals, space)
            total += len(proposals)
        expect(total, "ask must return a population, got an empty one at once")
        return f"{total} proposals"


def check_population(proposals: Array, space: Space) -> None:
    """Check that a population consists of finite, allowed proposals in the box."""
    shape = np.shape(proposals)
    expect(
        len(shape) == 2 and shape[1] == space.dimensions,
        f"ask must return (n, {space.dimensions}), got {shape}",
    )
    expect(
        np.isfinite(proposals).all(),
        "ask must return finite proposals, got nan or infinity",
    )
    far = float(np.abs(proposals).max(initial=0.0))
    expect(far <= 1.0, f"ask must stay in [-1, 1], got {far:.6g} from the middle")
    infeasible = int(np.count_nonzero(~space.feasible(proposals)))
    expect(
        not infeasible,
        "ask must return feasible proposals, "
        f"got {infeasible} of {len(proposals)} that are not",
    )


def same(first: list[Array], second: list[Array]) -> bool:
    """Return whether two traces are the same bit for bit."""
    return len(first) == len(second) and all(map(np.array_equal, first, second))


def shape(case: Case) -> str:
    """The method ask returns an array (n, d)."""
    proposals = case.build().ask()
    expect(
        isinstance(proposals, np.ndarray),
        f"ask must return an array, got {type(proposals).__name__}",
    )
    expect(
        proposals.ndim == 2 and proposals.shape[1] == 9,
        f"ask must return (n, 9), got {proposals.shape}",
    )
    expect(len(proposals), "the first population must not be empty, got (0, 9)")
    return f"{len(proposals)} at a time"


def dtype(case: Case) -> None:
    """The method ask returns float64."""
    for proposals, _ in case.steps(case.build(), BOX, sphere, 4):
        expect(
            proposals.dtype == np.float64,
            f"ask must return float64, got {proposals.dtype}",
        )


def box(case: Case) -> str:
    """Every proposal is in the box, even for a start at the edge or periodic axes."""
    case.valid(Toy(6, wrapping=2), lambda x: 1.0 - np.abs(x[:, 0]), 12)
    case.valid(
        Toy(5, start=Start(np.ones(5), np.full(5, 0.5), np.full(5, 0.3))), sphere
    )
    return case.valid(BOX, lambda x: -np.abs(x).sum(axis=1), 12)


def feasible(case: Case) -> str:
    """Every proposal is feasible in a box of which a third is feasible."""
    return case.valid(Toy(4, ball), lambda x: -x.sum(axis=1), 12)


def hardly_feasible(case: Case) -> str:
    """Every proposal is feasible, and the search continues, in a very thin region."""
    return case.valid(Toy(3, shell), sphere)


def dimensions(case: Case) -> None:
    """The optimiser searches spaces of 1 and of 66 dimensions."""
    # the smallest space, where a covariance is a number, and that of all joint angles
    for d in (1, 66):
        case.valid(Toy(d), sphere)


def costs(case: Case) -> None:
    """The optimiser survives costs that are nan, infinite, equal or up to 1e300."""
    kinds: dict[str, Evaluate] = {
        "some nan": lambda x: np.where(np.arange(len(x)) % 2, np.nan, sphere(x)),
        "all nan": lambda x: np.full(len(x), np.nan),
        "some infinite": lambda x: np.where(np.arange(len(x)) % 3, np.inf, sphere(x)),
        "all infinite": lambda x: np.full(len(x), np.inf),
        "all equal": lambda x: np.zeros(len(x)),
        "up to 1e300": lambda x: 1e300 * sphere(x),
    }
    for kind, evaluate in kinds.items():
        try:
            case.valid(Toy(9, ball), evaluate)
        except BrokenError as broken:
            raise BrokenError(f"costs that are {kind}: {broken}") from None


def budget(case: Case) -> str:
    """A search uses at least three quarters of its budget."""
    used = 0
    optimiser = case.build()
    while len(proposals := optimiser.ask()) and used + len(proposals) <= EVALUATIONS:
        optimiser.tell(proposals, sphere(proposals))
        used += len(proposals)
    expect(
        used >= 0.75 * EVALUATIONS,
        f"a search must use most of its budget of {EVALUATIONS}, got {used}",
    )
    return f"{used} of {EVALUATIONS} evaluations"


def late(case: Case) -> str:
    """A search still works after many populations, until its budget is used."""
    used = 0
    asked = 0
    optimiser = case.build(evaluations=LONG)
    for asked in range(1, LONG_ASKS + 1):
        try:
            proposals = optimiser.ask()
            if not len(proposals) and case.next_frame == "carry":
                cast(Filter, optimiser).advance(BOX)
                proposals = optimiser.ask()
                used = 0
            # the caller would not evaluate a population beyond the budget
            if not len(proposals) or used + len(proposals) > LONG:
                break
            check_population(proposals, BOX)
            optimiser.tell(proposals, sphere(proposals))
        except BrokenError as broken:
            raise BrokenError(f"population {asked}: {broken}") from None
        except Exception as error:
            error.add_note(f"in population {asked} of a search")
            raise
        used += len(proposals)
    return f"{asked} populations"


def evaluations(case: Case) -> None:
    """The optimiser evaluates no poses by itself in ask or tell."""
    problem = pose_problem()
    checked = Checked(case.build(problem.space), "the optimiser", problem.space)
    try:
        for _ in case.steps(checked, problem.space, problem, 4):
            pass
    except BrokenRuleError as broken:
        raise BrokenError(str(broken)) from broken.__cause__


def order(case: Case) -> str:
    """The cost of row i belongs to proposal i."""
    rng = np.random.default_rng(1)

    def shuffled(x: Array) -> Array:
        return rng.permutation(sphere(x))

    def last(evaluate: Evaluate, seed: int) -> float:
        steps = case.steps(case.build(Toy(4), seed), Toy(4), evaluate, TURNS)
        means = [sphere(proposals).mean() for proposals, _ in steps]
        return float(np.mean(means[len(means) // 2 :]))

    # shuffled costs are as large as true ones, but belong to other proposals
    good = [last(sphere, seed) for seed in range(3)]
    bad = [last(shuffled, seed) for seed in range(3)]
    # equal bit for bit: the costs had no influence at all
    if good == bad:
        raise SkippedError("it ignores the costs, or has one proposal at a time")
    expect(
        np.median(good) < 0.8 * np.median(bad),
        "true costs must help more than shuffled ones, got mean costs "
        f"{np.median(good):.3g} and {np.median(bad):.3g}",
    )
    return f"mean cost {np.median(good):.3g}, shuffled {np.median(bad):.3g}"


def nonsense_settings(case: Case) -> str:
    """Invalid values of a setting are refused or harmless."""
    return common.nonsense_settings(case, harmless=True)


def seeds(case: Case) -> None:
    """The same seed gives the same proposals, another seed gives others."""
    expect(same(case.trace(), case.trace()), "one seed must give one trace, got two")
    expect(
        not same(case.trace(), case.trace(seed=1)),
        "two seeds must give two traces, got the same",
    )


def new_process(case: Case) -> None:
    """The same seed gives the same proposals in a new process."""
    try:
        # pickled twice, because the path has to be set before the plugin is imported
        payload = pickle.dumps((sys.path, pickle.dumps(case)))
    except Exception as error:
        raise SkippedError(
            f"the factory cannot be sent to another process: {error}"
        ) from None
    ran = subprocess.run(
        [sys.executable, "-c", TRACING], input=payload, capture_output=True
    )
    _, loaded, trace = ran.stdout.partition(LOADED)
    if not loaded:
        raise SkippedError("the factory cannot be imported in another process")
    expect(
        trace,
        "it must work in a new process, got an early end: "
        f"{ran.stderr.decode()[-300:]}",
    )
    expect(
        same(case.trace(), pickle.loads(trace)),
        "one seed must give one trace in every process, got two",
    )


def inputs(case: Case) -> None:
    """The method tell does not modify its arguments."""
    optimiser = case.build(SPACE)
    for _ in range(4):
        proposals = optimiser.ask()
        if not len(proposals):
            break
        values = sphere(proposals)
        same_proposals = unchanged(proposals)
        same_costs = unchanged(values)
        optimiser.tell(proposals, values)
        expect(
            same_proposals(),
            "tell must not modify its proposals, but did",
        )
        expect(same_costs(), "tell must not modify its costs, but did")


def copies(case: Case) -> None:
    """A deep copy and an unpickled copy continue as the original would."""

    def rest(optimiser: Optimiser) -> list[Array]:
        return [proposals for proposals, _ in case.steps(optimiser, SPACE, sphere, 3)]

    for count in (0, 2):
        optimiser = case.build(SPACE)
        for _ in case.steps(optimiser, SPACE, sphere, count):
            pass
        twins = duplicates(optimiser)
        original = rest(optimiser)
        for what, twin in twins.items():
            expect(
                same(original, rest(twin)),
                f"{what} must continue as the original, got another after {count}",
            )


def start(case: Case) -> str:
    """The first population comes from the start that the space gives."""
    if case.next_frame == "forget":
        raise SkippedError("it is registered to forget")
    mean = np.where(np.arange(6) % 2, 0.5, -0.4)
    first = case.build(Toy(6, start=Start(mean, np.full(6, 0.02), np.zeros(6)))).ask()
    away = float(np.median(np.abs(first - mean)))
    expect(
        away < 0.1,
        "the first population must be around the start, spread 0.02, "
        f"got {away:.3g} away from it",
    )
    return f"{away:.3g} away, spread 0.02"


def next_frame(case: Case) -> str:
    """A filter carries its particles into the next frame."""
    if case.next_frame != "carry":
        raise SkippedError(f"it is registered to {case.next_frame}, not to carry")
    space = Toy(4)
    optimiser = case.build(space)
    expect(
        hasattr(optimiser, "advance"),
        "an optimiser registered to carry must have advance(space), got none",
    )
    for _ in range(3):
        while len(proposals := optimiser.ask()):
            optimiser.tell(proposals, sphere(proposals))
        cast(Filter, optimiser).advance(space)
    proposals = optimiser.ask()
    expect(
        len(proposals), "after advance, ask must return a population, got an empty one"
    )
    check_population(proposals, space)
    near = sphere(proposals).mean()
    chance = sphere(draw_population(space, np.random.default_rng(0), 1000)).mean()
    expect(
        near < 0.7 * chance,
        f"particles must be carried, got a mean cost of {near:.3g}; "
        f"random particles have {chance:.3g}",
    )
    return f"mean cost {near:.3g}, by chance {chance:.3g}"


def sphere_problem(case: Case) -> str:
    """A search on a sphere beats chance."""
    return _beats_chance(case, Toy(6), sphere)


def sides(case: Case) -> str:
    """A search comes near a minimum that lies in a corner of the box."""
    _skip_baseline(case)
    lowest_drawn = []
    for seed in SEEDS:
        drawn = draw_population(BOX, np.random.default_rng(seed), SIDES_BUDGET)
        lowest_drawn.append(float(slope(drawn).min()))
    chance = float(np.median(lowest_drawn))
    below = MAX_SHARE_AT_SIDES * chance
    lowest = [_lowest(case, seed, below) for seed in SIDES_SEEDS]
    best = float(np.median(lowest))
    expect(
        best < below,
        f"the median cost in a corner must fall below {below:.3g}, "
        f"of chance's {chance:.3g}, got {best:.3g}",
    )
    return f"below {below:.3g}, by chance {chance:.3g}, {SIDES_BUDGET} evaluations"


def _lowest(case: Case, seed: int, enough: float) -> float:
    """Return the lowest cost of a search for the corner, ended when low enough."""
    optimiser = case.build(BOX, seed, SIDES_BUDGET)
    lowest = np.inf
    for frame in range(10 if case.next_frame == "carry" else 1):
        if frame:
            cast(Filter, optimiser).advance(BOX)
        used = 0
        while len(proposals := optimiser.ask()) and lowest >= enough:
            used += len(proposals)
            if used > SIDES_BUDGET:
                break
            costs = slope(proposals)
            lowest = min(lowest, float(costs.min()))
            optimiser.tell(proposals, costs)
    return lowest


def real_problem(case: Case) -> str:
    """A search on a real pose problem beats chance."""
    problem = pose_problem()
    return _beats_chance(case, problem.space, problem)


def _beats_chance(case: Case, space: Space, evaluate: Evaluate) -> str:
    _skip_baseline(case)
    lowest_drawn = []
    for seed in SEEDS:
        drawn = draw_population(space, np.random.default_rng(seed), BUDGET)
        lowest_drawn.append(float(evaluate(drawn).min()))
    chance = float(np.median(lowest_drawn))
    below = MAX_SHARE_OF_CHANCE * chance
    lowest = list[float]()
    for seed in SEEDS:
        lowest.append(case.best(space, evaluate, seed, BUDGET))
        if np.count_nonzero(np.array(lowest) < below) > len(SEEDS) // 2:
            # the median is below, whatever the other seeds give
            break
    best = float(np.median(lowest))
    expect(
        best < below,
        f"the median cost after {BUDGET} must beat chance's {chance:.4g}, "
        f"got {best:.4g}",
    )
    return f"cost {best:.4g}, by chance {chance:.4g}, {BUDGET} evaluations"


def _skip_baseline(case: Case) -> None:
    if getattr(getattr(case.factory, "func", case.factory), "baseline", False):
        raise SkippedError("it is the baseline itself")


def speed(case: Case) -> str:
    """A proposal takes less than 50 ms to make."""

    def search(seed: int) -> int:
        steps = case.steps(case.build(BOX, seed), BOX, sphere, 10)
        return sum(len(proposals) for proposals, _ in steps)

    return check_speed("a proposal", MAX_SECONDS, search)


RULES = [
    common.construction,
    shape,
    dtype,
    box,
    feasible,
    hardly_feasible,
    dimensions,
    costs,
    budget,
    late,
    evaluations,
    order,
    common.silence,
    common.unknown_setting,
    nonsense_settings,
    seeds,
    new_process,
    common.global_randomness,
    inputs,
    copies,
    start,
    next_frame,
    sphere_problem,
    sides,
    real_problem,
    speed,
]
