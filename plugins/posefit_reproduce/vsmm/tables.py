"""The results of the VSMM patent's experiment compared with its own, and its claims."""

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.geometry.skeleton import JOINTS
from posefit_reproduce.experiment import (
    Arrays,
    Claim,
    Results,
    Table,
    bounded,
    claims_table,
    formatted,
    interval,
)
from posefit_reproduce.vsmm.activities import ACTIVITIES, Film, film_of
from posefit_reproduce.vsmm.experiment import (
    GROUPS,
    LABELS,
    METHODS,
    MODELS,
    TUNED,
    UNRECOVERED,
)
from posefit_vsmm.state import AT

# the joints whose bones end in elbow and hand
ELBOW = JOINTS.index("rhumerus")
HAND = JOINTS.index("rwrist")
POINTS = [AT["right elbow"], AT["right hand"]]
TRUE_MM = 50.0  # ours: mean distance of joints in space that is negligible
# range of the patent's mean errors in figure 11
PATENT_CM = (2.7, 5.2)
# the numbers of the right models of each activity
RIGHT: list[set[int]] = []
for _activity in ACTIVITIES:
    RIGHT.append({MODELS.index(model) for model in _activity.models})
FIGURES: dict[str, tuple[str, int]] = {
    "elbow_detected": ("distance of the elbow from the detected one, cm", 1),
    "hand_detected": ("distance of the hand from the detected one, cm", 1),
    "elbow": ("distance of the elbow from the truth, cm", 1),
    "hand": ("distance of the hand from the truth, cm", 1),
    "mpjpe": ("MPJPE, mm", 0),
    "degrees": ("error (8), degrees", 2),
    "dominant": ("a model has more than half, % of frames", 0),
    "model": ("the right model is the likeliest, %", 0),
    "group": ("a group with the right model is in use, %", 0),
    "label": ("the right label, %", 0),
    "delay": ("longest delay, frames", 0),
    "delay_change": ("longest delay after a change", 0),
    "activations": ("activations", 0),
    "wrong_activations": ("activations of groups without a right model", 0),
    "wrong_terminations": ("terminations of the right model", 0),
    "filter": ("filter, ms", 2),
    "detection": ("detection, ms", 2),
    "frame": ("frame, CPU ms", 2),
}
BOTH = ("default", "patent")
# values of all films (1, n), by the names of `FIGURES`
Films = Mapping[str, Array]
# figures shown for each film
CHIEF = (
    "elbow_detected",
    "hand_detected",
    "mpjpe",
    "model",
    "group",
    "delay",
    "delay_change",
)
# figures that do not exist for a filter over all models
SWITCHING = {
    "group",
    "delay",
    "delay_change",
    "activations",
    "wrong_activations",
    "wrong_terminations",
}


def joint_errors(film: Film, arrays: Arrays) -> dict[str, Array]:
    """Return the errors in cm of right elbow and hand (T, 2).

    They are measured to the detected joints, to the truth, and in space. As in figure
    11 no frame is left out: a hidden joint is where it is predicted.
    Interpretation V18.
    """
    skeleton = film.body.skeleton
    chosen = [ELBOW, HAND]
    truth = skeleton.joints(film.truth.poses, film.truth.translations)[:, chosen]
    estimate = skeleton.joints(arrays["poses"], arrays["translations"])[:, chosen]
    true_pixels, true_depths = film.camera.project(truth)
    pixels, depths = film.camera.project(estimate)

    def in_cm(off_pixels: Array, depths: Array) -> Array:
        return np.asarray(
            100.0 * np.linalg.norm(off_pixels / film.camera.focal, axis=-1) * depths
        )

    return {
        "": in_cm(true_pixels - pixels, true_depths),
        "_space": 100.0 * np.linalg.norm(truth - estimate, axis=-1),
        "_detected": in_cm(pixels - arrays["joints"][:, 0, POINTS], depths),
    }


def film_figures(seed: int, arrays: Arrays) -> dict[str, float]:
    """Return the figures of a track of a film, by the names of `FIGURES`."""
    film = film_of(seed)
    figures = dict[str, Any]()
    skeleton = film.body.skeleton
    poses = arrays["poses"]
    for name, values in joint_errors(film, arrays).items():
        figures[f"elbow{name}"], figures[f"hand{name}"] = values.mean(axis=0)
    truth = skeleton.joints(film.truth.poses, film.truth.translations)
    figures["mpjpe"] = metrics.mpjpe_mm(
        truth, skeleton.joints(poses, arrays["translations"])
    ).mean()
    figures["degrees"] = metrics.pose_error_degrees(film.truth.poses, poses).mean()
    figures["frame"] = 1e3 * np.median(arrays["cpu_seconds"])
    figures |= switching_figures(film.labels, arrays)
    return {name: float(value) for name, value in figures.items()}


def switching_figures(labels: list[int], arrays: Arrays) -> dict[str, float]:
    """Return how often models and groups in force are right.

    Frames that try all models have no group.
    """
    probabilities = arrays["probabilities"]
    candidates = arrays["candidate_group"]
    likeliest = probabilities.argmax(axis=1)
    # by group number + 1, because -1 means no group
    models_of: list[set[int]] = [set()]
    for _, names in GROUPS:
        models_of.append({MODELS.index(name) for name in names})
    in_force = []
    for group, candidate in zip(arrays["group"], candidates, strict=True):
        in_force.append(models_of[group + 1] | models_of[candidate + 1])
    right = [RIGHT[label] for label in labels]
    # an activity may have several right models; one of them in force is enough
    group_is_right = []
    model_is_right = []
    for models, model, wanted in zip(in_force, likeliest, right, strict=True):
        group_is_right.append(bool(models & wanted))
        model_is_right.append(model in wanted)
    right_group = np.array(group_is_right)
    delays = _delays(labels, right_group)
    activated = []  # the right models of each group that is activated
    for (before, now), wanted in zip(pairwise(candidates), right[1:], strict=True):
        # -1 means no candidate: the end of a switch, not an activation
        if now not in (-1, before):
            activated.append(models_of[now + 1] & wanted)
    terminated = []  # whether the right models are no longer in force
    for (before, now), wanted in zip(pairwise(in_force), right[1:], strict=True):
        terminated.append(bool(before & wanted) and not now & wanted)
    return {
        "dominant": 100.0 * np.mean(probabilities.max(axis=1) > 0.5),
        "model": 100.0 * np.mean(model_is_right),
        "group": 100.0 * right_group.mean(),
        "label": 100.0 * np.mean(arrays["label"] == np.array(labels)),
        "delay": max(delays),
        "delay_change": max(delays[1:]),
        "activations": len(activated),
        "wrong_activations": sum(not models for models in activated),
        "wrong_terminations": sum(terminated),
        "filter": 1e3 * np.median(arrays["filter_seconds"]),
        "detection": 1e3 * np.median(arrays["detection_seconds"]),
    }


def _delays(labels: list[int], right_group: NDArray[np.bool_]) -> list[int]:
    """Return the frames until a right group is in force, for each activity.

    If none ever is, this is the activity's length.
    """
    starts = [0]
    for frame, (before, now) in enumerate(pairwise(labels), 1):
        if now != before:
            starts.append(frame)
    delays = []
    for start, stop in pairwise([*starts, len(labels)]):
        hits = np.flatnonzero(right_group[start:stop])
        delays.append(int(hits[0]) if len(hits) else stop - start)
    return delays


def patent_tables(results: Results) -> Iterator[Table]:
    """Yield all tables: claims, methods, films, labels, recovery."""
    rows: dict[str, list[dict[str, float]]] = {}
    for run in sorted(results.runs, key=lambda run: run.seed):
        rows.setdefault(f"{run.kind} {run.method}", []).append(
            film_figures(run.seed, results.runs[run])
        )
    films: dict[str, Films] = {}
    for name, figures_of_films in rows.items():
        columns = {}
        for figure in figures_of_films[0]:
            values = [figures[figure] for figures in figures_of_films]
            columns[figure] = np.array([values])  # (1, films)
        films[name] = columns
    methods = {name: films[f"reported {name}"] for name in METHODS}
    yield claims_table("claims", list(claims(methods)))
    yield means_table("compared", methods)
    yield films_table("films", {name: methods[name] for name in BOTH})
    for name in BOTH:
        yield labels_table(f"labels-{name}", results, name)
    yield recovery_table(films)


def means_table(name: str, methods: Mapping[str, Films]) -> Table:
    """Return the mean of each figure over films, with an interval over films."""
    rows = []
    for figure, (label, digits) in FIGURES.items():
        cells = []
        for method, films in methods.items():
            # a filter over all six models does not switch
            if "six" in method and figure in SWITCHING:
                cells.append("")
            else:
                cells.append(bounded(interval(films[figure]), digits))
        rows.append([label, *cells])
    return Table(name, ["mean of the films", *methods], rows)


def films_table(name: str, methods: Mapping[str, Films]) -> Table:
    """Return the chief figures of each film, and their deviation over films."""
    rows = []
    for figure in CHIEF:
        label, digits = FIGURES[figure]
        for method, films in methods.items():
            values = films[figure][0]
            deviation = values.std(ddof=1) if len(values) > 1 else 0.0
            cells = formatted([*values, deviation], digits)
            rows.append([label, method, *cells])
    numbers = [str(TUNED + k) for k in range(len(rows[0]) - 3)]
    return Table(name, ["film", "", *numbers, "deviation"], rows, 2)


def claims(methods: Mapping[str, Films]) -> Iterator[Claim]:
    """Yield the patent's claims on its experiment, for our default and the letter."""
    for name, other in (("default", "all six models"), ("patent", "patent, all six")):
        figures = methods[name]
        less = {}
        for figure in ("frame", "mpjpe"):
            less[figure] = figures[figure] - methods[other][figure]
        for text, source, values, unit, bound, above in (
            (
                "the elbow is near the detected one",
                "figure 11",
                figures["elbow_detected"],
                "cm",
                PATENT_CM[1],
                False,
            ),
            (
                "the hand is near the detected one",
                "figure 11",
                figures["hand_detected"],
                "cm",
                PATENT_CM[1],
                False,
            ),
            (
                "the body in space is the true one",
                "figure 9c",
                figures["mpjpe"],
                "mm MPJPE",
                TRUE_MM,
                False,
            ),
            (
                "one model dominates at each time",
                "figure 10",
                figures["dominant"],
                "% of frames",
                95.0,
                True,
            ),
            (
                "it is the right one",
                "figure 10",
                figures["model"],
                "% of frames",
                95.0,
                True,
            ),
            (
                "a right group comes after a change",
                "figure 10",
                figures["delay_change"],
                "frames",
                10.0,
                False,
            ),
            (
                "a group takes less time than six models",
                "effect 2",
                less["frame"],
                "CPU ms",
                0.0,
                False,
            ),
            (
                "a group is more accurate than six models",
                "effect 2",
                less["mpjpe"],
                "mm MPJPE",
                0.0,
                False,
            ),
            (
                "ten frames a second are tracked",
                "effect 3",
                figures["filter"],
                "ms",
                100.0,
                False,
            ),
        ):
            yield Claim(text, source, name, values, unit, bound, above)


def labels_table(name: str, results: Results, method: str) -> Table:
    """Return the share of each label in the frames of each activity.

    All reported films count.
    """
    counts = np.zeros((len(ACTIVITIES), len(LABELS) + 1))
    for run, arrays in results.runs.items():
        if (run.kind, run.method) == ("reported", method):
            np.add.at(counts, (np.array(film_of(run.seed).labels), arrays["label"]), 1)
    shares = 100.0 * counts / counts.sum(axis=1, keepdims=True)
    rows = []
    for activity, row in zip(ACTIVITIES, shares, strict=True):
        rows.append([activity.label, *formatted(row, 0)])
    chance = 100.0 * counts.sum(axis=1).max() / counts.sum()
    return Table(name, [f"% (by chance {chance:.0f})", *LABELS, "none"], rows)


def recovery_table(films: Mapping[str, Films]) -> Table:
    """Return how much worse, in mm of MPJPE, the tracker is without recovery.

    The films are those on which recovery was chosen.
    """
    with_it = films["tuned default"]
    without = films[f"tuned {UNRECOVERED}"]
    worse = without["mpjpe"] - with_it["mpjpe"]
    hands = formatted([with_it["hand"].mean(), without["hand"].mean()], 1)
    row = [
        UNRECOVERED,
        bounded(interval(worse), 1),
        f"{(worse > 0).sum()} of {worse.size}",
        *hands,
    ]
    return Table(
        "recovery",
        ["V14", "worse by mm", "on films", "hand, cm: by default", "without"],
        [row],
    )
