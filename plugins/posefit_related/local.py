"""Local search by parts: the root first, then limb after limb, each by best-first search.

D. Gavrila, L. Davis, 3-D model-based tracking of humans in action: a multi-view approach, CVPR 1996. Its abstract says
that pose recovery is a search for the pose whose synthesised appearance is most similar to the picture's, by a
decomposition of the space and a best-first technique.

Interpretations: parts are runs of neighbouring coordinates, see `stages`; the neighbours of a pose are a step to either
side in each coordinate of the part; a part ends after some expansions without a better pose; when all parts were
searched without one, the step is halved. Where nothing is predicted, the best of some random poses is the start.
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
SAME_POSE = 1e-9  # poses whose coordinates all differ by less are one


class Local:
    """Best-first search in one part after another, over and over with smaller steps.

    Settings:
        run_length: coordinates of a part after the root's, 1 or more.
        step: between neighbours at first, in half-ranges of the box, above 0.
        patience: expansions without a better pose that end a part, 1 or more.
        evaluations: of a frame, 1 or more. Ours: as many as SAPSO's.
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
        self._step, self._runs, self._part, self._waiting = (
            step,
            runs(space.dimensions, run_length),
            0,
            0,
        )
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
        """File the poses by their costs, and expand the best that was not expanded."""
        check_tell(self._waiting, proposals, costs)
        self._waiting, costs = 0, np.where(np.isnan(costs), np.inf, costs)
        better = bool(costs.min() < self._best_cost)
        if better:
            self._best, self._best_cost = (
                proposals[costs.argmin()].copy(),
                float(costs.min()),
            )
        if not len(self._closed):  # the first poses are of no part
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
        """Return the new neighbours (n, d) of the best pose that was not expanded; later parts where it has none."""
        for _ in range(2 * len(self._runs)):
            while self._open:
                pose = heappop(self._open)[2]  # GAVRILA1996 (best first)
                moves = (
                    np.eye(self._space.dimensions)[self._runs[self._part]] * self._step
                )
                near = repair(self._space, pose + np.concatenate([moves, -moves]), pose)
                new: Array = near[
                    (np.abs(near[:, None] - self._closed).max(axis=2) > SAME_POSE).all(
                        axis=1
                    )
                ]
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
            self._step = (
                self._step if self._improved else max(0.5 * self._step, MIN_STEP)
            )
            self._improved = False
        self._restart()

    def _restart(self) -> None:
        """Begin a part at the best pose so far."""
        self._open = []
        self._closed = self._best[None]
        self._misses = 0
        self._push(self._best_cost, self._best)

    def _push(self, cost: float, pose: Array) -> None:
        self._count += 1  # ties go to the pose that came first
        heappush(self._open, (cost, self._count, pose))
