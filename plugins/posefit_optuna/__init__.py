"""Samplers of Optuna for posefit: `optuna:SAMPLER`, such as `optuna:TPESampler` or `optuna:GPSampler`.

T. Akiba et al., Optuna: a next-generation hyperparameter optimization framework, KDD 2019.
`pip install posefit[optuna]`.

>>> import posefit
>>> track = posefit.track("walk", optimiser="optuna:CmaEsSampler", frames=(0, 3), evaluations=100)
>>> track.summary["iou"] > 0.3
True
"""

from functools import partial
from typing import Literal

import numpy as np

from posefit import hookimpl
from posefit.fitting.box import Space, draw_population
from posefit.fitting.bridge import Bridged, Objective
from posefit.fitting.check import at_least, one_of
from posefit.hooks import RegisterOptimiser

Variant = Literal["TPESampler", "CmaEsSampler", "GPSampler", "NSGAIISampler", "QMCSampler", "RandomSampler"]
VARIANTS = ("TPESampler", "CmaEsSampler", "GPSampler", "NSGAIISampler", "QMCSampler", "RandomSampler")


def optuna(
    space: Space, rng: np.random.Generator, *, variant: Variant = "NSGAIISampler", population_size: int = 10
) -> Bridged:
    """A study of Optuna with that sampler, asked for `population_size` proposals at a time, at first from the start.

    NSGAIISampler is quick enough for thousands of proposals; TPESampler and GPSampler take milliseconds each, and more
    with every one before.

    Settings:
        variant: a sampler of `optuna.samplers`; `optuna:SAMPLER` sets it.
        population_size: proposals asked for at a time, 1 or more.
    """
    at_least("population_size", population_size, 1)
    one_of("variant", variant, VARIANTS)
    return Bridged(space, rng, partial(_run, variant, population_size))


def _run(variant: str, population_size: int, space: Space, rng: np.random.Generator, objective: Objective) -> None:
    import optuna

    optuna.logging.set_verbosity(optuna.logging.ERROR)
    sampler = getattr(optuna.samplers, variant)(seed=int(rng.integers(2**31)))
    study = optuna.create_study(sampler=sampler)
    names = [f"x{k:03}" for k in range(space.dimensions)]
    box: dict[str, optuna.distributions.BaseDistribution]
    box = {name: optuna.distributions.FloatDistribution(-1.0, 1.0) for name in names}
    for proposal in draw_population(space, rng, population_size).tolist():
        study.enqueue_trial(dict(zip(names, proposal, strict=True)))
    while True:
        trials = [study.ask(box) for _ in range(population_size)]
        costs = objective(np.array([[trial.params[name] for name in names] for trial in trials]))
        for trial, cost in zip(trials, costs.tolist(), strict=True):
            study.tell(trial, cost)


@hookimpl
def posefit_register_optimisers(register: RegisterOptimiser) -> None:
    """Offer `optuna:SAMPLER`."""
    register("optuna", optuna, needs=("optuna", "posefit[optuna]"))
