"""CMA-ES as the library pycma implements it, for posefit: `pycma`.

N. Hansen, Y. Akimoto, P. Baudis, CMA-ES/pycma on GitHub, 2019. `pip install posefit[pycma]`.

>>> import posefit
>>> track = posefit.track("walk", method="pycma", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from typing import Any, final

import numpy as np

from posefit.plugin import Adapter, Array, Space, at_least, draw_population, positive


@final
class PyCMA(Adapter):
    """pycma's evolution strategy with its own handling of the box.

    It starts around the prediction with its spread, or anywhere with `spread`, and again where it has stopped.

    Settings:
        population_size (lambda): 5 or more, or 0 for the library's own choice.
        spread (sigma): the first step size where no prediction is, in half-ranges of the box, above 0. Ours.
    """

    def __init__(
        self, space: Space, rng: np.random.Generator, *, population_size: int = 0, spread: float = 0.5
    ) -> None:
        if population_size != 0:
            at_least("population_size", population_size, 5)
        positive("spread", spread)
        super().__init__(space, draw_population(space, rng, 1)[0])
        self._rng = np.random.default_rng(int(rng.integers(2**63)))
        self._spare = np.zeros(1 if space.dimensions == 1 else 0)  # pycma cannot search a single dimension
        stds = np.full(space.dimensions, spread) if space.start is None else np.maximum(space.start.spread, 1e-6)
        stds = np.append(stds, self._spare + spread)
        # without a seed, and with our generator, it leaves numpy's global one alone
        self._options = {"bounds": [-1, 1], "CMA_stds": stds, "verbose": -9, "seed": np.nan, "randn": Normal(self._rng)}
        if population_size:
            self._options["popsize"] = population_size
        self._strategy: Any = None
        self._drawn: list[Array] = []  # with the spare dimension

    def propose(self) -> Array:
        """Return the strategy's next population (n, d)."""
        from cma import CMAEvolutionStrategy

        if self._strategy is None or self._strategy.stop():
            first = np.append(draw_population(self._space, self._rng, 1)[0], self._spare)
            self._strategy = CMAEvolutionStrategy(first, 1.0, self._options)
        self._drawn = self._strategy.ask()
        return np.array(self._drawn)[:, : self._space.dimensions]

    def learn(self, proposals: Array, costs: Array) -> None:
        """Let the strategy learn the costs (n,)."""
        self._strategy.tell(self._drawn, costs.tolist())


class Normal:
    """Draws standard normal numbers as `numpy.random.randn` does, from a generator that is copied with it."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def __call__(self, *shape: int) -> Any:
        """Return numbers of a shape, or one number."""
        return self._rng.standard_normal(shape)
