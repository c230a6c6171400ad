"""One search in the first frame, watched from iteration to iteration; and the compact space that it is in."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from posefit.arrays import Array
from posefit.fitting.space import SearchSpace
from posefit.footage.scene import Scene
from posefit.tracking.front import track
from posefit_priors.pca import PCA
from posefit_reproduce.sapso.design import DRIVEN, Scale
from posefit_reproduce.sapso.motions import PaperMotion, paper_scene
from posefit_swarm.sapso import SAPSO


def compact_space(motion: PaperMotion) -> PCA:
    """Return the compact space of a motion."""
    return PCA().fit(motion.angles)


@dataclass(frozen=True, eq=False)
class WatchedSwarm:
    """A swarm in the first frame, from iteration to iteration."""

    scene: Scene
    poses: Sequence[Array] = field(repr=False)  # of each iteration (n, 66)
    translations: Sequence[Array] = field(repr=False)  # of each iteration (n, 3)
    best: Sequence[int]  # of each iteration, the proposal of lowest cost
    history: Array = field(repr=False)  # (iterations + 1,) lowest cost so far


@dataclass(eq=False)
class _Search:
    """The proposals of a search."""

    space: SearchSpace
    asked: list[Array] = field(default_factory=list)
    best: list[int] = field(default_factory=list)


def watched_swarm(motion: PaperMotion, scale: Scale, particles: int, seed: int = 0) -> WatchedSwarm:
    """Return the proposals of SAPSO in the first frame."""
    scene = paper_scene(motion, scale.shown, (0, 1), scale.first_yaw)
    searches: list[_Search] = []

    class Watched:
        def __init__(
            self, space: SearchSpace, rng: np.random.Generator, *, population_size: int, iterations: int
        ) -> None:
            self._optimiser = SAPSO(space, rng, population_size=population_size, iterations=iterations)
            self._seen = _Search(space)
            searches.append(self._seen)

        def ask(self) -> Array:
            proposals = self._optimiser.ask()
            if len(proposals):
                self._seen.asked.append(proposals)
            return proposals

        def tell(self, proposals: Array, costs: Array) -> None:
            self._seen.best.append(int(np.argmin(costs)))
            self._optimiser.tell(proposals, costs)

    result = track(
        scene,
        optimiser=Watched,
        method="@pca",
        train=motion.training,
        population_size=particles,
        iterations=scale.iterations,
        settings=DRIVEN,
        seed=seed,
    )
    search = searches[-1]  # the one before it only compiles
    decoded = [search.space.decode(proposals) for proposals in search.asked]
    return WatchedSwarm(
        scene, [one[0] for one in decoded], [one[1] for one in decoded], search.best, result.estimates[0].history
    )
