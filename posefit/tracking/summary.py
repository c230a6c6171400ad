"""The last step: errors or signs of trust of a track, and the summary that is printed and written."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from posefit.fitting.shape import NAMES
from posefit.fitting.tracker import Task
from posefit.measuring.gait import backwards, backwards_warning, gait_of
from posefit.progress import Progress
from posefit.tracking.evaluation import LOST, evaluated, unseen
from posefit.tracking.method import Method
from posefit.tracking.options import TrackOptions
from posefit.tracking.outputs import Output
from posefit.tracking.restarts import RELOCALISED
from posefit.tracking.result import Track
from posefit.tracking.smoothing.smooth import Pass
from posefit.tracking.trajectory import Tracked, motion_of
from posefit.tracking.trust import trust_of
from posefit.uncertainty.modes import modes_of, track_modes
from posefit.version import __version__


def evaluate(
    smoothed: Pass,
    method: Method,
    task: Task,
    tracked: Tracked,
    options: TrackOptions,
    output: Output,
    progress: Progress,
    source: Mapping[str, Any],
) -> Track:
    """Return a track with errors against the truth where it is known, else signs of trust, and write its files."""
    scene, shape = smoothed.scene, smoothed.shape
    skeleton = scene.body.skeleton
    frames = [
        frame if frame.posterior is None else replace(frame, modes=modes_of(skeleton, frame.posterior))
        for frame in smoothed.frames
    ]
    posteriors = [frame.posterior for frame in frames]
    modes = track_modes(skeleton, posteriors)
    none = [p.recalibration.none for p in posteriors if p is not None and p.recalibration is not None]
    for warning in method.audit.warnings:
        progress.warn(warning)
    rows, measures = evaluated(scene, frames, method.prior, task.angles, method.beta)
    estimate = motion_of(scene, frames)
    walks_back = backwards(estimate, unseen(rows))
    warnings = [*scene.warnings, *method.audit.warnings]
    if scene.truth is None and (warning := backwards_warning(walks_back)):
        progress.warn(warning)
        warnings.append(warning)
    summary = {
        "motion": scene.name,
        **source,
        "method": method.name,
        "seed": options.seed,
        "frames": len(frames),
        **measures.as_dict(),
        **({"history": frames[0].history.tolist()} if len(frames) == 1 else {}),
        "evaluations_per_frame": task.evaluations,
        "dimensions": method.dimensions(task),
        "hypotheses": tracked.hypotheses,
        "version": __version__,
        "train": [motion.name for motion in task.training],
        "translation": task.translation,
        "first_pose": options.first_pose,
        "smooth": options.smooth,
        "passes": options.passes,
        "kept_pass": smoothed.number,
        "views": len(scene.cameras),
        "camera": scene.placing,
        "size": [scene.cameras[0].width, scene.cameras[0].height],
        "fps": scene.fps,
        "settings": method.settings,
        "body": None
        if shape is None
        else {
            "stature": shape.body.stature,
            "cost": shape.cost,
            "factors": dict(zip(NAMES, shape.factors.tolist(), strict=True)),
            "spread": dict(zip(NAMES, shape.spread.tolist(), strict=True)),
        },
        "modes": [round(mode.weight, 6) for mode in modes] or None,
        "none_of_modes": round(float(np.mean(none)), 6) if none else None,
        "unknown_sides": _numbers(rows, "unknown_sides", 1.0),
        "lost_frames": _numbers(rows, "lost", LOST),
        "relocalised": [scene.first + k for k, frame in enumerate(frames) if RELOCALISED in frame.details],
        "retracked_outside": tracked.stay and tuple(scene.first + k for k in tracked.stay),
        "backwards_share": round(float(walks_back.mean()), 6),
        "trust": None
        if scene.truth is not None
        else trust_of(scene, tracked.frames, frames, rows, measures.iou, task.training),
        "gait": gait_of(estimate, unseen(rows)).as_dict(),
        "warnings": warnings,
    }
    with progress.phase("write"):
        output.finish(scene, frames, rows, summary)
    return Track(estimate, scene.truth, measures, rows, summary, frames, scene, modes)


def _numbers(rows: Sequence[Mapping[str, float]], name: str, least: float) -> list[int] | None:
    """Return the frames that have so much in a column; None where it is blank in all."""
    if np.isnan([row[name] for row in rows]).all():
        return None
    return [int(row["frame"]) for row in rows if row[name] >= least]
