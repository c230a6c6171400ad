"""The figures of the VSMM patent, made anew: detected joints and poses (9), probabilities (10), joint errors (11)."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.files import opencv_name
from posefit.fitting.tracker import Frame
from posefit.geometry.skeleton import PARENTS
from posefit.output.drawing import draw_body, side_view
from posefit.silhouette.foreground import Image
from posefit_reproduce.vsmm.activities import ACTIVITIES, FPS, Film
from posefit_reproduce.vsmm.experiment import ELBOW, HAND, State, both_joints, detected_cm, model_states, projected_cm

STILLS = (10, 60, 110, 140, 180, 235, 258, 290, 340, 380, 405, 430)
PATENT_CM = (2.7, 5.2)  # between these lie the patent's own mean errors
LARGER = 2  # pixels a pixel, in the stills
_JOINT, _HIDDEN = (60, 220, 255), (120, 120, 120)


def patent_figures(film: Film, frames: Sequence[Frame], folder: Path) -> list[str]:
    """Write the figures of a track to a folder that is there, and return the names of the files."""
    states = model_states(frames)
    figures = {
        "figure-10-probabilities.png": probability_figure(film, states),
        "figure-11-errors.png": error_figure(film, frames, states),
    }
    for name, figure in figures.items():
        figure.savefig(folder / name, dpi=130)
    stills = "figure-9-joints.png"
    if not cv2.imwrite(opencv_name(folder / stills), film_stills(film, frames, states)):
        raise InputError(f"{folder / stills}: expected to write a picture, got nothing written")
    return [stills, *figures]


def probability_figure(film: Film, states: Sequence[State]) -> Figure:
    """Return the probability of each model over time, with the groups that are in force."""
    names = list(dict.fromkeys(model for group in states[0]["groups"].values() for model in group))
    values = np.zeros((len(names), len(states)))
    for k, one in enumerate(states):
        for model, probability in zip(one["models"], one["probabilities"], strict=True):
            values[names.index(model), k] = probability
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(4.0, 1.0))
    seconds = np.arange(len(states)) / FPS
    for name, series in zip(names, values, strict=True):
        upper.plot(seconds, series, linewidth=1.2, label=name)
    upper.set(ylabel="probability", ylim=(0.0, 1.14))
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 1.18)}
    upper.legend(fontsize=8.5, frameon=False, ncols=len(names), columnspacing=1.2, handlelength=1.4, **place)
    groups = list(states[0]["groups"])
    for row, group in enumerate(groups):
        force = [k for k, one in enumerate(states) if group in (one["group"], one["newcomer"]) or one["group"] is None]
        lower.scatter(seconds[force], np.full(len(force), row), s=4, marker="s")
    lower.set(yticks=range(len(groups)), yticklabels=groups, ylim=(-0.6, len(groups) - 0.4), xlabel="seconds")
    lower.set_ylabel("in force")
    for axes in (upper, lower):
        _activities(axes, film, label=axes is upper)
    return figure


def error_figure(film: Film, frames: Sequence[Frame], states: Sequence[State]) -> Figure:
    """Return the errors of right elbow and hand over time, against the detected joints and against the truth."""
    truth, estimate = (joints[:, [ELBOW, HAND]] for joints in both_joints(film, frames))
    errors = {
        "to the detected, cm": detected_cm(film, frames, states),
        "to the truth, cm": projected_cm(film, truth, estimate),
        "in space, cm": 100.0 * np.linalg.norm(truth - estimate, axis=-1),
    }
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    seconds = np.arange(len(frames)) / FPS
    for axes, (label, values) in zip(figure.subplots(3, 1, sharex=True), errors.items(), strict=True):
        for name, series in zip(("right elbow", "right hand"), values.T, strict=True):
            axes.plot(seconds, series, linewidth=1.0, label=f"{name}, mean {np.nanmean(series):.1f}")
        axes.set(ylabel=label, ylim=(0.0, None))
        axes.legend(fontsize=8.5, frameon=False)
        _activities(axes, film, label=False)
        if label != "in space, cm":
            axes.axhspan(*PATENT_CM, color="0.5", alpha=0.2)
    axes.set_xlabel("seconds")
    return figure


def _activities(axes: Any, film: Film, label: bool) -> None:
    switches = [0, *film.switches]
    for k, one in zip(switches, ACTIVITIES, strict=True):
        axes.axvline(k / FPS, color="0.7", linewidth=0.8, linestyle=":")
        if label:
            axes.text(k / FPS + 0.1, 1.06, one.label, fontsize=8.5, color="0.35")
    axes.spines[["top", "right"]].set_visible(False)


def film_stills(film: Film, frames: Sequence[Frame], states: Sequence[State]) -> Image:
    """Return stills: the detected joints on the mask, the fitted body on it, and the body from its side."""
    columns = [_still(film, frames[k], states[k], k) for k in STILLS]
    rows = [np.hstack(columns[k : k + len(columns) // 2]) for k in (0, len(columns) // 2)]
    return np.asarray(np.vstack(rows))


def _still(film: Film, frame: Frame, state: State, k: int) -> Image:
    mask = film.observations[k].silhouettes[0].mask
    grey = np.where(mask, 150, 28).astype(np.uint8)
    marked = np.repeat(np.kron(grey, np.ones((LARGER, LARGER), dtype=np.uint8))[..., None], 3, axis=2)
    for point, sure in zip(state["joints"][0], state["confidence"][0], strict=True):
        cv2.circle(marked, _pixel(point), 4, _JOINT if sure > 0.0 else _HIDDEN, -1 if sure > 0.0 else 1, cv2.LINE_AA)
    drawn = np.repeat(grey[..., None], 3, axis=2)
    draw_body(drawn, film.body, film.camera, frame.pose, frame.translation)
    drawn = np.asarray(cv2.resize(drawn, None, fx=LARGER, fy=LARGER, interpolation=cv2.INTER_LINEAR), dtype=np.uint8)
    true = film.body.skeleton.joints(film.truth.poses[k], film.truth.translations[k])
    pixels = film.camera.project(true)[0]
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            cv2.line(drawn, _pixel(pixels[parent]), _pixel(pixels[joint]), (90, 255, 90), 1, cv2.LINE_AA)
    side = side_view(film.body, film.camera, frame.pose, frame.translation, drawn.shape[0])
    middle = slice(drawn.shape[1] // 5, -drawn.shape[1] // 5)
    cv2.putText(marked, f"{k}", (middle.start + 8, 44), cv2.FONT_HERSHEY_SIMPLEX, 1.3, (240, 240, 240), 2, cv2.LINE_AA)
    parts = (marked[:, middle], drawn[:, middle], side)
    height = drawn.shape[0] // 2
    small = [cv2.resize(p, (round(p.shape[1] / 2), height), interpolation=cv2.INTER_AREA) for p in parts]
    widest = max(int(part.shape[1]) for part in small)
    return np.asarray(np.vstack([np.pad(p, ((0, 0), (0, widest - p.shape[1]), (0, 0))) for p in small]))


def _pixel(point: Array) -> tuple[int, int]:
    return round(LARGER * float(point[0])), round(LARGER * float(point[1]))
