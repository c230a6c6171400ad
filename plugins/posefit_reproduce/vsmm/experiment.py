"""The experiment of the VSMM patent: trackers on films of its four activities.

There is one film for each seed. The settings of `vsmm` were chosen on films 0 to 4
(`TUNED`); results are reported on films 5 to 14.
"""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.errors import InputError
from posefit.fitting.tracker import Frame, Task
from posefit.motion import built_in
from posefit.tracking.method import prepare
from posefit.tracking.options import EVALUATIONS, TrackOptions
from posefit_reproduce.experiment import Arrays, Run
from posefit_reproduce.vsmm.activities import TRAINING, Film, film_of
from posefit_vsmm.groups import TOPOLOGY
from posefit_vsmm.motion import library

# number of films on which defaults were chosen
TUNED = 5
# frames that are tracked first, so that the times exclude compilation
WARM_UP = 3
# labels of activities; a jump does not occur in the film
LABELS = ("walk", "arms-out", "jacks", "squat", "jump")
# stored details of each frame
DETAILS = ("lost", "joints", "confidence", "filter_seconds", "detection_seconds")
MODELS = library().models.names
GROUPS = tuple(TOPOLOGY.groups.items())
METHODS: dict[str, TrackOptions] = {
    "default": TrackOptions(method="vsmm"),
    "patent": TrackOptions(method="vsmm:patent"),
    "all six models": TrackOptions(method="vsmm", settings={"vsmm.structure": "all"}),
    "patent, all six": TrackOptions(
        method="vsmm:patent", settings={"vsmm.structure": "all"}
    ),
}
# Interpretation V14, on the films on which defaults were chosen
UNRECOVERED = "no recovery"
ALL = METHODS | {
    UNRECOVERED: TrackOptions(method="vsmm", settings={"vsmm.recovery": False})
}


@dataclass(frozen=True)
class Scale:
    """The number of films, all different from those on which defaults were chosen."""

    films: int = 10

    @property
    def runs(self) -> Iterator[Run]:
        """All runs, film by film."""
        if self.films < 1:
            raise InputError(f"films must be at least 1, got {self.films}")
        for seed in range(TUNED, TUNED + self.films):
            for method in METHODS:
                yield Run("reported", "film", method, seed=seed)
        for seed in range(TUNED):
            for method in ("default", UNRECOVERED):
                yield Run("tuned", "film", method, seed=seed)


def film_task(film: Film, evaluations: int) -> Task:
    """Return the task of a film. Its first pose is unknown."""
    yaw = float(film.truth.poses[0, 0])
    place = film.truth.translations[0]
    motions = [built_in.motion(motion) for motion in TRAINING]
    return Task(
        film.body,
        [film.camera],
        evaluations,
        yaw,
        place,
        "aligned",
        film.truth.fps,
        motions,
    )


def perform(run: Run) -> Arrays:
    """Track the film of a seed with a method. The first pose is unknown."""
    film = film_of(run.seed)
    options = ALL[run.method]
    task = film_task(film, options.evaluations or EVALUATIONS)
    with threadpool_limits(1):
        for observations in (film.observations[:WARM_UP], film.observations):
            frames = list(
                prepare(options, task).follow(
                    task, observations, np.random.default_rng(run.seed)
                )
            )
    return arrays_of(frames)


def arrays_of(frames: list[Frame]) -> Arrays:
    """Return the arrays of a track, a row for each frame.

    -1 means no group, no candidate or no label.
    """
    groups = [name for name, _ in GROUPS]
    series: dict[str, list[Any]] = defaultdict(list)
    for frame in frames:
        details = frame.details
        series["poses"].append(frame.pose)
        series["translations"].append(frame.translation)
        series["areas"].append(frame.areas[0])
        series["cpu_seconds"].append(frame.cpu_seconds)
        series["label"].append(_number(frame.activity, LABELS))
        for name in ("group", "candidate_group"):
            series[name].append(_number(details[name], groups))
        for name in DETAILS:
            series[name].append(details[name])
        # of all models, 0 for those that are not active
        probabilities = np.zeros(len(MODELS))
        active = [MODELS.index(name) for name in details["models"]]
        probabilities[active] = details.get("probabilities", 0.0)
        series["probabilities"].append(probabilities)
    return {name: np.array(values) for name, values in series.items()}


def _number(name: str | None, names: Sequence[str]) -> int:
    """Return the number of a name; -1 for None."""
    return -1 if name is None else names.index(name)
