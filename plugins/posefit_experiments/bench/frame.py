"""Where the time of a tracked frame goes: drawing, the prior, the optimiser, or the loop around them."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from typing import Any, cast

import numpy as np

from posefit.arrays import Array
from posefit.fitting.box import Space
from posefit.fitting.optimiser import Filter, NextFrame, Optimiser
from posefit.fitting.prior import Prior
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.fitting.tracker import Observation, Prediction, SynthesisTracker, Task
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Silhouette
from posefit_experiments.bench.timing import fastest
from posefit_filters.annealed import Annealed
from posefit_priors.loose import Loose
from posefit_priors.pca import PCA
from posefit_swarm.pso import PSO
from posefit_swarm.sapso import SAPSO

FRAMES = 4  # of the track; all but the first are predicted
BUDGET = 2440  # evaluations of a frame: the first population and 60 moves
PARTICLES, ITERATIONS = 40, 60
METHODS: dict[str, tuple[Callable[..., Optimiser], NextFrame, type[Prior]]] = {
    "sapso+pca": (partial(SAPSO, population_size=PARTICLES, iterations=ITERATIONS), "start", PCA),
    "sapso+loose": (partial(SAPSO, population_size=PARTICLES, iterations=ITERATIONS), "start", Loose),
    "pso+pca": (partial(PSO, population_size=PARTICLES, iterations=ITERATIONS), "start", PCA),
    "annealed+pca": (partial(Annealed, evaluations=BUDGET), "carry", PCA),
}
PARTS = ("kernel", "prior", "swarm")


def frame_profiles(problem: PoseProblem) -> dict[str, dict[str, float]]:
    """Return the milliseconds of a frame with each method, all in all and by parts, and each part's share of it.

    `kernel` is poses drawn and counted, `prior` proposals made into poses, `swarm` the optimiser, first populations
    included, and `driver` whatever else a tracker does. `overhead` is the whole over kernel and prior, which are the
    evaluations alone. Every part does once more, by itself, what it did in the track.
    """
    tracks = {name: Walk(problem, *method) for name, method in METHODS.items()}
    jobs: dict[str, Callable[[], object]] = {
        f"{name} {part}": getattr(track, part) for name, track in tracks.items() for part in ("whole", *PARTS)
    }
    seconds = fastest(jobs)
    return {
        name: profile(seconds[f"{name} whole"], {part: seconds[f"{name} {part}"] for part in PARTS}) for name in tracks
    }


def profile(whole: float, parts: dict[str, float]) -> dict[str, float]:
    """Return milliseconds and shares of a frame and its parts, from the seconds of a track and of each part alone."""
    parts = {**parts, "driver": whole - sum(parts.values())}
    return {
        "ms": 1e3 * whole / FRAMES,
        **{f"{part}_ms": 1e3 * seconds / FRAMES for part, seconds in parts.items()},
        **{f"{part}_share": seconds / whole for part, seconds in parts.items()},
        "overhead": whole / (parts["kernel"] + parts["prior"]),
    }


@dataclass
class Searched:
    """What an optimiser was asked for in one frame: the box, and each population with its costs."""

    space: SearchSpace
    told: list[tuple[Array, Array]] = field(default_factory=list)


class Walk:
    """The built-in walk, seen by the problem's camera, and the parts of a track of it, each by itself."""

    def __init__(
        self, problem: PoseProblem, make: Callable[..., Optimiser], next_frame: NextFrame, prior: Callable[[], Prior]
    ) -> None:
        motion = built_in.motion("walk", frames=FRAMES, fps=30.0)
        styles = [built_in.motion(name, frames=60, fps=30.0) for name in built_in.other_styles("walk")]
        learned = prior().fit(np.concatenate([style.poses[:, 3:] for style in styles]), motion.skeleton)
        body, cameras = problem.body, problem.cameras
        self._seen = [
            Observation([Silhouette.of(project(body, cameras[0], pose, place))], place)
            for pose, place in zip(motion.poses, motion.translations, strict=True)
        ]
        task = Task(body, cameras, BUDGET, float(motion.poses[0, 0]), motion.translations[0])
        self._make, self._next_frame = make, next_frame
        tilt = Prediction().tilted(learned, styles)
        self._tracker = SynthesisTracker(task, learned, make, next_frame, tilt=tilt)
        watched = _Watched(make)
        watcher = SynthesisTracker(task, learned, watched.make, next_frame, tilt=tilt)
        self.frames = list(watcher.track(self._seen, _rng()))
        self.searches = watched.searches
        self._problems = [
            PoseProblem(body, cameras, observation.silhouettes, search.space)
            for observation, search in zip(self._seen, self.searches, strict=True)
        ]
        self._decoded = [
            [problem.decode(proposals) for proposals, _ in search.told]
            for problem, search in zip(self._problems, self.searches, strict=True)
        ]

    def whole(self) -> None:
        """Track the walk."""
        for _ in self._tracker.track(self._seen, _rng()):
            pass

    def kernel(self) -> None:
        """Draw all poses of the track and count their pixels."""
        for problem, populations in zip(self._problems, self._decoded, strict=True):
            for poses, translations in populations:
                problem.cost(poses, translations)

    def prior(self) -> None:
        """Make poses of all proposals of the track."""
        for problem, search in zip(self._problems, self.searches, strict=True):
            for proposals, _ in search.told:
                problem.decode(proposals)

    def swarm(self) -> Array:
        """Propose all that was proposed, told the same costs; return the last population (n, d)."""
        rng, optimiser, proposals = _rng(), None, np.empty((0, 0))
        for search in self.searches:
            if optimiser is None or self._next_frame == "start":
                optimiser = self._make(search.space, rng)
            else:
                cast(Filter, optimiser).advance(search.space)
            for _, costs in search.told:
                proposals = optimiser.ask()
                optimiser.tell(proposals, costs)
        return proposals


class _Watched:
    """Keeps what the optimisers that it makes are asked and told."""

    def __init__(self, make: Callable[..., Optimiser]) -> None:
        self._factory = make
        self.searches: list[Searched] = []

    def make(self, space: Space, rng: np.random.Generator) -> Optimiser:
        """Return itself around a new optimiser."""
        self._optimiser = self._factory(space, rng)
        self.searches.append(Searched(cast(SearchSpace, space)))
        return self

    def ask(self) -> Array:
        """Return what the optimiser proposes."""
        return self._optimiser.ask()

    def tell(self, proposals: Array, costs: Array) -> None:
        """Tell the optimiser."""
        self.searches[-1].told.append((proposals.copy(), costs.copy()))
        self._optimiser.tell(proposals, costs)

    def advance(self, space: SearchSpace) -> None:
        """Go on to a filter's next frame."""
        self.searches.append(Searched(space))
        cast(Any, self._optimiser).advance(space)


def _rng() -> np.random.Generator:
    return np.random.default_rng(0)
