"""Optimisers of other libraries, as generators that yield proposals and get costs.

| method | library |
|---|---|
| `nevergrad:NAME` | Nevergrad, a gradient-free optimization platform (1) |
| `optuna:SAMPLER` | Optuna: a next-generation ... optimization framework (2) |
| `pycma` | CMA-ES/pycma on GitHub (3) |
| `pymoo:NAME` | pymoo: multi-objective optimization in Python (4) |
| `scipy:differential_evolution` | Differential evolution (5) |
| `scipy:dual_annealing` | Generalized simulated annealing (6) |

(1) J. Rapin, O. Teytaud, 2018. (2) T. Akiba et al., KDD 2019. (3) N. Hansen, Y.
Akimoto, P. Baudis, 2019. (4) J. Blank, K. Deb, IEEE Access 8, 2020. (5) R. Storn, K.
Price, Journal of Global Optimization 11, 1997. (6) Y. Xiang et al., The R Journal 5(1),
2013.

>>> import posefit
>>> track = posefit.track("walk", method="scipy:differential_evolution", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from functools import partial, wraps
from importlib import import_module
from queue import SimpleQueue
from threading import Thread
from typing import Any, Literal, final

import numpy as np

from posefit.errors import InputError
from posefit.plugin import (
    Adapter,
    Array,
    Space,
    at_least,
    choices,
    draw_population,
    positive,
)
from posefit.reading import quoted

# how long to wait for a library's thread when its search is dropped
LEAVE_SECONDS = 5.0

# yields proposals (n, d), and is sent their costs (n,)
Proposals = Generator[Array, Array, None]
Library = Callable[[Space, np.random.Generator], Proposals]
Objective = Callable[[Array], Array]
Sampler = Literal[
    "TPESampler",
    "CmaEsSampler",
    "GPSampler",
    "NSGAIISampler",
    "QMCSampler",
    "RandomSampler",
]
Algorithm = Literal["DE", "PSO", "GA", "ES", "SRES", "ISRES"]
Minimiser = Literal["differential_evolution", "dual_annealing"]


@final
class Bridge(Adapter):
    """An optimiser that a library runs as a generator; it ends when that returns.

    A copy, or an unpickled bridge, runs the library again and repeats the costs so far.
    So `library` must do the same every time, and must be picklable if the bridge is
    pickled.
    """

    def __init__(
        self, space: Space, rng: np.random.Generator, library: Library
    ) -> None:
        super().__init__(space, draw_population(space, rng, 1)[0])
        self._library = library
        self._seed = int(rng.integers(2**63))
        # the costs of all populations so far
        self._costs: list[Array] = []
        self._begin()

    def _begin(self) -> None:
        """Start the library. It checks its settings first."""
        self._proposals = self._library(self._space, np.random.default_rng(self._seed))
        self._population = next(self._proposals, np.empty((0, self._space.dimensions)))
        # number of costs that the library has received
        self._sent = 0

    def propose(self) -> Array:
        """Return the library's next population (n, d), empty once it has ended."""
        try:
            while self._sent < len(self._costs):
                self._sent += 1
                self._population = self._proposals.send(self._costs[self._sent - 1])
        except StopIteration:
            self._population = self._population[:0]
        return self._population

    def learn(self, proposals: Array, costs: Array) -> None:
        """Store the costs (n,) for the library."""
        self._costs.append(costs)

    def __getstate__(self) -> dict[str, Any]:
        return {
            **self.__dict__,
            "_proposals": None,
            "_population": None,
            "_asked": None,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._begin()


def bridge(library: Callable[..., Proposals]) -> Callable[..., Bridge]:
    """Return an optimiser's factory with the settings and docstring of its library."""

    @wraps(library)
    def factory(space: Space, rng: np.random.Generator, **settings: Any) -> Bridge:
        return Bridge(space, rng, partial(library, **settings))

    return factory


def nevergrad(
    space: Space,
    rng: np.random.Generator,
    *,
    variant: str = "TwoPointsDE",
    population_size: int = 40,
    evaluations: int = 2440,
) -> Proposals:
    """An optimiser of Nevergrad, which proposes whole populations within a budget.

    Settings:
        variant: A name of `nevergrad.optimizers.registry`; `nevergrad:NAME` sets it.
        population_size: Proposals at a time, its `num_workers`, 1 or more.
        evaluations: Budget of a frame, its `budget`, 1 or more; by default the
            search's.
    """
    import nevergrad as ng

    at_least("population_size", population_size, 1)
    at_least("evaluations", evaluations, 1)
    known = ng.optimizers.registry
    if variant not in known:
        raise InputError(
            f"variant must be one of {len(known)} names such as TwoPointsDE, CMA, PSO, "
            f"got {quoted(variant)}"
        )
    numpy_random = GlobalRandom(int(rng.integers(2**31)))
    spread: Any = 0.5
    if space.start is not None:
        spread = np.clip(space.start.spread, 1e-6, 0.5)
    with numpy_random:
        box = ng.p.Array(init=draw_population(space, rng, 1)[0]).set_mutation(
            sigma=spread
        )
        box = box.set_bounds(-1.0, 1.0, method="clipping")
        box.random_state = np.random.RandomState(int(rng.integers(2**31)))
        optimiser: Any = known[variant](
            box, budget=evaluations, num_workers=population_size
        )
        # the library would begin in the middle of the box
        for proposal in draw_population(space, rng, population_size):
            optimiser.suggest(proposal)
    while True:
        with numpy_random:
            candidates = [optimiser.ask() for _ in range(population_size)]
        costs = yield np.array([candidate.value for candidate in candidates])
        with numpy_random:
            for candidate, cost in zip(candidates, costs.tolist(), strict=True):
                optimiser.tell(candidate, cost)


class GlobalRandom:
    """Gives a library a private global NumPy generator inside `with`.

    Some of Nevergrad's optimisers draw from the global one.
    """

    def __init__(self, seed: int) -> None:
        self._own = np.random.RandomState(seed).get_state()

    def __enter__(self) -> None:
        # the user's state, which must not change
        self._outer = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._own)  # noqa: NPY002

    def __exit__(self, *_: object) -> None:
        self._own = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._outer)  # noqa: NPY002


def optuna(
    space: Space,
    rng: np.random.Generator,
    *,
    variant: Sampler = "NSGAIISampler",
    population_size: int = 10,
) -> Proposals:
    """A study of Optuna with a sampler, which proposes whole populations.

    The first population is drawn from the start. NSGAIISampler is quick enough for
    thousands of proposals. TPESampler and GPSampler take milliseconds each, and more
    with every earlier one.

    Settings:
        variant: A sampler of `optuna.samplers`; `optuna:SAMPLER` sets it.
        population_size: Proposals at a time, 1 or more.
    """
    from optuna import create_study, samplers
    from optuna.distributions import FloatDistribution

    at_least("population_size", population_size, 1)
    choices(optuna, locals())
    box: Any = {
        f"x{k:03}": FloatDistribution(-1.0, 1.0) for k in range(space.dimensions)
    }
    with _quiet_optuna():
        study = create_study(
            sampler=getattr(samplers, variant)(seed=int(rng.integers(2**31)))
        )
    # the sampler would begin anywhere, and ignore the prediction
    for proposal in draw_population(space, rng, population_size).tolist():
        study.enqueue_trial(dict(zip(box, proposal, strict=True)))
    while True:
        with _quiet_optuna():
            trials = [study.ask(box) for _ in range(population_size)]
        proposals = []
        for trial in trials:
            proposals.append([trial.params[name] for name in box])
        costs = yield np.array(proposals)
        with _quiet_optuna():
            for trial, cost in zip(trials, costs.tolist(), strict=True):
                study.tell(trial, cost)


@contextmanager
def _quiet_optuna() -> Iterator[None]:
    """Let Optuna log only errors in the body, and restore its level afterwards."""
    from optuna import logging

    before = logging.get_verbosity()
    logging.set_verbosity(logging.ERROR)
    try:
        yield
    finally:
        logging.set_verbosity(before)


def pycma(
    space: Space,
    rng: np.random.Generator,
    *,
    population_size: int = 0,
    spread: float = 0.5,
) -> Proposals:
    """pycma's evolution strategy with its built-in handling of the box.

    It starts around the prediction with the prediction's spread, or anywhere with
    `spread`. When it stops, it starts again.

    Settings:
        population_size (lambda): Size of a population, 5 or more, or 0 for the
            library's choice.
        spread (sigma): First step size without a prediction, in half-ranges of the box,
            above 0. Ours.
    """
    from cma import CMAEvolutionStrategy

    if population_size != 0:
        at_least("population_size", population_size, 5)
    positive("spread", spread)
    d = space.dimensions
    spare = np.zeros(1 if d == 1 else 0)  # pycma cannot search a single dimension
    spreads = np.full(d, spread)
    if space.start is not None:
        spreads = np.maximum(space.start.spread, 1e-6)
    options = {
        "bounds": [-1, 1],
        "CMA_stds": np.append(spreads, spare + spread),
        "verbose": -9,
    }
    # without a seed, and with our generator, pycma does not touch NumPy's global one
    options |= {"seed": np.nan, "randn": lambda *shape: rng.standard_normal(shape)}
    if population_size:
        options["popsize"] = population_size
    while True:
        strategy = CMAEvolutionStrategy(
            np.append(draw_population(space, rng, 1)[0], spare), 1.0, options
        )
        while not strategy.stop():
            population = strategy.ask()
            costs = yield np.array(population)[:, :d]
            strategy.tell(population, costs.tolist())


def pymoo(
    space: Space,
    rng: np.random.Generator,
    *,
    variant: Algorithm = "DE",
    population_size: int = 40,
) -> Proposals:
    """An algorithm of pymoo, whose first population is drawn from the start.

    Settings:
        variant: A single-objective algorithm with a population; `pymoo:NAME` sets it.
        population_size: Size of its population, 5 or more.
    """
    from pymoo.config import Config
    from pymoo.core.problem import Problem
    from pymoo.core.termination import NoTermination
    from pymoo.functions import FunctionLoader
    from pymoo.problems.static import StaticProblem

    at_least("population_size", population_size, 5)
    choices(pymoo, locals())
    hinted = Config.warnings["not_compiled"]
    # pymoo would print a hint once, when functions are loaded
    Config.warnings["not_compiled"] = False
    try:
        FunctionLoader.get_instance()
    finally:
        Config.warnings["not_compiled"] = hinted
    kind = getattr(
        import_module(f"pymoo.algorithms.soo.nonconvex.{variant.lower()}"), variant
    )
    algorithm = kind(
        pop_size=population_size, sampling=draw_population(space, rng, population_size)
    )
    problem = Problem(n_var=space.dimensions, n_obj=1, xl=-1.0, xu=1.0)
    algorithm.setup(problem, termination=NoTermination(), seed=int(rng.integers(2**31)))
    while True:
        population = algorithm.ask()
        costs = yield population.get("X").astype(np.float64)
        algorithm.evaluator.eval(StaticProblem(problem, F=costs[:, None]), population)
        algorithm.tell(infills=population)


def scipy(
    space: Space,
    rng: np.random.Generator,
    *,
    variant: Minimiser = "differential_evolution",
    population_size: int = 40,
) -> Proposals:
    """SciPy's differential evolution, or its dual annealing, one proposal at a time.

    A search that has converged starts again. Dual annealing runs without its local
    search, which needs gradients.

    Settings:
        variant: "differential_evolution" or "dual_annealing"; `scipy:NAME` sets it.
        population_size: Size of differential evolution's population, 5 or more; dual
            annealing ignores it.
    """
    at_least("population_size", population_size, 5)
    choices(scipy, locals())
    run: Callable[[Space, np.random.Generator, Objective], None] = _anneal
    if variant == "differential_evolution":
        run = partial(_evolve, population_size)
    return called_back(run, space, rng)


def _evolve(
    population_size: int, space: Space, rng: np.random.Generator, objective: Objective
) -> None:
    from scipy import optimize

    evolve: Any = optimize.differential_evolution
    box = [(-1.0, 1.0)] * space.dimensions
    settings = {
        "vectorized": True,
        "updating": "deferred",
        "polish": False,
        "maxiter": 10**9,
        "tol": 0.0,
    }
    while True:
        first = draw_population(space, rng, population_size)
        evolve(
            lambda columns: objective(columns.T), box, init=first, rng=rng, **settings
        )


def _anneal(space: Space, rng: np.random.Generator, objective: Objective) -> None:
    from scipy import optimize

    anneal: Any = optimize.dual_annealing
    box = [(-1.0, 1.0)] * space.dimensions
    while True:
        first = draw_population(space, rng, 1)[0]
        anneal(
            lambda row: float(objective(row[None])[0]),
            box,
            x0=first,
            rng=rng,
            no_local_search=True,
        )


class _DroppedError(BaseException):
    """Unwinds the library. It is not an Exception, which the library might catch."""


def called_back(
    run: Callable[[Space, np.random.Generator, Objective], None],
    space: Space,
    rng: np.random.Generator,
) -> Proposals:
    """Yield the proposals of a library that calls its objective itself, in a thread.

    The thread ends with the search: when this generator is dropped, the objective
    raises.
    """
    populations: SimpleQueue[Array | BaseException | None] = SimpleQueue()
    answers: SimpleQueue[Array | None] = SimpleQueue()

    def objective(proposals: Array) -> Array:
        populations.put(np.array(proposals, dtype=np.float64))
        costs = answers.get()
        if costs is None:
            raise _DroppedError
        return costs

    def work() -> None:
        try:
            run(space, rng, objective)
            populations.put(None)
        except _DroppedError:
            pass
        except BaseException as error:  # raised again by the caller's `ask`
            populations.put(error)

    thread = Thread(target=work, daemon=True, name=__name__)
    thread.start()
    try:
        while (population := populations.get()) is not None:
            if isinstance(population, BaseException):
                raise RuntimeError(
                    f"the library failed: {type(population).__name__}: {population}"
                ) from population
            answers.put((yield population))
    finally:
        answers.put(None)
        if not sys.is_finalizing():  # while Python ends, the thread is gone already
            thread.join(LEAVE_SECONDS)
