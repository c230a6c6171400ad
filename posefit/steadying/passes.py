"""A track that is followed once more where it went: its root's way is known now, and so is the build.

At first a body of another build is aligned to each mask alone, so that it comes nearer and goes away without a cause,
and a tracker cannot tell from that which way somebody goes. The second time it can.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from posefit.fitting.shape import Shape
from posefit.fitting.tracker import Frame, Task, Tracker
from posefit.footage.scene import Scene
from posefit.listening import Listener
from posefit.searching.spent import mean_cost
from posefit.steadying.frames import steadied_frames

DEARER = 1.125  # times what the pass before it costs: a pass that costs more is not kept
SALT = 2026  # part of the seeds of all passes but the first


@dataclass(frozen=True, eq=False)
class Pass:
    """What came of following all frames."""

    scene: Scene = field(repr=False)  # with the build that fits it
    told: list[Frame] = field(repr=False)  # what is steady
    shape: Shape | None  # of the build, where that was fitted

    @classmethod
    def of(cls, scene: Scene, found: list[Frame], shape: Shape | None, beta: float) -> "Pass":
        """Return what comes of frames that were found in a scene, steadied."""
        told, shape = steadied_frames(scene, found, beta, shape)
        return cls(scene if shape is None else replace(scene, body=shape.body), told, shape)

    @cached_property
    def cost(self) -> float:
        """What the steady frames cost: see `mean_cost`."""
        return mean_cost(self.told, np.array([observation.usable for observation in self.scene.observations]))


def followed_again(
    first: Pass, task: Task, make: Callable[[Scene, Task], Tracker], passes: int, seed: int, beta: float, say: Listener
) -> tuple[list[Pass], int]:
    """Return so many passes, `first` being the first, and which is kept: the last that costs not much more than before.

    `make` makes a tracker of a task. Each pass has the full budget, and follows the one that was kept before it.
    """
    passed, kept = [first], 0
    for number in range(1, passes):
        before = passed[kept]
        scene, way = before.scene, [frame.translation for frame in before.told]
        known = replace(task, body=scene.body, translation="known", anchor=way[0], before=())
        seen = (replace(one, translation=place) for one, place in zip(scene.observations, way, strict=True))
        say.say(f"following once more where it went, pass {number + 1} of {passes}")
        rng = np.random.default_rng([seed, SALT, number])
        found = list(say.progress(make(scene, known).track(seen, rng), scene.count))
        passed.append(Pass.of(scene, found, before.shape, beta))
        if passed[-1].cost <= DEARER * before.cost:
            kept = number
    return passed, kept
