"""Do VSMM's groups choose good PCA spaces for a swarm? `python docs/studies/subspaces.py`.

`sapso+vsmm` searches the directions in which the filter's covariance is largest. Here the swarm searches instead the
principal components of the poses that the models of the dominating group were fitted to; what the filter predicts is
projected into them, and what is found returns to the filter as a pose. `one space` has the poses of all models. Films
are as in `posefit reproduce vsmm`: the patent's, and a walk, a run, and a walk that becomes a run.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial

import click
import numpy as np
from threadpoolctl import threadpool_limits

from posefit import settings as of_plugins
from posefit.arrays import Array
from posefit.fitting.box import Start
from posefit.fitting.optimiser import minimise
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.registry import registry
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit_priors.pca import PCA
from posefit_reproduce.jobs import each
from posefit_reproduce.vsmm.activities import ACTIVITIES, TRAINING, Activity, film_of
from posefit_reproduce.vsmm.experiment import film_task, patent_errors
from posefit_vsmm import joined
from posefit_vsmm.imm import PLACED, Measurement
from posefit_vsmm.motion import library
from posefit_vsmm.settings import Settings
from posefit_vsmm.state import ERROR, YAW_PITCH_ROLL, decode, encode, free_errors
from posefit_vsmm.switching import Measure, most_probable
from posefit_vsmm.tracker import VSMM, TrackFilter
from table import WORKERS, bar, markdown

COMPONENTS = 12
WEIGHT = 0.25  # of `sapso+vsmm`
METHODS = ("sapso+vsmm", "a space a group", "one space", "sapso@pca")
WALK, RUN = (Activity(name, f"{name}-b", 60, frozenset()) for name in ("walk", "run"))
FILMS: Mapping[str, tuple[tuple[Activity, ...], tuple[str, ...]]] = {
    "the patent's": (ACTIVITIES, TRAINING),
    "walk": ((WALK,), ("walk-a", "run-a")),
    "run": ((RUN,), ("walk-a", "run-a")),
    "walk, then run": ((WALK, RUN), ("walk-a", "run-a")),
}
FIGURES = ("mpjpe_mm", "error_degrees", "iou")


def subspace(models: tuple[str, ...]) -> PCA:
    """Return the principal components of the poses that some models were fitted to."""
    quaternions = np.concatenate([library().models[name].captured for name in models])
    poses, _ = decode(np.column_stack([np.zeros((len(quaternions), 3)), quaternions]), library().reliance)
    space = PCA(components=COMPONENTS, quantile=1.0).fit(poses[:, 3:])
    space.reach = np.array(np.inf)  # what the filter predicts may be far from all of them
    return space


@dataclass(frozen=True, eq=False)
class SubspaceSearch(joined.Search):
    """A search in the subspace of the dominating group, or in one of all models."""

    chosen: bool = True
    spaces: dict[tuple[str, ...], PCA] = field(default_factory=dict, repr=False)
    followed: list[TrackFilter] = field(default_factory=list, repr=False)  # the track that it is part of

    def find(
        self, state: Array, spread: Array, observation: Observation, budget: int, rng: np.random.Generator
    ) -> tuple[Array, int, Measure] | None:
        """Return the best pose (66,), the evaluations that took, and what it measures."""
        if budget < joined.LEAST_BUDGET:
            return None
        poses, places = decode(state[None], self.reliance)
        around = spread + np.diag((joined.LEAST * free_errors(self.task.body.skeleton)) ** 2)
        every = joined.Directions.of(state, around, self.reliance, ERROR, 1.0)
        models = self._models()
        prior = self.spaces[models] = self.spaces.get(models) or subspace(models)
        root = np.maximum(np.sqrt(np.diag(around)[[*YAW_PITCH_ROLL]]), joined.ROOT_LEAST)
        space = SearchSpace(prior, poses[0, :3], joined.REACH * root, places[0], self.task.translation)
        latents = prior.transform(poses[:, 3:])[0]
        deviations = np.sqrt((((every.components @ prior.components.T) * every.high[:, None]) ** 2).sum(axis=0))
        first = space.dimensions - len(latents)
        mean = space.proposals(np.concatenate([space.centre[:first], latents]))
        scale = np.concatenate([np.full(first, 1.0 / joined.REACH), deviations / space.half[first:]])
        space = space.around(space.centre, Start(mean, scale, np.zeros(space.dimensions)))
        problem = PoseProblem(self.task.body, self.task.cameras, observation.silhouettes, space, blank=True)
        optimiser = self.factory(space, rng, **of_plugins.planned(self.factory, {}, budget))

        def posterior(proposals: Array) -> Array:
            doubt = 0.5 / self.weight * (((proposals - mean) / scale) ** 2).sum(axis=1)
            return np.asarray(problem.evaluate(proposals) + doubt)

        best = minimise(posterior, optimiser, budget, budget_known=True)
        pose, place = problem.decode(best.proposal[None])
        best_state = encode(pose, place)[0]

        def measure(one: Array) -> Measurement:
            return Measurement(PLACED.minus(best_state, one), np.eye(ERROR), np.diag(joined.SEARCH_DEVIATIONS**2))

        return pose[0], best.evaluations, measure

    def _models(self) -> tuple[str, ...]:
        models, belief = self.followed[-1]._models, self.followed[-1]._belief
        assert belief is not None
        if not self.chosen:
            return tuple(library().models)
        group = models.group if models.newcomer is None else None
        return tuple(models.groups[group or most_probable(models.topology.groups, models.active, belief.probabilities)])


class SubspaceTracker(VSMM):
    """`sapso+vsmm` with such a search."""

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation."""
        assert isinstance(self.search, SubspaceSearch)
        self.search.followed.append(TrackFilter(self, rng))
        for observation in observations:
            yield self.search.followed[-1].frame(observation)


def figures(method: str, film_name: str, seed: int) -> list[float]:
    """Return the `FIGURES` of a method on the film of a seed."""
    activities, training = FILMS[film_name]
    film, options = film_of(seed, activities), TrackOptions(method=method if "sapso" in method else "sapso+vsmm")
    task = film_task(film, options.budget, training)
    with threadpool_limits(1):
        tracker = prepare(options, task).tracker(task) if "sapso" in method else _subspace_tracker(task, method)
        errors = patent_errors(film, list(tracker.track(film.observations, np.random.default_rng(seed))))
    return [errors[name] for name in FIGURES]


def _subspace_tracker(task: Task, method: str) -> VSMM:
    reliance, factory = library().reliance, registry().optimiser("sapso")
    search = SubspaceSearch(task, reliance, factory, COMPONENTS, WEIGHT, chosen=method == "a space a group")
    return SubspaceTracker(task, Settings(), search)


@click.command()
@click.option("--seeds", type=click.IntRange(1), default=5, show_default=True)
@click.option("--film", type=click.Choice(tuple(FILMS)), multiple=True, default=tuple(FILMS))
@WORKERS
def main(seeds: int, film: tuple[str, ...], workers: int | None) -> None:
    """Print the means over seeds, and the MPJPE of each seed."""
    jobs = {
        (name, method, seed): partial(figures, method, name, seed)
        for name in film
        for seed in range(seeds)
        for method in METHODS
    }
    measured = each(jobs, workers or 1, bar)
    rows = []
    for name in film:
        for method in METHODS:
            values = np.array([measured[name, method, seed] for seed in range(seeds)])
            mm, degrees, iou = values.mean(axis=0)
            every = ", ".join(f"{value:.0f}" for value in values[:, 0])
            rows.append([name, method, f"{mm:.0f}", f"{degrees:.2f}", f"{iou:.2f}", every])
    click.echo("\n".join(markdown(["film", "method", "MPJPE, mm", "degrees", "IoU", "mm of each seed"], rows, 2)))


if __name__ == "__main__":
    main()
