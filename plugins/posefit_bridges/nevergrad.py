"""Optimisers of Nevergrad for posefit: `nevergrad:NAME`, a name of `nevergrad.optimizers.registry`.

J. Rapin, O. Teytaud, Nevergrad, a gradient-free optimization platform, 2018. `pip install posefit[nevergrad]`.

>>> import posefit
>>> track = posefit.track("walk", method="nevergrad:OnePlusOne", frames=(0, 3))
>>> track.summary["iou"] > 0.3
True
"""

from typing import Any, final

import numpy as np

from posefit.errors import InputError
from posefit.plugin import Adapter, Array, Space, at_least, draw_population
from posefit.reading import quoted


@final
class Nevergrad(Adapter):
    """An optimiser of Nevergrad, asked for `population_size` proposals at a time, within a budget of `evaluations`.

    Settings:
        variant: a name of `nevergrad.optimizers.registry`; `nevergrad:NAME` sets it.
        population_size: proposals asked for at a time, its `num_workers`, 1 or more.
        evaluations: of a frame, its `budget`, 1 or more; by default that of the search.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        variant: str = "TwoPointsDE",
        population_size: int = 40,
        evaluations: int = 2440,
    ) -> None:
        import nevergrad

        at_least("population_size", population_size, 1)
        at_least("evaluations", evaluations, 1)
        known = nevergrad.optimizers.registry
        if variant not in known:
            raise InputError(
                f"variant must be one of {len(known)} names such as TwoPointsDE, CMA, PSO, got {quoted(variant)}"
            )
        super().__init__(space, draw_population(space, rng, 1)[0])
        rng = np.random.default_rng(int(rng.integers(2**63)))
        self._global = GlobalRandom(int(rng.integers(2**31)))
        with self._global:
            spread = 0.5 if space.start is None else np.clip(space.start.spread, 1e-6, 0.5)
            box = nevergrad.p.Array(init=draw_population(space, rng, 1)[0])
            box = box.set_mutation(sigma=spread).set_bounds(-1.0, 1.0, method="clipping")
            box.random_state = np.random.RandomState(int(rng.integers(2**31)))
            self._optimiser: Any = known[variant](box, budget=evaluations, num_workers=population_size)
            for proposal in draw_population(space, rng, population_size):
                self._optimiser.suggest(proposal)
        self._population_size = population_size
        self._candidates: list[Any] = []

    def propose(self) -> Array:
        """Return the optimiser's next population (n, d)."""
        with self._global:
            self._candidates = [self._optimiser.ask() for _ in range(self._population_size)]
        return np.array([candidate.value for candidate in self._candidates])

    def learn(self, proposals: Array, costs: Array) -> None:
        """Let the optimiser learn the costs (n,)."""
        with self._global:
            for candidate, cost in zip(self._candidates, costs.tolist(), strict=True):
                self._optimiser.tell(candidate, cost)


class GlobalRandom:
    """Lends a library a global numpy generator of its own within `with`, as some of Nevergrad's optimisers need one."""

    def __init__(self, seed: int) -> None:
        self._own = np.random.RandomState(seed).get_state()

    def __enter__(self) -> None:
        self._outer = np.random.get_state()  # noqa: NPY002, the state to be left alone
        np.random.set_state(self._own)  # noqa: NPY002

    def __exit__(self, *_: object) -> None:
        self._own = np.random.get_state()  # noqa: NPY002
        np.random.set_state(self._outer)  # noqa: NPY002
