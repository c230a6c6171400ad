"""The experiment of the VSMM patent: model probabilities, joint errors and switches, over seeds.

The film is made for the occasion, by noise and a mean background, and what counts is which models are in force in each
frame. A cell says and keeps none of it, so the runs are jobs; see `posefit_reproduce.jobs`.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame, Task
from posefit.geometry.skeleton import JOINTS
from posefit.motion import built_in
from posefit.tracking.method import prepare
from posefit.tracking.options import TrackOptions
from posefit_reproduce.jobs import Progress, check_seeds, each
from posefit_reproduce.vsmm.activities import TRAINING, Film, film_of
from posefit_reproduce.vsmm.switches import State, model_states, switching_figures
from posefit_vsmm.motion import library
from posefit_vsmm.settings import OURS, PATENT
from posefit_vsmm.state import AT

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
# One interpretation each otherwise than by default; the poses of 8.3 count only in the patent's step 8.
ALTERNATIVES: dict[str, TrackOptions] = {
    f"{name}={value}": TrackOptions(
        method="vsmm", settings={f"vsmm.{name}": value} | ({"vsmm.new": "patent"} if name == "poses" else {})
    )
    for name, value in {**PATENT, **OURS}.items()
}
SHOWN = 0  # the seed that is drawn
WORKERS = 1  # what a frame takes is measured, so nothing runs beside it
ELBOW, HAND = JOINTS.index("rhumerus"), JOINTS.index("rwrist")  # the joints that end in elbow and hand
WARMING = 3  # frames that are tracked beforehand, so that no frame's time is that of compiling


@dataclass(frozen=True, eq=False)
class PatentTrack:
    """One method on the film of one seed."""

    frames: Sequence[Frame] = field(repr=False)
    figures: dict[str, Any]


def film_task(film: Film, evaluations: int, training: Sequence[str] = TRAINING) -> Task:
    """Return what is known before a film; its first pose is not."""
    yaw, place = float(film.truth.poses[0, 0]), film.truth.translations[0]
    motions = [built_in.motion(one) for one in training]
    return Task(film.body, [film.camera], evaluations, yaw, place, "aligned", film.truth.fps, motions)


def follow_film(options: TrackOptions, seed: int) -> PatentTrack:
    """Follow the film of a seed with a method and return what it is worth; the first pose is not known."""
    film = film_of(seed)
    task = film_task(film, options.budget)
    with threadpool_limits(1):
        for observations in (film.observations[:WARMING], film.observations):
            frames = list(prepare(options, task).tracker(task).track(observations, np.random.default_rng(seed)))
    states = model_states(frames)
    figures = {
        **patent_errors(film, frames),
        **detected_errors(film, frames, states),
        **switching_figures(film, states),
    }
    return PatentTrack(frames, figures)


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
    poses = np.array([frame.pose for frame in frames])
    return {
        "elbow_cm": float(flat[:, ELBOW].mean()),
        "hand_cm": float(flat[:, HAND].mean()),
        "elbow_3d_cm": float(deep[:, ELBOW].mean()),
        "hand_3d_cm": float(deep[:, HAND].mean()),
        "projected_cm": float(flat.mean()),
        "joints_3d_cm": float(deep.mean()),
        "mpjpe_mm": float(metrics.mpjpe_mm(truth, estimate).mean()),
        "error_degrees": float(metrics.pose_error_degrees(film.truth.poses, poses).mean()),
        "iou": float(np.mean([metrics.iou(frame.areas)[0] for frame in frames])),
        "frame_ms": 1e3 * float(np.mean([frame.seconds for frame in frames])),
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


def detected_errors(film: Film, frames: Sequence[Frame], states: Sequence[State]) -> dict[str, float]:
    """Return the errors of right elbow and hand against the detected joints; nothing for a tracker without them."""
    if not states:
        return {}
    elbow, hand = np.nanmean(detected_cm(film, frames, states), axis=0)
    return {"elbow_detected_cm": float(elbow), "hand_detected_cm": float(hand)}


def over_seeds(rows: Iterable[Mapping[str, Any]]) -> dict[str, Any]:
    """Return the mean of each figure over seeds, and `per_seed` the rows themselves."""
    per_seed = list(rows)
    single = [name for name, value in per_seed[0].items() if not isinstance(value, list)]
    return {**{name: float(np.mean([row[name] for row in per_seed])) for name in single}, "per_seed": per_seed}


def repeat_patent(
    seeds: int, searches: bool, alternatives: bool, workers: int = WORKERS, progress: Progress | None = None
) -> tuple[dict[str, Any], PatentTrack]:
    """Return the figures of each method, and the first track of the default one.

    `prediction_degrees` are the models' errors one and ten frames ahead, on clips that they were not fitted to. Raises
    ValueError where seeds is no positive number.
    """
    check_seeds(seeds)
    methods = METHODS | (SEARCHES if searches else {}) | (ALTERNATIVES if alternatives else {})
    jobs = {(seed, name): partial(_followed, methods[name], seed) for seed in range(seeds) for name in methods}
    tracks = each(jobs, workers, progress)
    figures = {name: over_seeds(tracks[seed, name].figures for seed in range(seeds)) for name in methods}
    for name in ALTERNATIVES.keys() & figures.keys():
        figures[name] |= change(figures["default"]["per_seed"], figures[name]["per_seed"])
    return {"seeds": seeds, "methods": figures, "prediction_degrees": library().report}, tracks[SHOWN, "default"]


def change(default: Sequence[Mapping[str, Any]], other: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return by how many millimetres another method is worse over the same films, and on how many of them it is."""
    differences = [b["mpjpe_mm"] - a["mpjpe_mm"] for a, b in zip(default, other, strict=True)]
    return {"worse_mm": float(np.mean(differences)), "worse_films": float(np.sum(np.array(differences) > 0.0))}


def _followed(options: TrackOptions, seed: int) -> PatentTrack:
    """Return a track, without its frames where nobody will look at them."""
    track = follow_film(options, seed)
    return track if seed == SHOWN else replace(track, frames=())
