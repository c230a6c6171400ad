"""The problem an optimiser solves: which proposal's body has the observed silhouettes?"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, TypeVar, final

import numpy as np

from posefit.arrays import Array, writeable
from posefit.fitting.alignment import align
from posefit.fitting.optimiser import Optimiser
from posefit.fitting.space import SearchSpace
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.cost import BETA, Areas, areas, costs_in, drawing_of, mismatch
from posefit.silhouette.mask import Silhouette
from posefit.silhouette.pyramid import coarser_camera, coarser_silhouette
from posefit.silhouette.sharing import parts_of, work_through

FACTORS = (1, 2, 4)  # full, half and quarter size
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class PoseProblem:
    """One observation, from one camera or several, and the space in which its pose is sought. SAPSO (5).

    `evaluate` is pure: a proposal's cost has the same bits whatever stands beside it and however many threads work.
    """

    body: Body = field(repr=False)
    cameras: Sequence[Camera]
    silhouettes: Sequence[Silhouette] = field(repr=False)
    space: SearchSpace
    beta: float = BETA
    threads: int = 1
    blank: bool = False  # whether nobody may be seen at all, as it happens in the middle of a track
    _coarser: dict[int, "PoseProblem"] = field(init=False, repr=False, default_factory=dict)

    def __post_init__(self) -> None:
        if len(self.cameras) != len(self.silhouettes) or not self.cameras:
            raise ValueError(f"silhouettes must be one a camera ({len(self.cameras)}), got {len(self.silhouettes)}")
        for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True):
            if silhouette.size != (camera.width, camera.height):
                size = (camera.height, camera.width)
                raise ValueError(f"mask must have shape {size}, the camera's, got {silhouette.mask.shape}")
        if not self.blank and not any(silhouette.mask.any() for silhouette in self.silhouettes):
            raise ValueError("silhouettes must show a person, got an empty mask")
        if not 0.0 <= self.beta <= 1.0:
            raise ValueError(f"beta must lie in 0 to 1, got {self.beta}")
        if self.threads < 1:
            raise ValueError(f"threads must be at least 1, got {self.threads}")

    def evaluate(self, proposals: Array) -> Array:
        """Return the cost (n,), 0 to 100, of proposals (n, d): the mean over the views. SAPSO (4)."""
        proposals = writeable(proposals)
        if proposals.shape[1:] != (self.space.dimensions,):
            self.space.decode(proposals)  # says what is wrong
        if self.on_device:
            return self.combined(self._areas_on_device(proposals))
        parts = parts_of(len(proposals), self.threads)
        if len(parts) == 1:
            return self._cost(*self.decode(proposals))  # SAPSO (5)
        costs = np.empty(len(proposals))

        def count(part: slice, poses: Array, translations: Array) -> None:
            costs[part] = self._cost(poses, self._aligned(poses, translations))

        work_through(parts, self.threads, lambda part: self.space.decode(proposals[part]), count)
        return costs

    def evaluate_at(self, proposals: Array, factors: Sequence[int] = FACTORS) -> Array:
        """Return the costs (factors, n) of proposals (n, d) at full size (1), half size (2), quarter size (4), ...

        A proposal is decoded once, and means the same pose at every size. Costs at another size than the full one are
        estimates, to look with first: what a search finds is told at full size.
        """
        poses, translations = self.decode(proposals)
        sizes = [self if factor == 1 else self.coarser(factor) for factor in factors]
        return np.array([size.cost(poses, translations) for size in sizes]).reshape(len(factors), len(poses))

    def coarser(self, factor: int) -> "PoseProblem":
        """Return the problem as it is seen through every `factor`th pixel of every `factor`th row; made once.

        It has the same space, and a proposal means the same pose. See `posefit.silhouette.pyramid`.
        """
        if factor not in self._coarser:
            self._coarser[factor] = replace(
                self,
                cameras=[coarser_camera(camera, factor) for camera in self.cameras],
                silhouettes=[coarser_silhouette(silhouette, factor) for silhouette in self.silhouettes],
                blank=True,  # nothing of a small silhouette may be left
            )
        return self._coarser[factor]

    def decode(self, proposals: Array) -> tuple[Array, Array]:
        """Return the poses (n, 66) and translations (n, 3) of proposals (n, d), aligned where the space asks it."""
        poses, translations = self.space.decode(proposals)
        return poses, self._aligned(poses, translations)

    def cost(self, poses: Array, translations: Array) -> Array:
        """Return the cost (n,) of poses (n, 66) with their root at translations (n, 3)."""
        return self.combined(self.areas(poses, translations))

    def combined(self, counts: Sequence[Areas]) -> Array:
        """Return the cost (n,) of areas R, B, Y (n, 3), one array a view."""
        return over_views(counts, self.silhouettes, self.beta)

    def areas(self, poses: Array, translations: Array) -> list[Areas]:
        """Return R, B, Y (n, 3) of each view."""
        return [
            areas(self.body, camera, silhouette, poses, translations, self.threads)
            for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True)
        ]

    @cached_property
    def on_device(self) -> bool:
        """Whether a GPU draws the poses: then all of them at once, and threads have nothing to share."""
        return any(silhouette.device != "cpu" for silhouette in self.silhouettes)

    @cached_property
    def _drawings(self) -> Sequence[tuple[tuple[Any, ...], Silhouette]]:
        """The views that have a say, as the kernel wants them."""
        views = [
            (drawing_of(self.body, camera, silhouette), silhouette)
            for camera, silhouette in zip(self.cameras, self.silhouettes, strict=True)
        ]
        return with_a_say(views, self.silhouettes)

    def _cost(self, poses: Array, translations: Array) -> Array:
        """Return the cost (n,) of decoded poses (n, 66) at translations (n, 3), on one thread."""
        return mean_of([costs_in(*view, poses, translations, self.beta) for view in self._drawings])

    def _areas_on_device(self, proposals: Array) -> list[Areas]:
        """Return R, B, Y (n, 3) of each view, of proposals (n, d) that a GPU decodes where it can."""
        from posefit.fitting.cuda.evaluating import areas_of_proposals, decodes

        if decodes(self.space):
            return areas_of_proposals(self.body, self.cameras, self.silhouettes, self.space, proposals)
        return self.areas(*self.decode(proposals))

    def _aligned(self, poses: Array, translations: Array) -> Array:
        """Return the translations (n, 3) of decoded poses (n, 66): other ones where the space has them aligned."""
        if self.space.translation != "aligned":
            return translations
        return align(self.body, self.cameras, self.silhouettes, poses, translations)


def over_views(counts: Sequence[Areas], silhouettes: Sequence[Silhouette], beta: float = BETA) -> Array:
    """Return the cost (n,) of areas R, B, Y (n, 3), one array a view; one of which nothing is known has no say."""
    return mean_of([mismatch(view, beta) for view in with_a_say(counts, silhouettes)])


def mean_of(costs: Sequence[Array]) -> Array:
    """Return the mean (n,) of costs (n,), one array a view. The first of them is overwritten."""
    total = costs[0]
    for more in costs[1:]:
        total += more
    return total if len(costs) == 1 else total / len(costs)


def with_a_say(views: Sequence[T], silhouettes: Sequence[Silhouette]) -> Sequence[T]:
    """Return those views of which something is known; all of them where nothing is."""
    return [view for view, silhouette in zip(views, silhouettes, strict=True) if silhouette.known] or views


def only_camera(cameras: Sequence[Camera], silhouettes: Sequence[Silhouette]) -> Camera | None:
    """Return the camera that alone sees something of the person, and not how far he is; None where several do."""
    seeing = with_a_say(cameras, silhouettes)
    return seeing[0] if len(seeing) == 1 else None


@final
class CoarseFirst:
    """An optimiser whose populations are looked at in a small picture first; only the best of each go on.

    `ask` proposes those alone, so what the driver counts, keeps and reports are costs at full size. `tell` tells the
    optimiser its whole population: theirs as they are, and of the others the small picture's, none below the worst of
    those that were seen whole. The small picture's poses are drawn as well, and counted by their share of the pixels.

    Settings:
        factor: the picture has every so many pixels of every so many rows, see `PoseProblem.coarser`.
        keep: share of a population that goes on, above 0 and at most 1; at least one proposal.
    """

    def __init__(self, optimiser: Optimiser, problem: PoseProblem, *, factor: int = 2, keep: float = 0.25) -> None:
        if not 0.0 < keep <= 1.0:
            raise ValueError(f"keep must be above 0 and at most 1, got {keep}")
        self._optimiser, self._look, self._keep = optimiser, problem.coarser(factor).evaluate, keep
        self._population = self._costs = np.empty(0)
        self._kept = np.empty(0, dtype=np.intp)

    def ask(self) -> Array:
        """Return the best (k, d) of the next population, judged by the small picture."""
        self._population = self._optimiser.ask()
        if not len(self._population):
            return self._population
        self._costs = self._look(self._population)
        kept = max(round(self._keep * len(self._population)), 1)
        self._kept = np.sort(np.argsort(self._costs, kind="stable")[:kept])
        return np.asarray(self._population[self._kept])

    def tell(self, proposals: Array, costs: Array) -> None:  # noqa: ARG002 - they are what `ask` returned
        """Tell the optimiser its population, with the costs (k,) of what `ask` returned."""
        told = np.fmax(self._costs, np.fmax.reduce(costs))
        told[self._kept] = costs
        self._optimiser.tell(self._population, told)
