"""Samplers of Optuna for posefit: `optuna:SAMPLER`, such as `optuna:TPESampler` or `optuna:GPSampler`.

T. Akiba et al., Optuna: a next-generation hyperparameter optimization framework, KDD 2019.
`pip install posefit[optuna]`.

>>> import posefit
>>> track = posefit.track("walk", method="optuna:CmaEsSampler", frames=(0, 3), evaluations=100)
>>> track.summary["iou"] > 0.3
True
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, Literal, final

import numpy as np

from posefit.plugin import Adapter, Array, Space, at_least, choices, draw_population

Variant = Literal["TPESampler", "CmaEsSampler", "GPSampler", "NSGAIISampler", "QMCSampler", "RandomSampler"]


@final
class Optuna(Adapter):
    """A study of Optuna with that sampler, asked for `population_size` proposals at a time, at first from the start.

    NSGAIISampler is quick enough for thousands of proposals; TPESampler and GPSampler take milliseconds each, and more
    with every one before.

    Settings:
        variant: a sampler of `optuna.samplers`; `optuna:SAMPLER` sets it.
        population_size: proposals asked for at a time, 1 or more.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        variant: Variant = "NSGAIISampler",
        population_size: int = 10,
    ) -> None:
        import optuna

        at_least("population_size", population_size, 1)
        choices(Optuna.__init__, locals())
        super().__init__(space, draw_population(space, rng, 1)[0])
        rng = np.random.default_rng(int(rng.integers(2**63)))
        sampler = getattr(optuna.samplers, variant)(seed=int(rng.integers(2**31)))
        with _silence():
            self._study: Any = optuna.create_study(sampler=sampler)
        self._names = [f"x{k:03}" for k in range(space.dimensions)]
        self._box = {name: optuna.distributions.FloatDistribution(-1.0, 1.0) for name in self._names}
        for proposal in draw_population(space, rng, population_size).tolist():
            self._study.enqueue_trial(dict(zip(self._names, proposal, strict=True)))
        self._population_size = population_size
        self._trials: list[Any] = []

    def propose(self) -> Array:
        """Return the study's next population (n, d)."""
        with _silence():
            self._trials = [self._study.ask(self._box) for _ in range(self._population_size)]
        return np.array([[trial.params[name] for name in self._names] for trial in self._trials])

    def learn(self, proposals: Array, costs: Array) -> None:
        """Let the study learn the costs (n,)."""
        with _silence():
            for trial, cost in zip(self._trials, costs.tolist(), strict=True):
                self._study.tell(trial, cost)


@contextmanager
def _silence() -> Iterator[None]:
    """Let Optuna log errors alone in the body, and afterwards what its user wants."""
    from optuna import logging

    before = logging.get_verbosity()
    logging.set_verbosity(logging.ERROR)
    try:
        yield
    finally:
        logging.set_verbosity(before)
