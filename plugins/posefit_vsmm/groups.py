"""Groups of models, which switch between each other, and the most probable one. VSMM steps 4 and 5."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array


class Topology(NamedTuple):
    """Groups of models (model sets), in the order in which they are numbered, and a digraph of models' neighbours."""

    groups: Mapping[str, tuple[str, ...]]
    neighbours: Mapping[str, tuple[str, ...]]  # which models each changes into
    activities: Mapping[str, tuple[str, ...]]  # the labels of frames, and their models
    # how probable it is that a model goes on; the rest is shared among its neighbours
    stay: float

    def transition(self, models: Sequence[str]) -> Array:
        """Return how probable each of some models (r, r) is after each: `stay`, the rest among its neighbours there.

        A model without a neighbour there may change into any, as a group of its own can only be left that way.
        """
        matrix = np.zeros((len(models), len(models)))
        for i, name in enumerate(models):
            others = [
                j
                for j, other in enumerate(models)
                if other in self.neighbours[name] and j != i
            ]
            others = others or [j for j in range(len(models)) if j != i]
            matrix[i, others] = (1.0 - self.stay) / max(1, len(others))
            matrix[i, i] = self.stay if others else 1.0
        return matrix

    def union(self, names: Collection[str]) -> tuple[str, ...]:
        """Return the models of some groups, each once, in the order of the groups."""
        chosen = (models for name, models in self.groups.items() if name in names)
        return tuple(dict.fromkeys(model for models in chosen for model in models))


def most_probable(
    sets: Mapping[str, Sequence[str]], models: Sequence[str], probabilities: Array
) -> str:
    """Return the name of the set, a group or an activity, whose models are the most probable together."""
    known = dict(zip(models, probabilities, strict=True))
    return max(
        sets, key=lambda name: sum(known.get(model, 0.0) for model in sets[name])
    )


# Interpretation V1. The rules of step 7 speak of the first, the second and the third group.
TOPOLOGY = Topology(
    groups={  # VSMM 4
        "G1": ("stiff-walk", "walk", "arms-out"),
        "G2": ("arms-out", "jacks", "jump"),
        "G3": ("jacks", "jump", "squat"),
    },
    neighbours={
        "stiff-walk": ("walk", "arms-out"),
        "walk": ("stiff-walk", "arms-out"),
        "arms-out": ("stiff-walk", "walk", "jacks", "jump"),
        "jacks": ("arms-out", "jump", "squat"),
        "jump": ("arms-out", "jacks", "squat"),
        "squat": ("jacks", "jump"),
    },
    activities={
        "walk": ("stiff-walk", "walk"),
        "arms-out": ("arms-out",),
        "jacks": ("jacks",),
        "jump": ("jump",),
        "squat": ("squat",),
    },
    stay=0.92,
)
