"""All that is known of a track beside its masks, gathered: what `trust` of summary.json is."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.footage.scene import Scene
from posefit.silhouette.cost import project
from posefit.tracking.evaluation import LOST
from posefit.tracking.trust.moving import explained
from posefit.tracking.trust.signs import (
    depth_scatter,
    foot_share,
    held_share,
    jerks,
    longer_side,
    size_ratio,
    stance_spread,
)
from posefit.tracking.trust.verdict import FEWEST, against, grade_of, sentence

COMPARED = 60  # frames whose sizes are compared, spread over the footage
ONE_CAMERA = "one camera cannot tell a small person from a distant one"
NOT_FILMED = "there are masks alone"
NOTHING_MOVES = "nothing moves enough"
SILENT = "the method does not say"
TOO_FEW = "too few frames show the person"


def trust_of(
    scene: Scene,
    found: Sequence[Frame],
    told: Sequence[Frame],
    rows: Sequence[Mapping[str, float]],
    iou: float,
) -> dict[str, Any]:
    """Return whether a track can be trusted: the sentence, the grade, every figure, and why some are not known.

    `found` is what the tracker found, and `told` what is told of it, which may be steadier; `iou` is its overlap with
    the masks. Shares are of the frames that show enough of the person.
    """
    skeleton, fps = scene.body.skeleton, scene.fps
    usable = np.array([row["usable"] == 1.0 for row in rows])
    seen = [row for row, ok in zip(rows, usable, strict=True) if ok]
    joints = skeleton.joints(np.array([one.pose for one in told]), np.array([one.translation for one in told]))
    many = len(seen) >= FEWEST
    ratio = _size(scene, told, usable) if len(scene.cameras) > 1 else None
    figures: dict[str, Any] = {
        "frames": len(seen),
        "size_ratio": ratio,
        "size_m": None if ratio is None else ratio * scene.body.stature,
        "height_m": scene.body.stature,
        "depth_scatter": depth_scatter(_depths(scene, found), usable, fps) if many else None,
        "foot_share": foot_share(joints, usable, fps) if many else None,
        "stance_spread_m": stance_spread(joints, usable, fps) if many else None,
        "explained": explained(scene, told, usable.tolist()),
        "lost": _share(seen, "lost", LOST),
        "unknown": _share(seen, "unknown_sides", 1.0),
        "held": held_share(usable),
        "iou": iou,
        "acceleration": jerks(joints, usable, fps) if many else None,
    }
    signs = against(figures)
    reasons = {
        "size_ratio": ONE_CAMERA if len(scene.cameras) == 1 else TOO_FEW,
        "depth_scatter": TOO_FEW,
        "foot_share": TOO_FEW,
        "stance_spread_m": "no foot stands twice" if many else TOO_FEW,
        "explained": NOT_FILMED if scene.pictures is None else NOTHING_MOVES,
        "lost": SILENT,
        "unknown": SILENT,
    }
    return {
        "sentence": sentence(figures, signs),
        "grade": grade_of(signs),
        "against": [words for _, words in signs],
        **figures,
        "not_told": {name: why for name, why in reasons.items() if figures[name] is None},
    }


def trust_line(trust: Mapping[str, Any]) -> str:
    """Return the signs of a track in one line, each in words; what cannot be told is said, too."""
    size, depth, feet, spread = (trust[name] for name in ("size_m", "depth_scatter", "foot_share", "stance_spread_m"))
    said = {
        "size_ratio": None if size is None else f"size {size:.2f} m, given {trust['height_m']:.2f} m",
        "depth_scatter": None if depth is None else f"distance within {depth:.1%}",
        "foot_share": None if feet is None else f"a foot stands in {feet:.0%} of frames",
        "stance_spread_m": None if spread is None else f"at heights {100.0 * spread:.0f} cm apart",
        "explained": None if trust["explained"] is None else f"the body covers {trust['explained']:.0%} of what moves",
        "lost": None if trust["lost"] is None else f"lost {trust['lost']:.0%}",
        "unknown": None if trust["unknown"] is None else f"sides unknown {trust['unknown']:.0%}",
        "held": f"held {trust['held']:.0%}",
    }
    known = ", ".join(words for words in said.values() if words)
    size_untold = trust["not_told"].get("size_ratio")
    return f"signs: {known}" + (f"; size not told: {size_untold}" if size_untold else "")


def _depths(scene: Scene, found: Sequence[Frame]) -> Array:
    """Return how far (T,) the root was found in front of the first camera."""
    camera = scene.cameras[0]
    places = np.array([one.translation for one in found])
    return np.asarray((places @ camera.rotation.T + camera.translation)[:, 2])


def _size(scene: Scene, told: Sequence[Frame], usable: Any) -> float | None:
    """Return how large the person looks beside the body, over all cameras and frames spread over the footage."""
    shown = np.flatnonzero(usable).tolist()
    seen, fitted = [], []
    for k in shown[:: max(1, len(shown) // COMPARED)]:
        for camera, silhouette in zip(scene.cameras, scene.observations[k].silhouettes, strict=True):
            seen.append(longer_side(silhouette.mask))
            fitted.append(longer_side(project(scene.body, camera, told[k].pose, told[k].translation)))
    return size_ratio(np.array(seen, dtype=np.int64), np.array(fitted, dtype=np.int64))


def _share(rows: Sequence[Mapping[str, float]], name: str, least: float) -> float | None:
    """Return the share of frames that have so much in a column, of those of which it is said; None where of none."""
    values = np.array([row[name] for row in rows])
    said = np.isfinite(values)
    return float((values[said] >= least).mean()) if said.any() else None
