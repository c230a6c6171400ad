"""What a track of footage that was made from the truth is worth."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from composites.situations import Situation
from posefit.arrays import Array
from posefit.fitting import metrics
from posefit.fitting.metrics import LOST_MM
from posefit.geometry.body import Body
from posefit.motion.motion import Motion
from posefit.motion.steadiness import acceleration, slides, standing
from posefit.silhouette.cost import project
from posefit.tracking.evaluation import LOST
from posefit.tracking.run import Track

Masks = NDArray[np.bool_]  # (views, T, height, width)


def uncut(masks: Masks) -> NDArray[np.bool_]:
    """Return in which frames of each view (views, T) somebody is seen and nowhere cut by the picture's border."""
    edges = (masks[:, :, 0], masks[:, :, -1], masks[..., 0], masks[..., -1])
    return np.asarray(masks.any(axis=(2, 3)) & ~np.any([edge.any(axis=2) for edge in edges], axis=0))


def extraction_figures(masks: Masks, usable: NDArray[np.bool_], truth: Masks) -> dict[str, Any]:
    """Return how well masks (views, T) that were taken out agree with the true ones, where somebody is whole."""
    seen = uncut(truth)
    overlaps = _overlaps(masks, truth)
    return {
        "mask_iou": float(overlaps[seen].mean()),
        "mask_iou_worst_view": float(min(one[ok].mean() for one, ok in zip(overlaps, seen, strict=True) if ok.any())),
        "mask_half": float((overlaps[seen] < 0.5).mean()),
        "usable": float(usable[seen].mean()),
    }


def track_figures(track: Track, radii: Array, situation: Situation, truth: Masks) -> dict[str, Any]:
    """Return what a track is worth in the frames in which a camera sees all of the person."""
    actor = situation.actors[0]
    seen = np.asarray(uncut(truth).any(axis=0))
    estimate, body = track.motion, Body(track.motion.skeleton, radii)
    true_joints = actor.motion.skeleton.joints(actor.motion.poses, actor.motion.translations)
    joints = estimate.skeleton.joints(estimate.poses, estimate.translations)
    mpjpe = metrics.mpjpe_mm(true_joints, joints)
    away = 1e3 * np.linalg.norm(joints[:, 0] - true_joints[:, 0], axis=1)
    facing = np.cos(estimate.poses[:, 0] - actor.motion.poses[:, 0]) > 0.0
    said = {name: np.array([row.get(name, np.nan) for row in track.frames]) for name in ("lost", "unknown_sides")}
    return {
        "seen": int(seen.sum()),
        "body_iou": _body_iou(estimate, body, situation, truth),
        "claimed_iou": track.measures.iou,
        "mpjpe_mm": float(mpjpe[seen].mean()),
        "place_mm": float(np.median(away[seen])),
        "facing_right": float(facing[seen].mean()),
        "lost": float((mpjpe[seen] > LOST_MM).mean()),
        "swapped": float(metrics.swapped(true_joints, joints)[seen].mean()),
        "said_lost": _share(said["lost"][seen] >= LOST, said["lost"][seen]),
        "said_unknown": _share(said["unknown_sides"][seen] == 1.0, said["unknown_sides"][seen]),
        "held": float(1.0 - np.array([row["usable"] for row in track.frames])[seen].mean()),
        "stature_cm": 100.0 * (body.stature - actor.body.stature),
        **steadiness(true_joints, joints, seen, estimate.fps),
        **_others(situation, joints, seen),
    }


def steadiness(true_joints: Array, joints: Array, seen: NDArray[np.bool_], fps: float) -> dict[str, Any]:
    """Return how joints accelerate and feet slide beside the truth's own, in the runs of frames that are seen.

    A fitted foot slides while the true one stands, and, as anybody would see it, while it stands itself.
    """
    felt, true_felt = (acceleration(one, fps) for one in (joints, true_joints))
    inner = seen & np.roll(seen, 1) & np.roll(seen, -1) & np.isfinite(felt)
    stands = standing(true_joints, fps) & seen[:, None]
    own = standing(joints, fps) & seen[:, None]
    found = {
        "slide_cm": slides(joints, stands),
        "own_slide_cm": slides(joints, own),
        "true_slide_cm": slides(true_joints, stands),
    }
    mean, true_mean = (float(one[inner].mean()) for one in (felt, true_felt))
    return {
        "acceleration": mean,
        "true_acceleration": true_mean,
        **{name: 100.0 * float(steps.mean()) if len(steps) else None for name, steps in found.items()},
    }


def _others(situation: Situation, joints: Array, seen: NDArray[np.bool_]) -> dict[str, Any]:
    """Return in what share of the frames somebody else is followed, where there is anybody else."""
    if len(situation.actors) < 2:
        return {}
    away = [
        np.where(actor.present, np.linalg.norm(joints[:, 0] - actor.motion.translations, axis=1), np.inf)
        for actor in situation.actors
    ]
    return {"other_person": float((np.argmin(away, axis=0) > 0)[seen].mean())}


def _body_iou(estimate: Motion, body: Body, situation: Situation, truth: Masks) -> float:
    """Return the overlap of the fitted body with the whole true one, seen by the cameras that see all of it."""
    actor, found = situation.actors[0], []
    for camera, seen in zip(situation.cameras, uncut(truth), strict=True):
        for k in np.flatnonzero(seen):
            true = project(actor.body, camera, actor.motion.poses[k], actor.motion.translations[k])
            fitted = project(body, camera, estimate.poses[k], estimate.translations[k])
            found.append(float(_overlaps(fitted, true)))
    return float(np.mean(found))


def _overlaps(first: NDArray[np.bool_], second: NDArray[np.bool_]) -> Array:
    """Return the intersection over union of masks (..., height, width); 1 where both are empty."""
    either = (first | second).sum(axis=(-2, -1))
    return np.asarray(np.where(either > 0, (first & second).sum(axis=(-2, -1)) / np.maximum(either, 1), 1.0))


def _share(flags: NDArray[np.bool_], values: Array) -> float | None:
    """Return the share of true flags, None where nobody says."""
    return float(flags.mean()) if np.isfinite(values).any() else None
