"""How the models' probabilities and the groups in force fare: what the patent's figure 10 shows, as numbers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit_reproduce.vsmm.activities import ACTIVITIES, Film


@dataclass(frozen=True, eq=False)
class ModelsTold:
    """The models and the groups in force in a frame, and the joints that were seen."""

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
        """Return what a frame's `details` tell; None of a tracker that has no models, or while nothing is seen."""
        if "probabilities" not in frame.details:
            return None
        names = ("groups", "group", "newcomer", "models", "probabilities", "lost", "repairs")
        seen = ("filter_seconds", "detection_seconds", "joints", "confidence")
        return cls(**{name: frame.details[name] for name in (*names, *seen)})


def told_by(frames: Sequence[Frame]) -> list[ModelsTold]:
    """Return what every frame tells; nothing where one of them tells nothing."""
    told = [ModelsTold.of(frame) for frame in frames]
    return [] if None in told else [one for one in told if one is not None]


def switching_figures(seen: Film, told: Sequence[ModelsTold]) -> dict[str, Any]:
    """Return how the models' probabilities and the groups in force fare; nothing where a tracker tells none."""
    if not told:
        return {}
    right = [ACTIVITIES[label].models for label in seen.labels]
    likely = [one.models[int(np.argmax(one.probabilities))] for one in told]
    delays = [_delay(told, first, seen.labels, right[first]) for first in seen.switches]
    settled = [k for k, one in enumerate(told) if one.group is not None and one.newcomer is None]
    smallest = min(len(told[k].models) for k in settled) if settled else 0
    steady = [k for k in settled if len(told[k].models) == smallest]
    return {
        "dominant_fraction": float(np.mean([one.probabilities.max() > 0.5 for one in told])),
        "right_model_fraction": float(np.mean([a in b for a, b in zip(likely, right, strict=True)])),
        "switch_delay_frames": max(delays),
        "switch_delays_frames": delays,
        "filter_ms": 1e3 * float(np.median([told[k].filter_seconds for k in steady or range(len(told))])),
        "detection_ms": 1e3 * float(np.median([one.detection_seconds for one in told])),
        "activations": sum(_came(before, now) for before, now in pairwise(told)),
        "wrong_activations": sum(
            _came(told[k - 1], told[k]) and not right[k] & set(told[k].contending) for k in range(1, len(told))
        ),
        "wrong_terminations": sum(
            bool(set(told[k - 1].models) & right[k]) and not set(told[k].models) & right[k] for k in range(1, len(told))
        ),
        "repairs": int(told[-1].repairs),
        "lost_frames": sum(bool(one.lost) for one in told),
    }


def _delay(told: Sequence[ModelsTold], first: int, labels: Sequence[int], right: frozenset[str]) -> int:
    """Return how many frames after a switch a group with a right model is in force; all of the activity if never."""
    for k in range(first, len(told)):
        if labels[k] != labels[first]:
            return k - first
        one = told[k]
        names = [one.newcomer] if one.newcomer else []
        names += [one.group] if one.group else list(one.groups)  # all of them while a group is chosen
        if any(right & set(one.groups[name]) for name in names):
            return k - first
    return len(told) - first


def _came(before: ModelsTold, now: ModelsTold) -> bool:
    return now.newcomer is not None and now.newcomer != before.newcomer
