"""Groups of motion models, and the most probable group. VSMM steps 4 and 5."""

from collections.abc import Collection, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array


class Topology(NamedTuple):
    """Groups of models (model sets), and a digraph of the models' neighbours."""

    groups: Mapping[str, tuple[str, ...]]  # in the order of their numbers
    neighbours: Mapping[str, tuple[str, ...]]  # the models that each switches into
    activities: Mapping[str, tuple[str, ...]]  # the labels of frames, and their models
    # the probability that a model is kept; its neighbours share the rest
    stay: float

    def transition(self, models: Sequence[str]) -> Array:
        """Return the transition matrix (r, r) over some of the models.

        A model is kept with probability `stay`; its neighbours among `models` share the
        rest equally. A model with no neighbour there may switch into any of the others;
        otherwise it could never be left.
        """
        matrix = np.zeros((len(models), len(models)))
        for i, name in enumerate(models):
            neighbours = []
            others = []
            for j, other in enumerate(models):
                if j == i:
                    continue
                others.append(j)
                if other in self.neighbours[name]:
                    neighbours.append(j)
            successors = neighbours or others
            if not successors:  # the only model
                matrix[i, i] = 1.0
                continue
            matrix[i, successors] = (1.0 - self.stay) / len(successors)
            matrix[i, i] = self.stay
        return matrix

    def union(self, names: Collection[str]) -> tuple[str, ...]:
        """Return the models of some groups, each once, in the order of the groups."""
        chosen: dict[str, None] = {}  # an ordered set
        for name, models in self.groups.items():
            if name in names:
                chosen |= dict.fromkeys(models)
        return tuple(chosen)


def most_probable(
    sets: Mapping[str, Sequence[str]], models: Sequence[str], probabilities: Array
) -> str:
    """Return the name of the group or activity with the highest total probability."""
    known = dict(zip(models, probabilities, strict=True))

    def total(name: str) -> float:
        return float(sum(known.get(model, 0.0) for model in sets[name]))

    return max(sets, key=total)


# Interpretation V1. The rules of step 7 name the first, second and third group.
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
