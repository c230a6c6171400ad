"""The figures of the VSMM patent, redrawn.

Figure 9 shows detected joints and poses, 10 probabilities, 11 joint errors.
"""

from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
from matplotlib.figure import Figure

from posefit.output.drawing import draw_body, side_view
from posefit.silhouette.foreground import Image
from posefit_reproduce.experiment import Arrays, Results
from posefit_reproduce.vsmm.activities import ACTIVITIES, FPS, Film, film_of
from posefit_reproduce.vsmm.experiment import GROUPS, MODELS, TUNED
from posefit_reproduce.vsmm.tables import PATENT_CM, joint_errors

STILLS = (10, 60, 110, 140, 180, 235, 258, 290, 340, 380, 405, 430)
LARGER = 2  # scale of the stills
_JOINT = (60, 220, 255)
_HIDDEN = (120, 120, 120)


def patent_figures(results: Results) -> Iterator[tuple[str, Any]]:
    """Yield the figures of the first reported film, with the names of their files.

    There is a set for the default and one for the letter.
    """
    film = film_of(TUNED)
    for run, arrays in results.runs.items():
        if (
            run.kind == "reported"
            and run.seed == TUNED
            and run.method in ("default", "patent")
        ):
            yield f"figure-9-joints-{run.method}.jpg", film_stills(film, arrays)
            yield (
                f"figure-10-probabilities-{run.method}.png",
                probability_figure(film, arrays),
            )
            yield f"figure-11-errors-{run.method}.png", error_figure(film, arrays)


def probability_figure(film: Film, arrays: Arrays) -> Figure:
    """Return the probability of each model over time, and the groups in force."""
    figure = Figure(figsize=(7.0, 4.0), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(4.0, 1.0))
    seconds = np.arange(len(film.labels)) / FPS
    for name, series in zip(MODELS, arrays["probabilities"].T, strict=True):
        upper.plot(seconds, series, linewidth=1.2, label=name)
    upper.set(ylabel="probability", ylim=(0.0, 1.14))
    place = {"loc": "upper center", "bbox_to_anchor": (0.5, 1.18)}
    upper.legend(
        fontsize=8.5,
        frameon=False,
        ncols=len(MODELS),
        columnspacing=1.2,
        handlelength=1.4,
        **place,
    )
    for row in range(len(GROUPS)):
        force = (
            (arrays["group"] == row)
            | (arrays["candidate_group"] == row)
            | (arrays["group"] < 0)
        )
        lower.scatter(seconds[force], np.full(force.sum(), row), s=4, marker="s")
    names = [name for name, _ in GROUPS]
    lower.set(
        yticks=range(len(names)),
        yticklabels=names,
        ylim=(-0.6, len(names) - 0.4),
        xlabel="seconds",
    )
    lower.set_ylabel("in force")
    for axes in (upper, lower):
        _activities(axes, film, label=axes is upper)
    return figure


def error_figure(film: Film, arrays: Arrays) -> Figure:
    """Return the errors of right elbow and hand over time.

    They are measured to the detected joints and to the truth.
    """
    labels = {
        "_detected": "to the detected, cm",
        "": "to the truth, cm",
        "_space": "in space, cm",
    }
    errors = joint_errors(film, arrays)
    figure = Figure(figsize=(7.0, 6.0), layout="constrained")
    seconds = np.arange(len(film.labels)) / FPS
    for axes, (name, label) in zip(
        figure.subplots(3, 1, sharex=True), labels.items(), strict=True
    ):
        for joint, series in zip(
            ("right elbow", "right hand"), errors[name].T, strict=True
        ):
            axes.plot(
                seconds,
                series,
                linewidth=1.0,
                label=f"{joint}, mean {series.mean():.1f}",
            )
        axes.set(ylabel=label, ylim=(0.0, None))
        axes.legend(fontsize=8.5, frameon=False)
        _activities(axes, film, label=False)
        if name != "_space":
            axes.axhspan(*PATENT_CM, color="0.5", alpha=0.2)
    axes.set_xlabel("seconds")
    return figure


def _activities(axes: Any, film: Film, label: bool) -> None:
    for k, activity in zip([0, *film.switches], ACTIVITIES, strict=True):
        axes.axvline(k / FPS, color="0.7", linewidth=0.8, linestyle=":")
        if label:
            axes.text(k / FPS + 0.1, 1.06, activity.label, fontsize=8.5, color="0.35")
    axes.spines[["top", "right"]].set_visible(False)


def film_stills(film: Film, arrays: Arrays) -> Image:
    """Return stills: detected joints on the mask, the body on it and from the side.

    Joints are filled unless they are hidden.
    """
    by_frame = {name: values for name, values in arrays.items() if values.ndim}
    stills = []
    for k in STILLS:
        frame = {name: values[k] for name, values in by_frame.items()}
        stills.append(_still(film, frame, k))
    half = len(stills) // 2
    both_rows = np.vstack([np.hstack(stills[:half]), np.hstack(stills[half:])])
    return np.asarray(
        cv2.resize(both_rows, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    )


def _enlarged(image: Image) -> Image:
    larger = cv2.resize(image, None, fx=LARGER, fy=LARGER)
    return np.asarray(larger, dtype=np.uint8)


def _still(film: Film, frame: Arrays, k: int) -> Image:
    mask = film.observations[k].silhouettes[0].mask
    grey: Image = np.repeat(
        np.where(mask, 150, 28).astype(np.uint8)[..., None], 3, axis=2
    )
    drawn = grey.copy()
    draw_body(drawn, film.body, film.camera, frame["poses"], frame["translations"])
    marked = _enlarged(grey)
    drawn = _enlarged(drawn)
    for point, confidence in zip(
        LARGER * frame["joints"][0], frame["confidence"][0], strict=True
    ):
        colour, thickness = (_JOINT, -1) if confidence > 0.0 else (_HIDDEN, 1)
        cv2.circle(
            marked,
            tuple(np.rint(point).astype(int).tolist()),
            4,
            colour,
            thickness,
            cv2.LINE_AA,
        )
    middle = slice(drawn.shape[1] // 5, drawn.shape[1] - drawn.shape[1] // 5)
    cv2.putText(
        marked,
        f"{k}",
        (middle.start + 8, 44),
        cv2.FONT_HERSHEY_SIMPLEX,
        1.3,
        (240, 240, 240),
        2,
        cv2.LINE_AA,
    )
    side = side_view(
        film.body,
        film.camera,
        frame["poses"],
        frame["translations"],
        middle.stop - middle.start,
    )
    return np.vstack([marked[:, middle], drawn[:, middle], side])
