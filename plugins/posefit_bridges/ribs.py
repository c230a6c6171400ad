"""Pyribs for posefit: `ribs`, evolution strategies on an archive of dominated novelty search.

B. Tjanaka et al., pyribs: a bare-bones Python library for quality diversity optimization, GECCO 2023; R. Bahlous-Boldi,
M. Faldor et al., Dominated novelty search: rethinking local competition in quality-diversity, arXiv:2502.00593, 2025;
`pip install posefit[ribs]`.

>>> import posefit
>>> track = posefit.track("walk", method="ribs", frames=(0, 3))
>>> track.summary["iou"] > 0.5
True
"""

from typing import Any, final

import numpy as np

from posefit.plugin import Adapter, Array, Space, at_least, draw_population, positive

MIN_POPULATION_OF_A_STRATEGY = 4  # proposals of a strategy: half of them are its parents
STRATEGIES = 2  # that search at a time
ARCHIVE_CAPACITY = 100  # proposals
NEIGHBOURS = 1  # better ones whose distance counts
POPULATIONS_OF_A_STRATEGY = 40  # until it starts again


@final
class Ribs(Adapter):
    """CMA-ES that restarts from an archive of dominated novelty search: from proposals far from all better ones.

    An archive of 100 proposals keeps those that are farthest from their nearest better ones. Two evolution strategies
    search at a time, and each starts again, after 40 populations, from a random one of them.

    Settings:
        population_size: proposals at a time, those of all strategies together, 4 or more.
        step: first standard deviation of a strategy, in half-ranges of the box, above 0; at most that of the start.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        population_size: int = 24,
        step: float = 0.3,
    ) -> None:
        from ribs.archives import DNSArchive
        from ribs.emitters import EvolutionStrategyEmitter

        at_least("population_size", population_size, MIN_POPULATION_OF_A_STRATEGY)
        positive("step", step)
        self._first = draw_population(space, rng, population_size)
        super().__init__(space, self._first[0])
        self._archive: Any = DNSArchive(
            solution_dim=space.dimensions,
            measure_dim=self._where(self._first).shape[1],
            capacity=ARCHIVE_CAPACITY,
            k_neighbors=NEIGHBOURS,
            seed=int(rng.integers(2**31)),
        )
        if space.start is not None:
            step = min(step, max(float(np.mean(space.start.spread)), 1e-6))
        strategies = min(STRATEGIES, population_size // MIN_POPULATION_OF_A_STRATEGY)
        self._strategies: list[Any] = [
            EvolutionStrategyEmitter(
                self._archive,
                x0=self._first[k],
                sigma0=step,
                ranker="obj",
                selection_rule="mu",
                restart_rule=POPULATIONS_OF_A_STRATEGY,
                batch_size=population_size // strategies + (k < population_size % strategies),
                seed=int(rng.integers(2**31)),
            )
            for k in range(strategies)
        ]

    def propose(self) -> Array:
        """Return the next population (n, d)."""
        if self._archive.empty:
            return self._first
        return np.concatenate([one.ask() for one in self._strategies])

    def learn(self, proposals: Array, costs: Array) -> None:
        """Let the archive choose among its proposals and these, and every strategy learn from its own."""
        values, where, first = -costs, self._where(proposals), self._archive.empty
        added = self._archive.add(proposals, values, where)
        if not first:
            stops = np.cumsum([one.batch_size for one in self._strategies])
            for one, stop in zip(self._strategies, stops.tolist(), strict=True):
                mine = slice(stop - one.batch_size, stop)
                about = {name: value[mine] for name, value in added.items()}
                one.tell(proposals[mine], values[mine], where[mine], about)

    def _where(self, proposals: Array) -> Array:
        """Return points (n, m) as far apart as proposals (n, d) are: what wraps around goes round a circle."""
        turns = proposals[:, self._space.periodic] * np.pi
        return np.column_stack([proposals[:, ~self._space.periodic], np.cos(turns) / np.pi, np.sin(turns) / np.pi])
