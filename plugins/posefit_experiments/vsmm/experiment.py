"""The experiment of the VSMM patent: model probabilities, joint errors and switches, over seeds."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.skeleton import JOINTS
from posefit.motion import library
from posefit.tracking.method import Choice, prepare
from posefit_experiments.vsmm import activities
from posefit_experiments.vsmm.activities import ACTIVITIES, TRAINING

# What is compared, by the name under which the figures are given.
METHODS: dict[str, Choice] = {
    "vsmm": Choice(tracker="vsmm"),
    "imm_all_six": Choice(tracker="vsmm", tracker_settings={"structure": "all"}),
}
SEARCHES: dict[str, Choice] = {
    "sapso_loose": Choice(optimiser="sapso", prior="loose"),
    "sapso_pca": Choice(optimiser="sapso", prior="pca"),
    "sapso_vsmm": Choice(tracker="sapso+vsmm"),
}
ELBOW, HAND = JOINTS.index("rhumerus"), JOINTS.index("rwrist")  # the joints that end in elbow and hand


@dataclass(frozen=True, eq=False)
class Run:
    """One method on the sequence of one seed."""

    sequence: activities.Sequence
    frames: Sequence[Frame] = field(repr=False)
    figures: dict[str, Any]


def run(choice: Choice, seen: activities.Sequence, seed: int) -> Run:
    """Follow a sequence with a method and return what it is worth; the first pose is not known."""
    task = Task(
        seen.body,
        [seen.camera],
        choice.budget(),
        float(seen.truth.poses[0, 0]),
        seen.truth.translations[0],
        "aligned",
        seen.truth.fps,
        [library.built_in(one) for one in TRAINING],
    )
    with threadpool_limits(1):
        frames = list(prepare(choice, task).tracker(task).track(seen.observations, np.random.default_rng(seed)))
    return Run(seen, frames, {**errors(seen, frames), **switching(seen, frames)})


def joints(seen: activities.Sequence, frames: Sequence[Frame]) -> tuple[Array, Array]:
    """Return the true and the found joints (T, 27, 3) in metres."""
    skeleton = seen.body.skeleton
    found = np.array([frame.pose for frame in frames]), np.array([frame.translation for frame in frames])
    return skeleton.joints(seen.truth.poses, seen.truth.translations), skeleton.joints(*found)


def projected_cm(seen: activities.Sequence, truth: Array, found: Array) -> Array:
    """Return how far found joints are from the true ones in the image, in centimetres at the true one's depth."""
    (pixels, depths), (others, _) = seen.camera.project(truth), seen.camera.project(found)
    return np.asarray(100.0 * np.linalg.norm((pixels - others) / seen.camera.focal, axis=-1) * depths)


def errors(seen: activities.Sequence, frames: Sequence[Frame]) -> dict[str, float]:
    """Return the errors of right elbow and hand, in the image and in space, and of the whole pose."""
    truth, found = joints(seen, frames)
    flat, deep = projected_cm(seen, truth, found), 100.0 * np.linalg.norm(truth - found, axis=-1)
    poses = np.array([frame.pose for frame in frames])
    return {
        "elbow_cm": float(flat[:, ELBOW].mean()),
        "hand_cm": float(flat[:, HAND].mean()),
        "elbow_3d_cm": float(deep[:, ELBOW].mean()),
        "hand_3d_cm": float(deep[:, HAND].mean()),
        "projected_cm": float(flat.mean()),
        "joints_3d_cm": float(deep.mean()),
        "mpjpe_mm": float(metrics.mpjpe_mm(truth, found).mean()),
        "error_degrees": float(metrics.pose_error_degrees(seen.truth.poses, poses).mean()),
        "iou": float(np.mean([metrics.iou(frame.areas)[0] for frame in frames])),
        "frame_ms": 1e3 * float(np.median([frame.seconds for frame in frames])),
    }


def switching(seen: activities.Sequence, frames: Sequence[Frame]) -> dict[str, Any]:
    """Return how the models' probabilities and the groups in force fare; nothing where a tracker tells none."""
    told = [frame.details for frame in frames]
    if not all("probabilities" in one for one in told):
        return {}
    right = [ACTIVITIES[label].models for label in seen.labels]
    likely = [one["models"][int(np.argmax(one["probabilities"]))] for one in told]
    delays = [_delay(told, first, seen.labels, right[first]) for first in seen.switches]
    settled = [k for k, one in enumerate(told) if one["group"] is not None and one["newcomer"] is None]
    smallest = min(len(told[k]["models"]) for k in settled) if settled else 0
    steady = [k for k in settled if len(told[k]["models"]) == smallest]
    return {
        "dominant_fraction": float(np.mean([one["probabilities"].max() > 0.5 for one in told])),
        "right_model_fraction": float(np.mean([a in b for a, b in zip(likely, right, strict=True)])),
        "switch_delay_frames": max(delays),
        "switch_delays_frames": delays,
        "filter_ms": 1e3 * float(np.median([told[k]["filter_seconds"] for k in steady or range(len(told))])),
        "detection_ms": 1e3 * float(np.median([one["detection_seconds"] for one in told])),
        "activations": sum(_came(before, now) for before, now in pairwise(told)),
        "wrong_activations": sum(
            _came(told[k - 1], told[k]) and not right[k] & set(told[k]["groups"][told[k]["newcomer"]])
            for k in range(1, len(told))
        ),
        "wrong_terminations": sum(
            bool(set(told[k - 1]["models"]) & right[k]) and not set(told[k]["models"]) & right[k]
            for k in range(1, len(told))
        ),
        "repairs": int(told[-1].get("repairs", 0)),
        "lost_frames": sum(bool(one["lost"]) for one in told),
    }


def _delay(told: Sequence[Mapping[str, Any]], first: int, labels: Sequence[int], right: frozenset[str]) -> int:
    """Return how many frames after a switch a group with a right model is in force; all of the activity if never."""
    for k in range(first, len(told)):
        if labels[k] != labels[first]:
            return k - first
        one = told[k]
        names = [one["newcomer"]] if one["newcomer"] else []
        names += [one["group"]] if one["group"] else list(one["groups"])  # all of them while a group is chosen
        if any(right & set(one["groups"][name]) for name in names):
            return k - first
    return len(told) - first


def _came(before: Mapping[str, Any], now: Mapping[str, Any]) -> bool:
    return now["newcomer"] is not None and now["newcomer"] != before["newcomer"]


def mean(rows: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the mean of each figure over seeds, and `per_seed` the rows themselves."""
    found = list(rows)
    single = [name for name, value in found[0].items() if not isinstance(value, list)]
    return {**{name: float(np.mean([row[name] for row in found])) for name in single}, "per_seed": found}


def reproduce(
    seeds: int, searches: bool, progress: Callable[[Iterator[Any], int], Iterator[Any]] | None = None
) -> tuple[dict[str, Any], dict[str, Run]]:
    """Return the figures, those of `vsmm` outermost and each other method's under its name, and the runs of seed 0.

    Raises ValueError where seeds is no positive number.
    """
    if seeds < 1:
        raise ValueError(f"seeds must be at least 1, got {seeds}")
    methods = METHODS | (SEARCHES if searches else {})
    cells = ((seed, name) for seed in range(seeds) for name in methods)
    found: dict[str, list[dict[str, Any]]] = {name: [] for name in methods}
    shown: dict[str, Run] = {}
    seen: activities.Sequence | None = None
    for seed, name in progress(cells, seeds * len(methods)) if progress else cells:
        if seen is None or name == "vsmm":  # the first of a seed
            seen = activities.sequence(seed)
        one = run(methods[name], seen, seed)
        found[name].append(one.figures)
        if seed == 0:
            shown[name] = one
    figures = {name: mean(rows) for name, rows in found.items()}
    outer = figures.pop("vsmm")
    return {"seeds": seeds, **outer, **figures}, shown
