"""Groups of models, which switch between each other, and the most probable one. VSMM steps 4 and 5.

A TOML file (Interpretation V1) holds `stay`, a table `groups` of names and their models, and a table `neighbours` of
models and those that they change into. It may hold a table `activities` of names and their models: the labels of
frames. Groups are numbered as in their file: the rules of step 7 speak of the first, the second and the third.
"""

from collections.abc import Collection, Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.check import one_of
from posefit.reading import parsed_toml, quoted, read_text

SIZE_LIMIT = 100_000  # bytes
TABLES = ("groups", "neighbours", "activities")


class Topology(NamedTuple):
    """Groups of models (model sets), in the order in which they are numbered, and a digraph of models' neighbours."""

    groups: Mapping[str, tuple[str, ...]]
    neighbours: Mapping[str, tuple[str, ...]]
    activities: Mapping[str, tuple[str, ...]]  # each model is in one at least
    stay: float

    def transition(self, models: Sequence[str]) -> Array:
        """Return how probable each of some models (r, r) is after each: `stay`, the rest among its neighbours there.

        A model without a neighbour there may change into any, as a group of its own can only be left that way.
        """
        matrix = np.zeros((len(models), len(models)))
        for i, name in enumerate(models):
            others = [j for j, other in enumerate(models) if other in self.neighbours[name] and j != i]
            others = others or [j for j in range(len(models)) if j != i]
            matrix[i, others] = (1.0 - self.stay) / max(1, len(others))
            matrix[i, i] = self.stay if others else 1.0
        return matrix

    def union(self, names: Collection[str]) -> tuple[str, ...]:
        """Return the models of some groups, each once, in the order of the groups."""
        chosen = (models for name, models in self.groups.items() if name in names)
        return tuple(dict.fromkeys(model for models in chosen for model in models))


def most_probable(sets: Mapping[str, Sequence[str]], models: Sequence[str], probabilities: Array) -> str:
    """Return the name of the set, a group or an activity, whose models are the most probable together."""
    known = dict(zip(models, probabilities, strict=True))
    return max(sets, key=lambda name: sum(known.get(model, 0.0) for model in sets[name]))


def read_topology(path: str | Path, known: Collection[str]) -> Topology:
    """Return the topology of a TOML file, "" for the package's own. Raises ValueError naming a file that is none."""
    label = str(path) or "groups.toml"
    try:
        text = read_text(path, SIZE_LIMIT) if path else (files("posefit_vsmm") / label).read_text("utf-8")
        values = {"activities": {}, **parsed_toml(text)}
    except FileNotFoundError:
        raise InputError(f"{label}: expected a file of groups, got none") from None
    except ValueError as error:
        raise InputError(f"{label}: expected TOML with stay, groups and neighbours, got {error}") from None
    if set(values) != {"stay", *TABLES}:
        raise InputError(f"{label}: expected stay, groups and neighbours, got {sorted(values)}")
    stay = values["stay"]
    if not isinstance(stay, float) or not 0.0 < stay < 1.0:
        raise InputError(f"{label}: stay must be a number between 0 and 1, got {quoted(stay)}")
    for key in TABLES:
        if not isinstance(values[key], dict) or not all(isinstance(models, list) for models in values[key].values()):
            raise InputError(f"{label}: {key} must be a table of lists of models, got {quoted(values[key])}")
    tables = [{name: tuple(dict.fromkeys(models)) for name, models in values[key].items()} for key in TABLES]
    groups, neighbours, activities = tables
    if not groups or not all(groups.values()):
        raise InputError(f"{label}: groups must hold at least one group of at least one model, got {values['groups']}")
    used = {*neighbours}.union(*groups.values())
    for model in used.union(*neighbours.values(), *activities.values()):
        one_of(f"{label}: a model", model, known)
    activities |= {model: (model,) for model in known if not any(model in models for models in activities.values())}
    return Topology(groups, {model: neighbours.get(model, ()) for model in used}, activities, stay)  # VSMM 4
