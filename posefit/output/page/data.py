"""The data of a track's page: bodies, figures, intervals and text."""

import base64
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.evaluation.errors import FRAME, Table, flagged
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import unwrapped, wrapped
from posefit.geometry.skeleton import INNER, JOINTS, PARENTS, SIDES
from posefit.measuring.angles import COLUMNS, clinical_angles
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import stride_curves
from posefit.motion.motion import Motion
from posefit.output.content import Content
from posefit.output.page.stills import Stills
from posefit.output.picture import MIN_OTHER_WEIGHT
from posefit.output.text import brief, gait_line, gait_rows, held_frames, undetermined
from posefit.uncertainty.modes import other_mode
from posefit.version import __version__

TENTH = 0.1  # degrees: the unit of angles in a page
UNIT = np.radians(TENTH)
MAX_16_BITS = 32_767
# the fields of a `Measure` that the page uses
FIGURE_FIELDS = ("label", "unit", "digits", "factor")
CURVES = (
    "mpjpe_mm",
    "error_degrees",
    "iou",
    "cost",
    "pa_mpjpe_mm",
    "geodesic_degrees",
    "evaluations",
    "wall_seconds",
)
MARKS: dict[str, Callable[[Table], NDArray[np.bool_]]] = {
    "held": lambda table: table["usable"] == 0.0,
    "lost": lambda table: _flags(table, "lost"),
    "unknown": lambda table: _flags(table, "unknown_sides"),
}


def _angle_names() -> list[str]:
    names = ["root yaw", "root pitch", "root roll"]
    for k in INNER:
        bone = f"bone to the {PLACES[k].replace('_', ' ')}"
        names += [f"{JOINTS[k]} {axis} ({bone})" for axis in "xyz"]
    return names


ANGLE_NAMES = tuple(_angle_names())


def _flags(table: Table, name: str) -> NDArray[np.bool_]:
    frames = flagged(table, name)
    return np.zeros(len(table["frame"]), bool) if frames is None else frames.frames


def track_data(content: Content, stills: Stills) -> dict[str, Any]:
    """Return the data of the page.

    Joints are in millimetres from the first position of the root, and angles in tenths
    of a degree, with 16 bits per number. Of a long track every `step`-th frame is
    shown. A frame is marked if it or a frame left out after it is marked.
    """
    scene = content.scene
    frames = content.frames
    setup = content.setup
    step = stills.step
    estimate = content.motion
    joints = estimate.joints[::step]
    origin = np.round(joints[0, 0], 3)
    truth = scene.truth
    true_joints = None
    true_clinical = None
    if truth is not None:
        true_joints = in_16_bits(truth.joints[::step] - origin)
        true_clinical = in_16_bits(_clinical(truth, step), TENTH)
    quality = "" if truth is None else f": {brief(content)[0]}"
    day = time.strftime("%d %B %Y")
    return {
        "version": __version__,
        "title": setup.motion,
        "made": f"Tracked by {setup.method}, written on {day}{quality}.",
        "verdict": _verdict(content),
        "notes": [*filter(None, [held_frames(content)]), *content.log.warnings],
        "facts": _facts(content),
        "joints": JOINTS,
        "places": [place.replace("_", " ") for place in PLACES],
        "parents": PARENTS,
        "sides": SIDES,
        "radii": np.round(scene.body.radii, 4).tolist(),
        "count": len(frames),
        "first": scene.first,
        "step": step,
        "fps": estimate.fps,
        "cameras": [camera_from_origin(camera, origin) for camera in scene.cameras],
        **stills.as_dict(),
        "estimate": in_16_bits(joints - origin),
        "truth": true_joints,
        "others": _others(scene, frames[::step], origin),
        **_figures(content.table, step),
        "gait": _gait(content) if len(frames) > 1 else None,
        "angles": _angles(estimate, truth, step),
        "clinical": {
            "names": [name.replace("_", " ") for name in COLUMNS],
            "values": in_16_bits(_clinical(estimate, step), TENTH),
            "truth": true_clinical,
        },
        "intervals": _intervals(content, step),
    }


def _figures(table: Table, step: int) -> dict[str, Any]:
    """Return the figures of frames, what they are, and which frames are marked."""
    columns = {}
    rows = {}
    for name in CURVES:
        if name in table:
            columns[name] = {key: getattr(FRAME[name], key) for key in FIGURE_FIELDS}
            rows[name] = table[name][::step].tolist()
    marks = {}
    for name, marked in MARKS.items():
        # the number of a picture, as the page has one of every `step` frames
        pictures = np.flatnonzero(marked(table)) // step
        marks[name] = np.unique(pictures).tolist()
    return {"columns": columns, "rows": rows, "marks": marks}


def _angles(estimate: Motion, truth: Motion | None, step: int) -> dict[str, Any]:
    """Return the angles that a skeleton leaves free, and their names."""
    free = estimate.skeleton.free
    angles = unwrapped(estimate.poses)[::step]
    true_angles = None
    if truth is not None:
        # within half a turn of the estimate, so that both curves can be compared
        near = angles - wrapped(angles - truth.poses[::step])
        true_angles = in_16_bits(near[:, free], UNIT)
    return {
        "names": [ANGLE_NAMES[k] for k in np.flatnonzero(free)],
        "values": in_16_bits(angles[:, free], UNIT),
        "truth": true_angles,
    }


def _intervals(content: Content, step: int) -> dict[str, Any] | None:
    """Return the intervals of joints and free angles; None without a posterior."""
    intervals = content.intervals
    if not intervals:
        return None
    free = content.motion.skeleton.free
    return {
        "levels": [round(100 * level) for level in intervals["levels"].tolist()],
        "joints": in_16_bits(intervals["joint_radii"][::step]),
        "angles": in_16_bits(intervals["angle_halves"][::step, :, free], UNIT),
    }


def _verdict(content: Content) -> str:
    """Return the trust in the track, and everything undetermined.

    If the truth is known, no trust is reported.
    """
    trust = "" if content.trust is None else f"{content.trust.sentence} "
    if not_determined := undetermined(content):
        return f"{trust}Not determined: {not_determined}."
    certainties = (
        (content.log.unknown_sides, "which side is left"),
        (content.log.lost_frames, "which frames are lost"),
    )
    missing = [words for reported, words in certainties if reported is None]
    unreported = " or ".join(missing)
    if unreported:
        return (
            f"{trust}The method does not report {unreported}: "
            "frames without a mark may be wrong too."
        )
    return (
        f"{trust}The method reports no frame as lost, "
        "and left and right as known in every frame."
    )


def _facts(content: Content) -> list[list[str]]:
    setup = content.setup
    measures = content.measures
    facts = [
        ["method", setup.method],
        ["seed", str(setup.seed)],
        ["cameras", f"{setup.views}, {setup.camera}"],
        ["translation", setup.translation],
        ["IoU", f"{measures.iou:.3f}"],
        ["posefit", setup.version],
    ]
    if measures.mpjpe_mm is not None:
        facts.insert(0, ["MPJPE", f"{measures.mpjpe_mm:.0f} mm"])
    return facts


def _others(scene: Scene, frames: Sequence[Frame], origin: Array) -> dict[str, Any]:
    """Return the other likely poses: numbers of frames, weights and joints."""
    skeleton = scene.body.skeleton
    numbers = []  # of the frames that have another likely pose
    weights = []
    joints = []
    for k, frame in enumerate(frames):
        mode = other_mode(skeleton, frame.modes, frame.pose, MIN_OTHER_WEIGHT)
        if mode is None:
            continue
        numbers.append(k)
        weights.append(mode.weight)
        joints.append(skeleton.joints(mode.pose, mode.translation) - origin)
    return {
        "at": numbers,
        "weights": weights,
        "joints": in_16_bits(np.array(joints)),
    }


def _gait(content: Content) -> dict[str, Any]:
    """Return the gait as text and by side, and the flexion of the knees over a stride.

    The flexion has its mean, and the mean minus and plus a standard deviation.
    """
    gait = content.gait.as_dict()
    knees = {}
    if gait["walk"]:
        flexions = stride_curves(content.motion, content.gait, "knee_flexion")
        for side, curves in flexions.items():
            mean = np.empty(0)
            spread = np.empty(0)
            if len(curves):
                mean = curves.mean(axis=0)
                spread = curves.std(axis=0)
            knees[side] = {
                "mean": np.round(mean, 1).tolist(),
                "low": np.round(mean - spread, 1).tolist(),
                "high": np.round(mean + spread, 1).tolist(),
                "strides": len(curves),
            }
    rows = gait_rows(gait) if gait["walk"] else []
    return {"text": gait_line(gait, by_side=False), "rows": rows, "knees": knees}


def _clinical(motion: Motion, step: int) -> Array:
    """Return the clinical angles (T, n) in degrees of every `step`-th frame."""
    angles = clinical_angles(motion.skeleton, motion.poses)
    return np.column_stack([angles[name] for name in COLUMNS])[::step]


def in_16_bits(values: Array, unit: float = 1e-3) -> str:
    """Return numbers as 16-bit multiples of a unit, little-endian in base 64.

    The default unit turns metres into millimetres. Larger values are clipped to 32,767
    units; NaN is -32,768.
    """
    units = np.round(np.asarray(values, dtype=np.float64) / unit)
    units = np.clip(units, -MAX_16_BITS, MAX_16_BITS)
    whole = np.where(np.isnan(units), -MAX_16_BITS - 1, units).astype("<i2")
    return base64.b64encode(whole.tobytes()).decode()


def camera_from_origin(camera: Camera, origin: Array) -> dict[str, Any]:
    """Return a camera for the page, for points relative to an origin."""
    translation = camera.translation + camera.rotation @ origin
    return {
        "size": [camera.width, camera.height],
        "focal": np.round(camera.focal, 3).tolist(),
        "centre": np.round(camera.centre, 3).tolist(),
        "rotation": np.round(camera.rotation, 6).tolist(),
        "translation": np.round(translation, 6).tolist(),
    }
