"""Can a track be trusted, where the truth is unknown? Signs beside the mask, and one sentence that they come to.

The signs are of size, depth, standing feet and what moves in the pictures; each has a limit from which on it makes a
track doubtful, and one from which on useless. docs/howto/trust.md has the limits and the footage that they are from.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.evaluation.errors import LOST, Table, mean_known
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.quality import LAG, changed_pixels, moved_pixels
from posefit.footage.scene import Scene
from posefit.geometry.skeleton import Skeleton
from posefit.geometry.symmetry import facing, mirrored_poses
from posefit.motion.motion import Motion
from posefit.motion.steadiness import BALLS, acceleration, runs, standing
from posefit.reading import counted
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask, touches_border
from posefit.uncertainty.modes import poses_apart

SMOOTH_SECONDS = 0.5  # before and after a frame, to which a smooth path is fitted
MIN_SMOOTH_FRAMES = 5  # of such a fit
SCATTER_QUANTILE = 0.9  # of frames that lie nearer to that path
TRAINING_SECONDS = 1.0 / 15.0  # between poses of a motion that others are compared with
# of the person's longer side: motion as near as that to the body is its own clothes'
# and hair's
CLOTHES = 0.05
MIN_MOVED = 0.02  # of the body's area: fewer pixels that moved are noise
USELESS_TOGETHER = 3  # signs that make a track doubtful make it useless together
MIN_FRAMES = 12  # fewer are too few to judge depth, feet and motion by
SAMPLED_FRAMES = 60  # spread over the footage, whose sizes and poses are compared
# within 20 degrees of the line of sight a person is seen from the front or the back
FRONTAL = np.sin(np.radians(20.0))
MAX_STATIONARY_METRES = 1.0  # along the ground's axes: who stays within walks nowhere

# why a sign is unknown
ONE_CAMERA = "one camera cannot tell a small person from a distant one"
SEVERAL = "several cameras see the depth"
NOT_REPORTED = "the method does not say"
MASKS_ALONE = "there are masks alone"
STILL = "nothing moves enough"
MOVES = "the camera moves"
TOO_FEW = "too few frames show the person"
IN_PLACE = "the person stays in one place, as on a treadmill, whose belt moves the feet"


def longer_side(mask: Mask) -> int:
    """Return the longer side in pixels of a mask's bounding box, 0 where it is empty or cut by the picture's edge."""
    return (
        0 if touches_border(mask) else max(cv2.boundingRect(mask.astype(np.uint8))[2:])
    )


def depth_scatter(depths: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how far estimated depths (T,) lie off a smooth path, as a share of the depth; None of too few.

    Nine in ten usable frames lie nearer. The path is the parabola through the frames within half a second.
    """
    known = np.flatnonzero(usable & (depths > 0.0))
    away = []
    for k in known:
        near = known[np.abs(known - k) <= SMOOTH_SECONDS * fps]
        if len(near) >= MIN_SMOOTH_FRAMES:
            path = np.polynomial.Polynomial.fit(near - k, depths[near], 2)
            away.append(abs(depths[k] - path(0.0)) / depths[k])
    return float(np.quantile(away, SCATTER_QUANTILE)) if away else None


def held_share(usable: NDArray[np.bool_], cut: NDArray[np.bool_]) -> float:
    """Return the share of frames that are not usable (T,) between the first and the last that are; 1 where none is.

    Frames before the person comes and after they have gone say nothing against a track; nor does a gap that begins or
    ends with a mask `cut` (T,) by the picture's border: there the person was out of the picture.
    """
    known = np.flatnonzero(usable)
    if not len(known):
        return 1.0
    gaps = [
        (start, stop) for start, stop in runs(~usable) if known[0] < start < known[-1]
    ]
    lost = [
        stop - start
        for start, stop in gaps
        if not cut[[start - 1, start, stop - 1, stop]].any()
    ]
    return sum(lost) / float(known[-1] + 1 - known[0])


def stance_spread(joints: Array, stands: NDArray[np.bool_]) -> float | None:
    """Return how far apart in metres the heights are at which feet stand, of joints (T, 27, 3); None of one stance.

    It is the standard deviation over stances (T, 2) of the ball's height, y being up.
    """
    each = [
        (start, stop, ball)
        for ball, flags in zip(BALLS, stands.T, strict=True)
        for start, stop in runs(flags)
    ]
    heights = [joints[start:stop, ball, 1].mean() for start, stop, ball in each]
    return float(np.std(heights)) if len(heights) > 1 else None


def training_distances(
    skeleton: Skeleton, poses: Array, training: Sequence[Motion]
) -> Array:
    """Return how far poses (n, 66) are from the nearest of some motions (n,): metres, the mean over joints.

    All are turned to yaw 0, and mirror images count, too. Infinite without any motion.
    """
    both = np.concatenate([poses, mirrored_poses(skeleton, poses)])
    nearest = np.full(2 * len(poses), np.inf)
    both[:, 0] = 0.0
    for motion in training:
        others = motion.poses[:: max(1, round(TRAINING_SECONDS * motion.fps))].copy()
        others[:, 0] = 0.0
        np.minimum(
            nearest, poses_apart(skeleton, both, others).min(axis=1), out=nearest
        )
    return np.asarray(nearest.reshape(2, -1).min(axis=0))


def explained_share(
    scene: Scene, frames: Sequence[Frame], usable: NDArray[np.bool_]
) -> float | None:
    """Return which share of the pixels that move, at the person and around, the fitted body covers.

    The pixels of all usable frames (T,) count together, as the first camera filmed them. None without pictures, or
    where nothing moves.
    """
    if scene.pictures is None:
        return None
    camera = scene.cameras[0]
    reach = 0
    counts = np.zeros(2, dtype=np.int64)
    before: deque[tuple[Image, Mask, Mask]] = deque(
        maxlen=max(1, round(LAG * scene.fps))
    )
    for ok, frame, observation, image in zip(
        usable, frames, scene.observations, scene.pictures(), strict=False
    ):
        body = project(scene.body, camera, frame.pose, frame.translation)
        observed = observation.silhouettes[0].mask
        reach = max(reach, longer_side(observed))
        if before and ok:
            then, old_body, old_observed = before[0]
            counts += covered_pixels(
                image, then, body | old_body, observed | old_observed, reach
            )
        before.append((image, body, observed))
    return float(counts[0] / counts[1]) if counts[1] else None


def covered_pixels(
    image: Image, then: Image, body: Mask, observed: Mask, reach: float
) -> tuple[int, int]:
    """Return how many pixels that moved since another picture lie at the body, and how many there are.

    Only pixels as near as half of `reach`, the person's longer side in pixels, to the body or to what was
    observed count; both masks are those of the two pictures together.
    """
    region = body | observed
    if not region.any():
        return 0, 0
    moved, inside = moved_pixels(
        changed_pixels(image, then), region, body, reach, CLOTHES
    )
    return (inside, moved) if moved > MIN_MOVED * body.sum() else (0, 0)


Grade = Literal["good", "doubtful", "useless"]
_BEGINNING: dict[Grade, str] = {
    "good": "good. ",
    "doubtful": "doubtful: ",
    "useless": "do not use: ",
}


@dataclass(frozen=True)
class Sign:
    """How far a figure may be off its best value until a track is doubtful or useless, and its words.

    Words are formats of all figures: what speaks `against` a track, and how the figure is `listed`.
    """

    # the best, and how far off is doubtful and useless; None: never
    limits: tuple[float, float, float] | None
    against: str = ""
    listed: str = ""


def _sign(
    limits: tuple[float, float, float] | None, against: str = "", listed: str = ""
) -> Any:
    return field(metadata={"sign": Sign(limits, against, listed)})


@dataclass(frozen=True, kw_only=True)
class Trust:
    """Whether a track can be trusted: a sentence, a grade, what speaks against it, and every sign; None is unknown.

    The limits are ours, from footage made from the truth and the demonstration video: docs/howto/trust.md has them.
    """

    sentence: str
    grade: Grade
    against: list[str]
    frames: int  # that show enough of the person
    height_m: float
    size_m: float | None
    size_ratio: float | None = _sign(
        (1.0, 0.08, 0.3),
        "the person seems to be {size_m:.2f} m tall, not {height_m:.2f} m",
        "size {size_m:.2f} m, the fitted body's {height_m:.2f} m",
    )
    depth_scatter: float | None = _sign(
        (0.0, 0.04, 0.2),
        "the distance jumps by {depth_scatter:.0%}",
        "distance steady to {depth_scatter:.1%}",
    )
    foot_share: float | None = _sign(
        (1.0, 0.8, 1.0),
        "a foot stands in {foot_share:.0%} of the frames only",
        "a foot stands in {foot_share:.0%} of frames",
    )
    stance_spread_m: float | None = _sign(
        (0.0, 0.15, 0.6),
        "feet stand at heights {stance_spread_m:.2f} m apart",
        "at heights {stance_spread_m:.2f} m apart",
    )
    explained: float | None = _sign(
        (1.0, 0.3, 0.6),
        "the body covers {explained:.0%} of what moves only",
        "the body covers {explained:.0%} of what moves",
    )
    interval_mm: float | None = _sign(
        None, listed="80% of joints expected within {interval_mm:.0f} mm"
    )
    training_mm: float | None = _sign(
        (0.0, 60.0, 200.0),
        "one camera leaves depth to the motions learned from, and the nearest are {training_mm:.0f} mm away",
        "{training_mm:.0f} mm from the motions learned from",
    )
    lost: float | None = _sign(
        (0.0, 0.15, 0.5),
        "the person is lost in {lost:.0%} of the frames",
        "lost {lost:.0%}",
    )
    unknown: float | None = _sign(
        (0.0, 0.2, 1.0),
        "left and right are unknown in {unknown:.0%} of the frames",
        "sides unknown {unknown:.0%}",
    )
    held: float = _sign(
        (0.0, 0.25, 0.6),
        "the person is mostly out of sight in {held:.0%} of the frames in between",
        "held {held:.0%}",
    )
    cropped: float | None = _sign(
        (0.0, 0.25, 0.6),
        "the picture's border cuts the mask above and below in {cropped:.0%} of the frames: masks cropped to the "
        "person do not show where they are",
    )
    frontal: float | None = _sign(
        (0.0, 0.5, 1.0),
        "one camera sees the front or the back in {frontal:.0%} of the frames, where steps and lean do not show",
    )
    iou: float = _sign(
        (1.0, 0.35, 0.55), "the body and the mask overlap by {iou:.0%} only"
    )
    acceleration: float | None = _sign(
        (0.0, 14.0, 60.0), "joints jerk, by {acceleration:.0f} m/s2"
    )
    unknown_signs: Mapping[str, str]  # why each is unknown

    def __str__(self) -> str:
        return self.sentence


SIGNS: dict[str, Sign] = {
    each.name: each.metadata["sign"]
    for each in fields(Trust)
    if "sign" in each.metadata
}


def signs_against(figures: Mapping[str, Any]) -> list[tuple[Grade, str]]:
    """Return what speaks against a track, the worst first, by figures named as `SIGNS`; None of them is not known."""
    few = f"only {counted(figures['frames'], 'frame')} to judge the person by"
    signs = [(1.0 - figures["frames"] / MIN_FRAMES, few)]
    for name, sign in SIGNS.items():
        if sign.limits is not None and figures[name] is not None:
            best, doubtful, useless = sign.limits
            severity = (abs(figures[name] - best) - doubtful) / (useless - doubtful)
            signs.append((severity, sign.against.format(**figures)))
    signs.sort(key=lambda severity_and_words: severity_and_words[0], reverse=True)
    return [
        ("useless" if severity > 1.0 else "doubtful", words)
        for severity, words in signs
        if severity > 0.0
    ]


def grade_of(signs: Sequence[tuple[Grade, str]]) -> Grade:
    """Return what signs come to: that of the worst, but three doubtful ones together are as bad as a useless one."""
    if not signs:
        return "good"
    return "useless" if len(signs) >= USELESS_TOGETHER else signs[0][0]


def sentence(figures: Mapping[str, Any], signs: Sequence[tuple[Grade, str]]) -> str:
    """Return whether a track can be trusted: the grade, and the worst sign or what speaks for it."""
    beginning = f"Trust: {_BEGINNING[grade_of(signs)]}"
    if not signs:
        return f"{beginning}No sign speaks against it: {_listed(figures)}."
    more = len(signs) - 1
    others = (
        ""
        if not more
        else f", and {more} more sign{'s speak' if more > 1 else ' speaks'} against it"
    )
    return f"{beginning}{signs[0][1]}{others}."


def trust_line(trust: Mapping[str, Any]) -> str:
    """Return the signs of a track in one line, each in words, also those that are unknown."""
    size_unknown = trust["unknown_signs"].get("size_ratio")
    return f"signs: {_listed(trust)}" + (
        f"; size unknown: {size_unknown}" if size_unknown else ""
    )


def _listed(figures: Mapping[str, Any]) -> str:
    known = (
        sign.listed.format(**figures)
        for name, sign in SIGNS.items()
        if figures[name] is not None
    )
    return ", ".join(filter(None, known))


def trust_of(
    scene: Scene,
    tracked: Sequence[Frame],
    frames: Sequence[Frame],
    table: Table,
    iou: float,
    training: Sequence[Motion],
) -> Trust:
    """Return whether a track can be trusted: the sentence, the grade, every figure, and why some are not known.

    `tracked` are the tracker's frames, and `frames` these in the end, smoothed; `iou` is their overlap with
    the masks, and `training` what the method learned from. Shares are of the frames that show enough of the person.
    """
    usable = table["usable"] == 1.0
    cut, cropped = np.array([_borders(each) for each in scene.observations]).T
    few = usable.sum() < MIN_FRAMES
    several = len(scene.cameras) > 1
    fps = scene.fps
    joints = scene.motion(frames).joints
    camera = scene.cameras[0]
    stands = standing(joints, fps) & usable[:, None]
    in_place = (
        few
        or np.ptp(joints[usable, 0][:, [0, 2]], axis=0).max() <= MAX_STATIONARY_METRES
    )
    depths = (
        np.array([frame.translation for frame in tracked]) @ camera.rotation[2]
        + camera.translation[2]
    )
    turns = np.array(
        [frame.pose[0] - facing(camera, frame.translation) for frame in frames]
    )
    lost, unknown, radii = (
        table[name][usable] for name in ("lost", "unknown_sides", "interval_mm")
    )
    # the figure of each of `SIGNS`, or a text: why it is unknown
    signs: dict[str, float | str] = {
        "size_ratio": _figure(
            {ONE_CAMERA: not several}, lambda: _size(scene, frames, usable), TOO_FEW
        ),
        "depth_scatter": _figure(
            {TOO_FEW: few}, lambda: depth_scatter(depths, usable, fps), TOO_FEW
        ),
        "foot_share": _figure(
            {TOO_FEW: few, IN_PLACE: in_place},
            lambda: float(stands.any(axis=1)[usable].mean()),
        ),
        "stance_spread_m": _figure(
            {TOO_FEW: few},
            lambda: stance_spread(joints, stands),
            "no foot stands twice",
        ),
        "explained": _figure(
            {MASKS_ALONE: scene.pictures is None, MOVES: scene.camera_moves},
            lambda: explained_share(scene, frames, usable),
            STILL,
        ),
        "interval_mm": _figure({}, lambda: mean_known(radii), NOT_REPORTED),
        "training_mm": _figure(
            {SEVERAL: several, TOO_FEW: few},
            lambda: _training_mm(scene, frames, usable, training),
            "no motion was learned from",
        ),
        "lost": _figure(
            {},
            lambda: mean_known(np.where(np.isnan(lost), lost, lost >= LOST)),
            NOT_REPORTED,
        ),
        "unknown": _figure({}, lambda: mean_known(unknown), NOT_REPORTED),
        "held": held_share(usable, cut),
        "cropped": _figure({TOO_FEW: few}, lambda: float(cropped[usable].mean())),
        "frontal": _figure(
            {SEVERAL: several},
            lambda: mean_known(1.0 * (np.abs(np.sin(turns)) < FRONTAL)[usable]),
            TOO_FEW,
        ),
        "iou": iou,
        "acceleration": _figure(
            {TOO_FEW: few},
            lambda: mean_known(acceleration(joints, fps)[usable]),
            TOO_FEW,
        ),
    }
    reasons = {name: value for name, value in signs.items() if isinstance(value, str)}
    figures: dict[str, Any] = {**signs, **dict.fromkeys(reasons)}
    ratio = figures["size_ratio"]
    stature = scene.body.stature
    figures |= {
        "frames": int(usable.sum()),
        "height_m": stature,
        "size_m": None if ratio is None else ratio * stature,
    }
    against = signs_against(figures)
    return Trust(
        sentence=sentence(figures, against),
        grade=grade_of(against),
        against=[words for _, words in against],
        unknown_signs=reasons,
        **figures,
    )


def _borders(observation: Observation) -> tuple[bool, bool]:
    """Return whether the picture's border cuts the person in some view, and whether above and below in all."""
    masks = [silhouette.mask for silhouette in observation.silhouettes]
    return any(map(touches_border, masks)), all(
        mask[0].any() and mask[-1].any() for mask in masks
    )


def _figure(
    reasons: Mapping[str, bool],
    compute: Callable[[], float | None],
    otherwise: str = "",
) -> float | str:
    """Return a figure, or why it is unknown: the first of the reasons that holds, or `otherwise` where it is None."""
    for reason, holds in reasons.items():
        if holds:
            return reason
    return otherwise if (value := compute()) is None else value


def _training_mm(
    scene: Scene,
    frames: Sequence[Frame],
    usable: NDArray[np.bool_],
    training: Sequence[Motion],
) -> float | None:
    """Return how far the poses of usable frames (T,) are from motions, millimetres, the mean."""
    poses = np.array([frame.pose for frame in frames])[usable]
    sampled = poses[:: max(1, len(poses) // SAMPLED_FRAMES)]
    return mean_known(1e3 * training_distances(scene.body.skeleton, sampled, training))


def _size(
    scene: Scene, frames: Sequence[Frame], usable: NDArray[np.bool_]
) -> float | None:
    """Return how large the person looks beside the body, the median over all cameras and frames over the footage."""
    shown = np.flatnonzero(usable).tolist()
    ratios = []
    for k in shown[:: max(1, len(shown) // SAMPLED_FRAMES)]:
        for camera, silhouette in zip(
            scene.cameras, scene.observations[k].silhouettes, strict=True
        ):
            observed = longer_side(silhouette.mask)
            fitted = longer_side(
                project(scene.body, camera, frames[k].pose, frames[k].translation)
            )
            ratios += [observed / fitted] if observed and fitted else []
    return float(np.median(ratios)) if ratios else None
