"""How the models' probabilities and the groups in force fare: what the patent's figure 10 shows, as numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import pairwise
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit_reproduce.vsmm.activities import ACTIVITIES, Film


@dataclass(frozen=True, eq=False)
class ModelState:
    """The models and the groups in force in a frame, and the detected joints."""

    groups: Mapping[str, tuple[str, ...]]  # the models of every group there is
    group: str | None  # the one in force; None while one is chosen
    newcomer: str | None  # the one that contends with it
    models: tuple[str, ...]  # in force
    probabilities: Array  # of each of these
    lost: bool
    repairs: int  # of covariances, so far
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
        return cls(**{one.name: frame.details[one.name] for one in fields(cls)})


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
    delays = [_delay(states, first, film.labels, right[first]) for first in film.switches]
    settled = [k for k, one in enumerate(states) if one.group is not None and one.newcomer is None]
    smallest = min(len(states[k].models) for k in settled) if settled else 0
    steady = [k for k in settled if len(states[k].models) == smallest]
    return {
        "dominant_fraction": float(np.mean([one.probabilities.max() > 0.5 for one in states])),
        "right_model_fraction": float(np.mean([a in b for a, b in zip(likely, right, strict=True)])),
        "switch_delay_frames": max(delays),
        "switch_delays_frames": delays,
        "filter_ms": 1e3 * float(np.median([states[k].filter_seconds for k in steady or range(len(states))])),
        "detection_ms": 1e3 * float(np.median([one.detection_seconds for one in states])),
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


def _delay(states: Sequence[ModelState], first: int, labels: Sequence[int], right: frozenset[str]) -> int:
    """Return how many frames after a switch a group with a right model is in force; all of the activity if never."""
    for k in range(first, len(states)):
        if labels[k] != labels[first]:
            return k - first
        one = states[k]
        names = [one.newcomer] if one.newcomer else []
        names += [one.group] if one.group else list(one.groups)  # all of them while a group is chosen
        if any(right & set(one.groups[name]) for name in names):
            return k - first
    return len(states) - first


def _came(before: ModelState, now: ModelState) -> bool:
    return now.newcomer is not None and now.newcomer != before.newcomer
