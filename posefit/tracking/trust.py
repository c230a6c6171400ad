"""Can a track be trusted, where the truth is unknown? Signs beside the mask, and one sentence that they come to.

The signs are of size, depth, standing feet and what moves in the pictures; each has a limit from which on it makes a
track doubtful, and one from which on useless. docs/howto/trust.md has the limits and the footage that they are from.
"""

from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.tracker import Frame
from posefit.footage.quality import AROUND, LAG, changed_pixels
from posefit.footage.scene import Scene
from posefit.motion.steadiness import BALLS, acceleration, runs, standing
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.tracking.evaluation import LOST

SMOOTH_SECONDS = 0.5  # before and after a frame, to which a smooth path is fitted
MIN_SMOOTH_FRAMES = 5  # of such a fit
SCATTER_QUANTILE = 0.9  # of frames that lie nearer to that path


def longer_side(mask: Mask) -> int:
    """Return the longer side in pixels of a mask's bounding box, 0 where it is empty or cut by the picture's edge."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows) or rows[0] == 0 or columns[0] == 0 or rows[-1] + 1 == len(mask) or columns[-1] + 1 == len(mask[0]):
        return 0
    return int(max(rows[-1] - rows[0], columns[-1] - columns[0])) + 1


def size_ratio(observed: NDArray[np.int64], fitted: NDArray[np.int64]) -> float | None:
    """Return how large the person looks beside the fitted body, the median; None where nothing can be compared.

    Both are longer sides (n,) in pixels, 0 where they are not known.
    """
    both = (observed > 0) & (fitted > 0)
    return float(np.median(observed[both] / fitted[both])) if both.any() else None


def depth_scatter(depths: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how far estimated depths (T,) lie off a smooth path, as a share of the depth; None of too few.

    Nine in ten usable frames lie nearer. The path is the parabola through the frames within half a second.
    """
    known = np.flatnonzero(usable & (depths > 0.0))
    away = []
    for k in known:
        near = known[np.abs(known - k) <= SMOOTH_SECONDS * fps]
        if len(near) < MIN_SMOOTH_FRAMES:
            continue
        way = np.polynomial.Polynomial.fit(near - k, depths[near], 2)
        away.append(abs(depths[k] - way(0.0)) / depths[k])
    return float(np.quantile(away, SCATTER_QUANTILE)) if away else None


def held_share(usable: NDArray[np.bool_]) -> float:
    """Return the share of frames that are not usable (T,) between the first and the last that are; 1 where none is.

    Frames before the person comes and after they have gone say nothing against a track.
    """
    known = np.flatnonzero(usable)
    return 1.0 - len(known) / float(known[-1] + 1 - known[0]) if len(known) else 1.0


def jerks(joints: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how fast joints (T, 27, 3) accelerate, the mean over usable frames, in m/s2; None where none tells."""
    known = acceleration(joints, fps)[usable]
    known = known[np.isfinite(known)]
    return float(known.mean()) if len(known) else None


def foot_share(joints: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return the share of usable frames in which a foot stands, of joints (T, 27, 3); None where no frame is usable."""
    one = standing(joints, fps)
    return float((one[:, 0] | one[:, 1])[usable].mean()) if usable.any() else None


def stance_spread(joints: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how far apart in metres the heights are at which feet stand (T, 27, 3); None where none stands twice.

    It is the standard deviation over stances of the ball's height, y being up.
    """
    stands = standing(joints, fps) & usable[:, None]
    heights = []
    for side, ball in enumerate(BALLS):
        heights += [float(joints[start:stop, ball, 1].mean()) for start, stop in runs(stands[:, side])]
    return float(np.std(heights)) if len(heights) > 1 else None


CLOTHES = 0.05  # of the person's longer side: motion as near as that to the body is its own clothes' and hair's
MIN_MOVED = 0.02  # of the body's area: fewer pixels that moved are noise


def explained(scene: Scene, frames: Sequence[Frame], usable: Sequence[bool]) -> float | None:
    """Return which share of the pixels that move, at the person and around, the fitted body covers.

    The pixels of all usable frames count together, as the first camera filmed them. None without pictures, or where
    nothing moves.
    """
    if scene.pictures is None:
        return None
    counts = [count for count, ok in zip(_counts(scene, frames, scene.pictures()), usable, strict=False) if ok]
    inside, all_of_them = np.sum(counts, axis=0) if counts else (0, 0)
    return float(inside / all_of_them) if all_of_them else None


def covered(image: Image, then: Image, body: Mask, observed: Mask, reach: float) -> tuple[int, int]:
    """Return how many pixels that moved since another picture lie at the body, and how many there are.

    Only pixels as near as half of `reach`, the person's longer side in pixels, to the body or to what was
    observed mask count; both masks are those of the two pictures together.
    """
    either = body | observed
    if not either.any():
        return 0, 0
    rows, columns = np.flatnonzero(either.any(axis=1)), np.flatnonzero(either.any(axis=0))
    far = round(AROUND * reach)
    window = np.s_[
        max(0, rows[0] - far) : rows[-1] + 1 + far,
        max(0, columns[0] - far) : columns[-1] + 1 + far,
    ]
    changed = changed_pixels(image, then)[window]
    count = int(changed.sum())
    if count <= MIN_MOVED * body.sum():
        return 0, 0
    width = 2 * max(1, round(CLOTHES * reach)) + 1
    near = cv2.dilate(body[window].astype(np.uint8), np.ones((width, width), dtype=np.uint8)) > 0
    return int((changed & near).sum()), count


def _counts(scene: Scene, frames: Sequence[Frame], pictures: Iterator[Image]) -> Iterator[tuple[int, int]]:
    """Yield what `covered` gives for each frame; nothing moves before the first."""
    camera, reach = scene.cameras[0], 0
    before: deque[tuple[Image, Mask, Mask]] = deque(maxlen=max(1, round(LAG * scene.fps)))
    for frame, observation, image in zip(frames, scene.observations, pictures, strict=False):
        body, observed = project(scene.body, camera, frame.pose, frame.translation), observation.silhouettes[0].mask
        reach = max(reach, longer_side(observed))
        if before:
            then, old_body, old_observed = before[0]
            yield covered(image, then, body | old_body, observed | old_observed, reach)
        else:
            yield 0, 0
        before.append((image, body, observed))


Grade = Literal["good", "doubtful", "useless"]
_BEGINNING: dict[Grade, str] = {"good": "good. ", "doubtful": "doubtful: ", "useless": "do not use: "}
TOGETHER = 3  # signs that make a track doubtful make it useless together
FEWEST = 12  # frames below which nothing can be said of depth, feet and motion together


@dataclass(frozen=True)
class Sign:
    """From where on a figure makes a track doubtful or useless, and how that is said; `bad` grows as it gets worse."""

    name: str
    bad: Callable[[float], float]
    doubtful: float
    useless: float
    words: Callable[[Mapping[str, Any]], str]


def _as_it_is(value: float) -> float:
    return value


def _missing(value: float) -> float:
    return 1.0 - value


# The limits are ours, from footage made from the truth and the demonstration video: docs/howto/trust.md has them.
SIGNS = (
    Sign(
        "frames",
        lambda count: FEWEST - count,
        0.0,
        FEWEST,
        lambda f: f"{f['frames']} frames that show the person are too few to judge by",
    ),
    Sign("lost", _as_it_is, 0.15, 0.5, lambda f: f"the person is lost in {f['lost']:.0%} of the frames"),
    Sign(
        "held",
        _as_it_is,
        0.25,
        0.6,
        lambda f: f"the person is gone, or nearly, in {f['held']:.0%} of the frames in between",
    ),
    Sign("unknown", _as_it_is, 0.1, 1.0, lambda f: f"left and right are unknown in {f['unknown']:.0%} of the frames"),
    Sign("iou", _missing, 0.35, 0.55, lambda f: f"the body and the mask overlap by {f['iou']:.0%} only"),
    Sign(
        "size_ratio",
        lambda ratio: abs(ratio - 1.0),
        0.08,
        0.3,
        lambda f: f"the person seems to be {f['size_m']:.2f} m tall, not {f['height_m']:.2f} m",
    ),
    Sign("depth_scatter", _as_it_is, 0.04, 0.2, lambda f: f"the distance jumps by {f['depth_scatter']:.0%}"),
    Sign("foot_share", _missing, 0.8, 1.0, lambda f: f"a foot stands in {f['foot_share']:.0%} of the frames only"),
    Sign(
        "stance_spread_m", _as_it_is, 0.15, 0.6, lambda f: f"feet stand at heights {f['stance_spread_m']:.2f} m apart"
    ),
    Sign("explained", _missing, 0.3, 0.6, lambda f: f"the body covers {f['explained']:.0%} of what moves only"),
    Sign("acceleration", _as_it_is, 14.0, 60.0, lambda f: f"joints jerk, by {f['acceleration']:.0f} m/s2"),
)


def against(figures: Mapping[str, Any]) -> list[tuple[Grade, str]]:
    """Return what speaks against a track, the worst first, by figures named as `SIGNS`; None of them is not known."""
    signs: list[tuple[float, str]] = []
    for sign in SIGNS:
        if figures[sign.name] is None:
            continue
        severity = (sign.bad(figures[sign.name]) - sign.doubtful) / (sign.useless - sign.doubtful)
        if severity > 0.0:
            signs.append((severity, sign.words(figures)))
    signs.sort(key=lambda one: one[0], reverse=True)
    return [("useless" if severity > 1.0 else "doubtful", words) for severity, words in signs]


def grade_of(signs: Sequence[tuple[Grade, str]]) -> Grade:
    """Return what signs come to: that of the worst, but three doubtful ones together are as bad as a useless one."""
    if not signs:
        return "good"
    return "useless" if len(signs) >= TOGETHER else signs[0][0]


def sentence(figures: Mapping[str, Any], signs: Sequence[tuple[Grade, str]]) -> str:
    """Return whether a track can be trusted: the grade, and the worst sign or what speaks for it."""
    beginning = f"Trust: {_BEGINNING[grade_of(signs)]}"
    if not signs:
        return f"{beginning}No sign speaks against it: {_fine(figures)}."
    more = len(signs) - 1
    others = "" if not more else f", and {more} more sign{'s speak' if more > 1 else ' speaks'} against it"
    return f"{beginning}{signs[0][1]}{others}."


def _fine(figures: Mapping[str, Any]) -> str:
    """Return the figures that are known of a good track, in words."""
    size, depth, feet = figures["size_m"], figures["depth_scatter"], figures["foot_share"]
    moving, unknown = figures["explained"], figures["unknown"]
    parts = [
        "" if size is None else f"{size:.2f} m tall, given {figures['height_m']:.2f} m",
        "" if depth is None else f"the distance keeps to {depth:.1%}",
        "" if feet is None else f"a foot stands in {feet:.0%} of the frames",
        "" if moving is None else f"the body covers {moving:.0%} of what moves",
        "" if unknown is None else f"left and right are known in {1.0 - unknown:.0%}",
    ]
    return ", ".join(part for part in parts if part)


SIZED_FRAMES = 60  # frames whose sizes are compared, spread over the footage
ONE_CAMERA = "one camera cannot tell a small person from a distant one"
NOT_FILMED = "there are masks alone"
NOTHING_MOVES = "nothing moves enough"
SILENT = "the method does not say"
TOO_FEW = "too few frames show the person"


def trust_of(
    scene: Scene,
    tracked: Sequence[Frame],
    frames: Sequence[Frame],
    rows: Sequence[Mapping[str, float]],
    iou: float,
) -> dict[str, Any]:
    """Return whether a track can be trusted: the sentence, the grade, every figure, and why some are not known.

    `tracked` are the tracker's frames, and `frames` these in the end, smoothed; `iou` is their overlap with
    the masks. Shares are of the frames that show enough of the person.
    """
    skeleton, fps = scene.body.skeleton, scene.fps
    usable = np.array([row["usable"] == 1.0 for row in rows])
    shown = [row for row, ok in zip(rows, usable, strict=True) if ok]
    joints = skeleton.joints(np.array([one.pose for one in frames]), np.array([one.translation for one in frames]))
    many = len(shown) >= FEWEST
    ratio = _size(scene, frames, usable) if len(scene.cameras) > 1 else None
    figures: dict[str, Any] = {
        "frames": len(shown),
        "size_ratio": ratio,
        "size_m": None if ratio is None else ratio * scene.body.stature,
        "height_m": scene.body.stature,
        "depth_scatter": depth_scatter(_depths(scene, tracked), usable, fps) if many else None,
        "foot_share": foot_share(joints, usable, fps) if many else None,
        "stance_spread_m": stance_spread(joints, usable, fps) if many else None,
        "explained": explained(scene, frames, usable.tolist()),
        "lost": _share(shown, "lost", LOST),
        "unknown": _share(shown, "unknown_sides", 1.0),
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
        "unknown_signs": {name: why for name, why in reasons.items() if figures[name] is None},
    }


def trust_line(trust: Mapping[str, Any]) -> str:
    """Return the signs of a track in one line, each in words, also those that are unknown."""
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
    size_unknown = trust["unknown_signs"].get("size_ratio")
    return f"signs: {known}" + (f"; size unknown: {size_unknown}" if size_unknown else "")


def _depths(scene: Scene, frames: Sequence[Frame]) -> Array:
    """Return how far (T,) the root is in front of the first camera."""
    camera = scene.cameras[0]
    places = np.array([one.translation for one in frames])
    return np.asarray((places @ camera.rotation.T + camera.translation)[:, 2])


def _size(scene: Scene, frames: Sequence[Frame], usable: Any) -> float | None:
    """Return how large the person looks beside the body, over all cameras and frames spread over the footage."""
    shown = np.flatnonzero(usable).tolist()
    observed, fitted = [], []
    for k in shown[:: max(1, len(shown) // SIZED_FRAMES)]:
        for camera, silhouette in zip(scene.cameras, scene.observations[k].silhouettes, strict=True):
            observed.append(longer_side(silhouette.mask))
            fitted.append(longer_side(project(scene.body, camera, frames[k].pose, frames[k].translation)))
    return size_ratio(np.array(observed, dtype=np.int64), np.array(fitted, dtype=np.int64))


def _share(rows: Sequence[Mapping[str, float]], name: str, least: float) -> float | None:
    """Return the share of frames that have so much in a column, of those of which it is said; None where of none."""
    values = np.array([row[name] for row in rows])
    said = np.isfinite(values)
    return float((values[said] >= least).mean()) if said.any() else None
