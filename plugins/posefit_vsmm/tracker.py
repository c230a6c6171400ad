"""The variable-structure multiple-model tracker, by name: its settings, checked, and a frame for each observation."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from posefit.fitting.tracker import Frame, Observation, Task
from posefit_vsmm.course import Course
from posefit_vsmm.groups import read_topology
from posefit_vsmm.motion import Shrink, library
from posefit_vsmm.structure import Structure, Switching
from posefit_vsmm.switching import New, Rules, SequentialTest, Test


@dataclass(frozen=True, eq=False)
class VSMM:
    """Follows a person by the joints that rules find in a silhouette, with the motion models of one group at a time."""

    task: Task
    switching: Switching = field(repr=False)

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation; its `details` tell models, probabilities, group and joints."""
        course = Course(self.task, self.switching, rng)
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
    false_alarm: float = SequentialTest.false_alarm,
    miss: float = SequentialTest.miss,
    longest: int = SequentialTest.longest,
) -> VSMM:
    """Variable-structure multiple-model filter on detected joints (CN101894278, 2010).

    The patent's own form: smoothing=1 floor_degrees=0 dwell=0 new=patent test=patent.

    Settings:
        structure: "variable", one group at a time and two while it changes; "all" models always, a plain IMM.
        groups: path of a TOML file of groups and neighbours; "" is the package's own. Step 4, Interpretation V1.
        shrink: what ridge regression drew the models' F towards, "identity" or "zero". Interpretation V5.
        smoothing: frames over which changes of angles are averaged, 1 or more. Interpretation V10; 1 in the patent.
        floor_degrees: a change below it is none, degrees a frame, 0 or more. Interpretation V10; 0 in the patent.
        dwell: frames that a group stays at least, 0 or more. Interpretation V10; 0 in the patent.
        new: how the models of a new group start: "rerun" of the cycle, or the "patent"'s rule. Interpretation V11.
        test: which group has to go: Wald's "sequential" probability ratio test, or the "patent"'s. Interpretation V12.
        false_alarm (alpha): share of wrong groups that are kept, between 0 and 0.5. Interpretation V12.
        miss (beta): share of right groups that the sequential test drops, between 0 and 0.5. Interpretation V12.
        longest: frames after which the more probable group stays, 1 or more. Interpretation V12.
    """
    carried = library(shrink)
    topology = read_topology(Path(groups) if groups else None, carried.names)
    switching = Switching(
        library=carried,
        topology=topology,
        structure=structure,
        rules=Rules(smoothing=smoothing, floor_degrees=floor_degrees, dwell=dwell),
        new=new,
        test=SequentialTest(test=test, false_alarm=false_alarm, miss=miss, longest=longest),
    )
    return VSMM(task, switching)
