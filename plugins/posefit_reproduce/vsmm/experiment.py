"""The experiment of the VSMM patent: model probabilities, joint errors and switches, over seeds.

The film is made for the occasion, by noise and a mean background, and what counts is which models are in force in each
frame. A cell says and keeps none of it, so the runs are jobs; see `posefit_reproduce.jobs`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.skeleton import JOINTS
from posefit.motion import built_in
from posefit.tracking.method import prepare
from posefit.tracking.options import EVALUATIONS, TrackOptions
from posefit_reproduce.jobs import Progress, check_seeds, each
from posefit_reproduce.vsmm.activities import ACTIVITIES, TRAINING, Film, film_of
from posefit_vsmm.motion import library
from posefit_vsmm.state import AT

# the film's activity that each label stands for; a jump is none of them
LABELS = {"walk": 0, "arms-out": 1, "jacks": 2, "squat": 3}
State = Mapping[str, Any]  # a frame's `details` by the vsmm tracker, and its `activity`
# What is compared, by the name under which the figures are given.
METHODS: dict[str, TrackOptions] = {
    "default": TrackOptions(method="vsmm"),
    "patent": TrackOptions(method="vsmm:patent"),
    "imm_all_six": TrackOptions(method="vsmm", settings={"vsmm.structure": "all"}),
}
SEARCHES: dict[str, TrackOptions] = {
    "sapso_loose": TrackOptions(method="sapso@loose"),
    "sapso_pca": TrackOptions(method="sapso@pca"),
    "sapso_vsmm": TrackOptions(method="sapso+vsmm"),
}
# One setting each otherwise than by default.
ALTERNATIVES: dict[str, TrackOptions] = {
    f"{name}={value}": TrackOptions(method="vsmm", settings={f"vsmm.{name}": value})
    for name, value in {"recovery": False, "process_noise": 2.0, "joint_noise": 2.0}.items()
}
SHOWN = 0  # the seed that is drawn
WORKERS = 1  # what a frame takes is measured, so nothing runs beside it
ELBOW, HAND = JOINTS.index("rhumerus"), JOINTS.index("rwrist")  # the joints that end in elbow and hand
WARMING = 3  # frames that are tracked beforehand, so that no frame's time is that of compiling


@dataclass(frozen=True, eq=False)
class PatentTrack:
    """One method on the film of one seed."""

    frames: Sequence[Frame] = field(repr=False)  # of the film that is drawn alone
    figures: dict[str, Any]


def film_task(film: Film, evaluations: int, training: Sequence[str] = TRAINING) -> Task:
    """Return what is known before a film; its first pose is not."""
    yaw, place = float(film.truth.poses[0, 0]), film.truth.translations[0]
    motions = [built_in.motion(one) for one in training]
    return Task(film.body, [film.camera], evaluations, yaw, place, "aligned", film.truth.fps, motions)


def follow_film(options: TrackOptions, seed: int) -> PatentTrack:
    """Follow the film of a seed with a method and return what it is worth; the first pose is not known."""
    film = film_of(seed)
    task = film_task(film, options.evaluations or EVALUATIONS)
    with threadpool_limits(1):
        for observations in (film.observations[:WARMING], film.observations):
            frames = list(prepare(options, task).follow(task, observations, np.random.default_rng(seed)))
    states, figures = model_states(frames), patent_errors(film, frames)
    if states:
        elbow, hand = np.nanmean(detected_cm(film, frames, states), axis=0)
        figures |= {"elbow_detected_cm": float(elbow), "hand_detected_cm": float(hand)}
    shown = frames if seed == SHOWN else ()  # the others need not travel
    return PatentTrack(shown, {**figures, **switching_figures(film, states)})


def both_joints(film: Film, frames: Sequence[Frame]) -> tuple[Array, Array]:
    """Return the true and the estimated joints (T, 27, 3) in metres."""
    skeleton = film.body.skeleton
    estimate = np.array([frame.pose for frame in frames]), np.array([frame.translation for frame in frames])
    return skeleton.joints(film.truth.poses, film.truth.translations), skeleton.joints(*estimate)


def projected_cm(film: Film, truth: Array, estimate: Array) -> Array:
    """Return how far estimated joints are from the true ones in the image, in centimetres at the true one's depth."""
    (pixels, depths), (others, _) = film.camera.project(truth), film.camera.project(estimate)
    return np.asarray(100.0 * np.linalg.norm((pixels - others) / film.camera.focal, axis=-1) * depths)


def patent_errors(film: Film, frames: Sequence[Frame]) -> dict[str, float]:
    """Return the errors of right elbow and hand, in the image and in space, and of the whole pose."""
    truth, estimate = both_joints(film, frames)
    flat, deep = projected_cm(film, truth, estimate), 100.0 * np.linalg.norm(truth - estimate, axis=-1)
    values = {
        "elbow_cm": flat[:, ELBOW],
        "hand_cm": flat[:, HAND],
        "elbow_3d_cm": deep[:, ELBOW],
        "hand_3d_cm": deep[:, HAND],
        "projected_cm": flat,
        "joints_3d_cm": deep,
        "mpjpe_mm": metrics.mpjpe_mm(truth, estimate),
        "error_degrees": metrics.pose_error_degrees(film.truth.poses, np.array([frame.pose for frame in frames])),
        "iou": [metrics.iou(frame.areas)[0] for frame in frames],
    }
    return {name: float(np.mean(each)) for name, each in values.items()} | {
        "frame_ms": 1e3 * float(np.mean([frame.seconds for frame in frames]))
    }


def detected_cm(film: Film, frames: Sequence[Frame], states: Sequence[State]) -> Array:
    """Return how far the estimated right elbow and hand (T, 2) are from the detected ones; NaN where hidden.

    This is what the patent's figure 11 shows, in centimetres at the estimate's depth.
    """
    _, estimate = both_joints(film, frames)
    pixels, depths = film.camera.project(estimate[:, [ELBOW, HAND]])
    points = [AT["right elbow"], AT["right hand"]]
    joints = np.array([state["joints"][0, points] for state in states])
    away = 100.0 * np.linalg.norm((pixels - joints) / film.camera.focal, axis=-1) * depths
    return np.where(np.array([state["confidence"][0, points] for state in states]) > 0.0, away, np.nan)


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
        **activity_figures(film, states),
        "switch_delay_frames": max(delays),
        "switch_delays_frames": delays,
        "filter_ms": 1e3 * float(np.mean([one["filter_seconds"] for one in states])),
        "detection_ms": 1e3 * float(np.mean([one["detection_seconds"] for one in states])),
        "activations": len(newcomers),
        "wrong_activations": sum(not models for models in newcomers),
        "wrong_terminations": sum(map(bool, terminations)),
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


def repeat_patent(
    seeds: int, searches: bool, alternatives: bool, workers: int = WORKERS, progress: Progress | None = None
) -> tuple[dict[str, Any], Sequence[Frame]]:
    """Return the figures of each method, and the frames of the default one on the first film.

    Figures are means over seeds; `per_seed` has those of each. `prediction_degrees` are the models' errors one and ten
    frames ahead, on clips that they were not fitted to. Raises ValueError where seeds is no positive number.
    """
    check_seeds(seeds)
    methods = METHODS | (SEARCHES if searches else {}) | (ALTERNATIVES if alternatives else {})
    jobs = {(seed, name): partial(follow_film, methods[name], seed) for seed in range(seeds) for name in methods}
    tracks, figures = each(jobs, workers, progress), dict[str, dict[str, Any]]()
    for name in methods:
        rows = [tracks[seed, name].figures for seed in range(seeds)]
        means = {
            key: float(np.mean([row[key] for row in rows])) for key in rows[0] if not isinstance(rows[0][key], list)
        }
        figures[name] = {**means, "per_seed": rows}
        if name in ALTERNATIVES:
            figures[name] |= change(figures["default"]["per_seed"], rows)
    return {"seeds": seeds, "methods": figures, "prediction_degrees": library().report}, tracks[SHOWN, "default"].frames


def change(default: Sequence[Mapping[str, Any]], other: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return by how many millimetres another method is worse over the same films, and on how many of them it is."""
    differences = [b["mpjpe_mm"] - a["mpjpe_mm"] for a, b in zip(default, other, strict=True)]
    return {"worse_mm": float(np.mean(differences)), "worse_films": float(np.sum(np.array(differences) > 0.0))}
