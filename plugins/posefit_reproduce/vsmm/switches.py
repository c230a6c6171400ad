"""How the models' probabilities and the groups in force fare: what the patent's figure 10 shows, as numbers."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from posefit.fitting.tracker import Frame
from posefit_reproduce.vsmm.activities import ACTIVITIES, Film

# the film's activity that each label stands for; a jump is none of them
LABELS = {"walk": 0, "arms-out": 1, "jacks": 2, "squat": 3}
State = Mapping[str, Any]  # a frame's `details` by the vsmm tracker, and its `activity`


def model_states(frames: Sequence[Frame]) -> list[State]:
    """Return the models and the groups in force in every frame; an empty list for a tracker without models."""
    if not all("probabilities" in frame.details for frame in frames):
        return []
    return [{**frame.details, "activity": frame.activity} for frame in frames]


def switching_figures(film: Film, states: Sequence[State]) -> dict[str, Any]:
    """Return how the models' probabilities and the groups in force fare; nothing for a tracker without models."""
    if not states:
        return {}
    right = [ACTIVITIES[label].models for label in film.labels]
    likely = [one["models"][int(np.argmax(one["probabilities"]))] for one in states]
    right_group = [
        bool((_models(state, "group") | _models(state, "newcomer")) & models)
        for state, models in zip(states, right, strict=True)
    ]
    delays = [_delay(right_group, first, film.labels) for first in film.switches]
    newcomers = [
        _models(state, "newcomer") & models
        for (before, state), models in zip(pairwise(states), right[1:], strict=True)
        if state["newcomer"] not in (None, before["newcomer"])
    ]
    terminations = [
        set(before["models"]) & models and not set(state["models"]) & models
        for (before, state), models in zip(pairwise(states), right[1:], strict=True)
    ]
    return {
        "dominant_fraction": float(np.mean([one["probabilities"].max() > 0.5 for one in states])),
        "right_model_fraction": float(np.mean([a in b for a, b in zip(likely, right, strict=True)])),
        "right_group_fraction": float(np.mean(right_group)),
        "restarts": int(states[-1]["restarts"]),
        **activity_figures(film, states),
        "switch_delay_frames": max(delays),
        "switch_delays_frames": delays,
        "filter_ms": 1e3 * float(np.mean([one["filter_seconds"] for one in states])),
        "detection_ms": 1e3 * float(np.mean([one["detection_seconds"] for one in states])),
        "activations": len(newcomers),
        "wrong_activations": sum(not models for models in newcomers),
        "wrong_terminations": sum(map(bool, terminations)),
        "repairs": int(states[-1]["repairs"]),
        "lost_frames": sum(bool(one["lost"]) for one in states),
    }


def _delay(right_group: Sequence[bool], first: int, labels: Sequence[int]) -> int:
    """Return how many frames after a switch a group with a right model is in force; all of the activity if never."""
    for k in range(first, len(labels)):
        if right_group[k] or labels[k] != labels[first]:
            return k - first
    return len(labels) - first


def _models(state: State, which: str) -> set[str]:
    """Return the models of the `group` in force, or of the `newcomer` that contends with it."""
    return set() if state[which] is None else set(state["groups"][state[which]])


def activity_figures(film: Film, states: Sequence[State]) -> dict[str, Any]:
    """Return how well the frames' labels name the activity.

    `confusion` has the frames of each true activity by label, the last column being a label of none; chance always says
    the commonest activity.
    """
    counts = np.zeros((len(ACTIVITIES), len(ACTIVITIES) + 1), dtype=np.int64)
    for state, label in zip(states, film.labels, strict=True):
        counts[label, LABELS.get(state["activity"] or "", len(ACTIVITIES))] += 1
    right = np.trace(counts)
    chance = counts.sum(axis=1).max() / counts.sum()
    return {"activity_accuracy": float(right / counts.sum()), "chance": float(chance), "confusion": counts.tolist()}
