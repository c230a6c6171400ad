"""The variable-structure multiple-model tracker, by name: its settings, checked, and a frame for each observation."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from posefit.fitting.tracker import Frame, Observation, Task
from posefit_vsmm.course import Course
from posefit_vsmm.groups import read_topology
from posefit_vsmm.motion import Shrink, library
from posefit_vsmm.structure import Settings, Structure
from posefit_vsmm.switching import Contest, New, Rules, Test


@dataclass(frozen=True, eq=False)
class VSMM:
    """Follows a person by the joints that rules find in a silhouette, with the motion models of one group at a time."""

    task: Task
    settings: Settings = field(repr=False)

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation; its `details` tell models, probabilities, group and joints."""
        course = Course(self.task, self.settings, rng)
        for observation in observations:
            yield course.frame(observation)


def vsmm(
    task: Task,
    *,
    structure: Structure = "variable",
    groups: str = "",
    shrink: Shrink = "identity",
    smoothing: int = Rules.smoothing,
    floor_degrees: float = Rules.floor_degrees,
    dwell: int = Rules.dwell,
    new: New = "rerun",
    test: Test = "sequential",
    false_alarm: float = Contest.false_alarm,
    miss: float = Contest.miss,
    longest: int = Contest.longest,
) -> VSMM:
    """Variable-structure multiple-model filter on detected joints (CN101894278, 2010).

    `structure` "all" is a plain IMM over all models. `groups` is a TOML file of groups, by default the package's.
    `shrink` is Reading V5; `smoothing`, `floor_degrees` and `dwell` are V10; `new` is V11; `test`, `false_alarm`,
    `miss` and `longest` are V12. The patent's own form: smoothing=1 floor_degrees=0 dwell=0 new=patent test=patent.
    """
    carried = library(shrink)
    topology = read_topology(Path(groups) if groups else None, carried.names)
    contest = Contest((), (), test, false_alarm, miss, longest)
    return VSMM(task, Settings(carried, topology, structure, Rules(smoothing, floor_degrees, dwell), new, contest))
