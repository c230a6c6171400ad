"""Local search by parts: the root, then limb after limb, each by best-first search.

D. Gavrila, L. Davis, 3-D model-based tracking of humans in action: a multi-view
approach, CVPR 1996. According to its abstract, pose recovery is a search for the pose
with the synthesised appearance most similar to the picture's. It decomposes the space
and uses a best-first technique.

Interpretations: parts are runs of neighbouring coordinates, see `stages`. The
neighbours of a pose are one step to either side in each coordinate of the part. A part
ends after some expansions without a better pose. If a round over all parts finds none,
the step is halved. Without a prediction, the search starts from the best of some random
poses.
"""

from heapq import heappop, heappush

import numpy as np

from posefit.plugin import (
    Array,
    Space,
    at_least,
    check_tell,
    positive,
    repair,
    sample_normal,
)
from posefit_related.stages import EVALUATIONS, first_population, runs

MIN_STEP = 1e-3  # ours: half-ranges of the box
# poses are equal if all their coordinates differ by less
SAME_POSE = 1e-9


class Local:
    """Best-first search in one part after another, in rounds with smaller steps.

    Settings:
        run_length: Number of coordinates of a part after the root's, 1 or more.
        step: First distance between neighbours, in half-ranges of the box, above 0.
        patience: Expansions without a better pose that end a part, 1 or more.
        evaluations: Budget of a frame, 1 or more. Ours: as many as SAPSO's.
    """

    def __init__(
        self,
        space: Space,
        rng: np.random.Generator,
        *,
        run_length: int = 6,
        step: float = 0.1,
        patience: int = 2,
        evaluations: int = EVALUATIONS,
    ) -> None:
        at_least("run_length", run_length, 1)
        positive("step", step)
        at_least("patience", patience, 1)
        at_least("evaluations", evaluations, 1)
        self._space = space
        self._rng = rng
        self._patience = patience
        self._step = step
        self._runs = runs(space.dimensions, run_length)
        self._part = 0
        self._waiting = 0
        self._next = first_population(space, rng, evaluations)
        self._best = self._next[0]
        self._best_cost = np.inf
        self._improved = False
        # poses to expand, the best first
        self._open: list[tuple[float, int, Array]] = []
        self._closed = self._next[:0]
        self._misses = 0
        self._count = 0

    def ask(self) -> Array:
        """Return the neighbours (n, d) of the most promising pose."""
        self._waiting = len(self._next)
        return self._next.copy()

    def tell(self, proposals: Array, costs: Array) -> None:
        """File the poses by their costs, and expand the best one not yet expanded."""
        check_tell(self._waiting, proposals, costs)
        self._waiting = 0
        costs = np.where(np.isnan(costs), np.inf, costs)
        better = bool(costs.min() < self._best_cost)
        if better:
            self._best = proposals[costs.argmin()].copy()
            self._best_cost = float(costs.min())
        if not len(self._closed):  # the first poses belong to no part
            self._restart()
        else:
            self._improved |= better
            self._misses = 0 if better else self._misses + 1
            self._closed = np.concatenate([self._closed, proposals])
            for cost, pose in zip(costs.tolist(), proposals, strict=True):
                self._push(cost, pose)
            if self._misses >= self._patience:
                self._next_part()
        self._next = self._expanded()

    def _expanded(self) -> Array:
        """Return the new neighbours (n, d) of the best pose not yet expanded.

        If the part has none, later parts are tried, and then random poses near the
        best.
        """
        for _ in range(2 * len(self._runs)):
            while self._open:
                pose = heappop(self._open)[2]  # GAVRILA1996 (best first)
                moves = (
                    np.eye(self._space.dimensions)[self._runs[self._part]] * self._step
                )
                near = repair(self._space, pose + np.concatenate([moves, -moves]), pose)
                away = np.abs(near[:, None] - self._closed).max(axis=2)  # (n, closed)
                new: Array = near[(away > SAME_POSE).all(axis=1)]
                if len(new):
                    return new
            self._next_part()
        return sample_normal(
            self._space,
            self._rng,
            self._best[None],
            np.full(self._space.dimensions, self._step),
        )

    def _next_part(self) -> None:
        self._part = (self._part + 1) % len(self._runs)  # GAVRILA1996 (decomposition)
        if self._part == 0:
            if not self._improved:
                self._step = max(0.5 * self._step, MIN_STEP)
            self._improved = False
        self._restart()

    def _restart(self) -> None:
        """Begin a part at the best pose so far."""
        self._open = []
        self._closed = self._best[None]
        self._misses = 0
        self._push(self._best_cost, self._best)

    def _push(self, cost: float, pose: Array) -> None:
        self._count += 1  # orders poses of equal cost by age
        heappush(self._open, (cost, self._count, pose))
