"""How the models' probabilities and the groups in force fare: what the patent's figure 10 shows, as numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit_reproduce.vsmm.activities import ACTIVITIES, Film

# the film's activity that each label stands for; a jump is none of them
LABELS = {"walk": 0, "arms-out": 1, "jacks": 2, "squat": 3}


@dataclass(frozen=True, eq=False)
class ModelState:
    """The models and the groups in force in a frame, and the detected joints."""

    groups: Mapping[str, tuple[str, ...]]  # the models of every group there is
    group: str | None  # the one in force; None while one is chosen
    newcomer: str | None  # the one that contends with it
    models: tuple[str, ...]  # in force
    probabilities: Array  # of each of these
    activity: str | None  # the label
    lost: bool
    repairs: int  # of covariances, so far
    restarts: int  # of all models, so far
    filter_seconds: float
    detection_seconds: float
    joints: Array = field(repr=False)  # (views, 17, 2) pixels
    confidence: Array = field(repr=False)  # (views, 17)

    @property
    def contending(self) -> tuple[str, ...]:
        """The models of the newcomer."""
        return () if self.newcomer is None else self.groups[self.newcomer]

    @classmethod
    def of(cls, frame: Frame) -> Self | None:
        """Return the state in a frame's `details`; None for a tracker without models."""
        if "probabilities" not in frame.details:
            return None
        details = {**frame.details, "activity": frame.activity}
        return cls(**{one.name: details[one.name] for one in fields(cls)})


def model_states(frames: Sequence[Frame]) -> list[ModelState]:
    """Return the state in every frame; an empty list where one has none."""
    states = [ModelState.of(frame) for frame in frames]
    return [] if None in states else [one for one in states if one is not None]


def switching_figures(film: Film, states: Sequence[ModelState]) -> dict[str, Any]:
    """Return how the models' probabilities and the groups in force fare; nothing for a tracker without models."""
    if not states:
        return {}
    right = [ACTIVITIES[label].models for label in film.labels]
    likely = [one.models[int(np.argmax(one.probabilities))] for one in states]
    right_group = [bool(_group_models(state) & models) for state, models in zip(states, right, strict=True)]
    delays = [_delay(right_group, first, film.labels) for first in film.switches]
    return {
        "dominant_fraction": float(np.mean([one.probabilities.max() > 0.5 for one in states])),
        "right_model_fraction": float(np.mean([a in b for a, b in zip(likely, right, strict=True)])),
        "right_group_fraction": float(np.mean(right_group)),
        "restarts": int(states[-1].restarts),
        **activity_figures(film, states),
        "switch_delay_frames": max(delays),
        "switch_delays_frames": delays,
        "filter_ms": 1e3 * float(np.mean([one.filter_seconds for one in states])),
        "detection_ms": 1e3 * float(np.mean([one.detection_seconds for one in states])),
        "activations": sum(_came(before, now) for before, now in pairwise(states)),
        "wrong_activations": sum(
            _came(states[k - 1], states[k]) and not right[k] & set(states[k].contending) for k in range(1, len(states))
        ),
        "wrong_terminations": sum(
            bool(set(states[k - 1].models) & right[k]) and not set(states[k].models) & right[k]
            for k in range(1, len(states))
        ),
        "repairs": int(states[-1].repairs),
        "lost_frames": sum(bool(one.lost) for one in states),
    }


def _delay(right_group: Sequence[bool], first: int, labels: Sequence[int]) -> int:
    """Return how many frames after a switch a group with a right model is in force; all of the activity if never."""
    for k in range(first, len(labels)):
        if right_group[k] or labels[k] != labels[first]:
            return k - first
    return len(labels) - first


def _group_models(state: ModelState) -> set[str]:
    """Return the models of the group in force and of the one that contends with it; none while one is chosen."""
    return {model for name in (state.group, state.newcomer) if name is not None for model in state.groups[name]}


def activity_figures(film: Film, states: Sequence[ModelState]) -> dict[str, Any]:
    """Return how well the frames' labels name the activity.

    `confusion` has the frames of each true activity by label, the last column being a label of none; chance always says
    the commonest activity.
    """
    counts = np.zeros((len(ACTIVITIES), len(ACTIVITIES) + 1), dtype=np.int64)
    for state, label in zip(states, film.labels, strict=True):
        counts[label, LABELS.get(state.activity or "", len(ACTIVITIES))] += 1
    right = np.trace(counts)
    chance = counts.sum(axis=1).max() / counts.sum()
    return {"activity_accuracy": float(right / counts.sum()), "chance": float(chance), "confusion": counts.tolist()}


def _came(before: ModelState, now: ModelState) -> bool:
    return now.newcomer is not None and now.newcomer != before.newcomer
