"""Signs of whether a track can be trusted if the truth is unknown, and their summary.

Besides the overlap with the masks they are size, depth, standing feet, motion in the
pictures, and others. Each sign has a limit from which the track is doubtful, and one
from which it is unusable. docs/howto/trust.md has the limits, and the footage from
which they come.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.evaluation.errors import Table, flagged_share, mean_known
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.quality import LAG_SECONDS, changed_pixels, moved_pixels
from posefit.footage.scene import Scene
from posefit.geometry.kernels import lower_to_nearest
from posefit.geometry.skeleton import JOINTS, Skeleton
from posefit.geometry.symmetry import facing, mirrored_poses
from posefit.motion.motion import Motion
from posefit.motion.steadiness import BALLS, acceleration, runs, standing
from posefit.reading import counted
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask, touches_border

# A smooth path is fitted to the frames within this time before and after a frame.
SMOOTH_SECONDS = 0.5
MIN_SMOOTH_FRAMES = 5  # of such a fit
SCATTER_QUANTILE = 0.9  # the share of frames that are nearer to that path
TRAINING_SECONDS = 1.0 / 15.0  # between the compared poses of a training motion
# Share of the person's longer side. Whatever moves this near to the body is clothes or
# hair.
CLOTHES = 0.05
MIN_MOVED = 0.02  # a share of the body's area; fewer pixels that moved are noise
UNUSABLE_TOGETHER = 3  # this many signs of a doubtful track make it unusable
MIN_FRAMES = 12  # the fewest frames to judge depth, feet and motion
SAMPLED_FRAMES = 60  # spread over the footage; their sizes and poses are compared
# A person within 20 degrees of the line of sight is seen from the front or the back.
FRONTAL = np.sin(np.radians(20.0))
# along each axis of the ground; within this, the person stays in one place
MAX_STATIONARY_METRES = 1.0

# reasons why a sign is unknown
ONE_CAMERA = "one camera cannot tell a small person from a distant one"
SEVERAL = "several cameras see the depth"
NOT_REPORTED = "the method does not report it"
MASKS_ALONE = "there are only masks"
STILL = "nothing moves enough"
MOVES = "the camera moves"
TOO_FEW = "too few frames show the person"
IN_PLACE = "the person stays in one place, as on a treadmill, whose belt moves the feet"


def longer_side(mask: Mask) -> int:
    """Return the longer side of a mask's bounding box in pixels.

    It is 0 if the mask is empty or cut by the picture's border.
    """
    if touches_border(mask):
        return 0
    return max(cv2.boundingRect(mask.astype(np.uint8))[2:])


def depth_scatter(depths: Array, usable: NDArray[np.bool_], fps: float) -> float | None:
    """Return how far depths are from a smooth path, as a share of the depth.

    Nine in ten usable frames are nearer to the path. It is the parabola fitted to the
    frames within half a second.

    Args:
        depths: The depth of each frame (T,) in metres.
        usable: Whether each frame is usable (T,).
        fps: Frames per second.

    Returns:
        The share, or None if there are too few frames.
    """
    known = np.flatnonzero(usable & (depths > 0.0))
    away = []
    for k in known:
        near = known[np.abs(known - k) <= SMOOTH_SECONDS * fps]
        if len(near) >= MIN_SMOOTH_FRAMES:
            path = np.polynomial.Polynomial.fit(near - k, depths[near], 2)
            away.append(abs(depths[k] - path(0.0)) / depths[k])
    if away:
        return float(np.quantile(away, SCATTER_QUANTILE))
    return None


def hidden_share(usable: NDArray[np.bool_], cut: NDArray[np.bool_]) -> float:
    """Return the share of unusable frames between the first and the last usable one.

    Frames before the person comes and after they have left do not count. Neither does a
    gap that begins or ends with a mask cut by the picture's border, because the person
    was then outside the picture.

    Args:
        usable: Whether each frame is usable (T,).
        cut: Whether the picture's border cuts the mask of each frame (T,).

    Returns:
        The share of the frames from the first to the last usable one, 1 if no frame is
        usable.
    """
    known = np.flatnonzero(usable)
    if not len(known):
        return 1.0
    hidden = 0
    for start, stop in runs(~usable):
        is_inner = known[0] < start < known[-1]
        if is_inner and not cut[[start - 1, start, stop - 1, stop]].any():
            hidden += stop - start
    return hidden / float(known[-1] + 1 - known[0])


def stance_spread(joints: Array, in_stance: NDArray[np.bool_]) -> float | None:
    """Return the spread of the heights at which feet touch the ground, in metres.

    It is the standard deviation over stances of the height of the foot's ball.

    Args:
        joints: The joints (T, 27, 3) in metres; y is up.
        in_stance: Whether each foot is on the ground (T, 2).

    Returns:
        The spread, or None if there are fewer than two stances.
    """
    heights = []
    for ball, flags in zip(BALLS, in_stance.T, strict=True):
        for start, stop in runs(flags):
            heights.append(joints[start:stop, ball, 1].mean())
    if len(heights) > 1:
        return float(np.std(heights))
    return None


def training_distances(
    skeleton: Skeleton, poses: Array, training: Sequence[Motion]
) -> Array:
    """Return the distance of poses from the nearest pose of some motions.

    All poses are turned to yaw 0, and mirror images count, too.

    Args:
        skeleton: The skeleton.
        poses: The poses (n, 66).
        training: The motions.

    Returns:
        The mean distance of the joints (n,) in metres, inf without motions.
    """
    both = np.concatenate([poses, mirrored_poses(skeleton, poses)])
    # a pose is as familiar in any direction
    both[:, 0] = 0.0
    joints = skeleton.joints(both)
    nearest = np.full(len(joints), np.inf)
    for motion in training:
        others = motion.poses[:: max(1, round(TRAINING_SECONDS * motion.fps))].copy()
        others[:, 0] = 0.0
        lower_to_nearest(joints, skeleton.joints(others), nearest)
    return np.asarray(nearest.reshape(2, -1).min(axis=0)) / len(JOINTS)


def explained_share(
    scene: Scene, frames: Sequence[Frame], usable: NDArray[np.bool_]
) -> float | None:
    """Return the share of moving pixels at and around the person that the body covers.

    The pixels of all usable frames of the first camera count together.

    Args:
        scene: The footage.
        frames: The tracked frames.
        usable: Whether each frame is usable (T,).

    Returns:
        The share, or None if there are no pictures or nothing moves.
    """
    if scene.pictures is None:
        return None
    camera = scene.cameras[0]
    reach = 0
    counts = np.zeros(2, dtype=np.int64)  # of covered pixels, and of all that moved
    # pictures are compared with one from `LAG_SECONDS` seconds before
    lag = max(1, round(LAG_SECONDS * scene.fps))
    before: deque[tuple[Image, Mask, Mask]] = deque(maxlen=lag)
    for is_usable, frame, observation, image in zip(
        usable, frames, scene.observations, scene.pictures(), strict=False
    ):
        body = project(scene.body, camera, frame.pose, frame.translation)
        observed = observation.silhouettes[0].mask
        reach = max(reach, longer_side(observed))
        # the body covers the place that it left, too, because that changes as well
        if before and is_usable:
            then, old_body, old_observed = before[0]
            counts += covered_pixels(
                image, then, body | old_body, observed | old_observed, reach
            )
        before.append((image, body, observed))
    if counts[1]:
        return float(counts[0] / counts[1])
    return None


def covered_pixels(
    image: Image, then: Image, body: Mask, observed: Mask, reach: float
) -> tuple[int, int]:
    """Return how many pixels moved between two pictures, at the body and in all.

    Only pixels near the body or the observed mask count.

    Args:
        image: A picture.
        then: An earlier picture.
        body: The mask of the body in both pictures together.
        observed: The observed mask in both pictures together.
        reach: The person's longer side in pixels. Pixels within half of it count.

    Returns:
        The number of pixels at the body, and of all. Both are 0 if only few moved.
    """
    region = body | observed
    if not region.any():
        return 0, 0
    changed = changed_pixels(image, then)
    moved, inside = moved_pixels(changed, region, body, reach, CLOTHES)
    # a few pixels of noise say nothing about the body
    if moved > MIN_MOVED * body.sum():
        return (inside, moved)
    return (0, 0)


Grade = Literal["good", "doubtful", "do not use"]
# how the sentence of each grade begins
_BEGINNING: dict[Grade, str] = {
    "good": "good. ",
    "doubtful": "doubtful: ",
    "do not use": "do not use: ",
}


@dataclass(frozen=True)
class Sign:
    """The limits and the texts of a sign.

    Texts are format strings with the names of all figures.

    Attributes:
        limits: The best value, and the distances from it at which a track is doubtful
            and unusable. None for a sign that never counts against a track.
        against: The text if the sign counts against a track.
        listed: The text in the list of all signs.
    """

    limits: tuple[float, float, float] | None
    against: str = ""
    listed: str = ""


def _sign(
    limits: tuple[float, float, float] | None, against: str = "", listed: str = ""
) -> Any:
    """Return the field of a sign."""
    return field(metadata={"sign": Sign(limits, against, listed)})


@dataclass(frozen=True, kw_only=True)
class Trust:
    """Whether a track can be trusted. Each other attribute is a sign, None if unknown.

    The limits are ours. They come from footage that was made from a known truth, and
    from the demonstration video; docs/howto/trust.md has them.

    Attributes:
        sentence: The grade, and the worst sign.
        grade: "good", "doubtful" or "do not use".
        against: What counts against the track, the worst first.
        frames: The number of frames that show enough of the person.
        height_m: The height of the fitted body.
        size_m: The height of the person as seen by several cameras.
        unknown_signs: The reason why each unknown sign is unknown.
    """

    sentence: str
    grade: Grade
    against: list[str]
    frames: int
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
        "a foot is on the ground in only {foot_share:.0%} of the frames",
        "a foot is on the ground in {foot_share:.0%} of frames",
    )
    stance_spread_m: float | None = _sign(
        (0.0, 0.15, 0.6),
        "feet touch the ground at heights {stance_spread_m:.2f} m apart",
        "at heights {stance_spread_m:.2f} m apart",
    )
    explained: float | None = _sign(
        (1.0, 0.3, 0.6),
        "the body covers only {explained:.0%} of what moves",
        "the body covers {explained:.0%} of what moves",
    )
    interval_mm: float | None = _sign(
        None, listed="80% of joints expected within {interval_mm:.0f} mm"
    )
    training_mm: float | None = _sign(
        (0.0, 60.0, 200.0),
        "with one camera, depth follows the training motions, and the nearest is "
        "{training_mm:.0f} mm away",
        "{training_mm:.0f} mm from the training motions",
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
    hidden: float = _sign(
        (0.0, 0.25, 0.6),
        "the person is mostly hidden in {hidden:.0%} of the frames between the first "
        "and the last that show them",
        "hidden {hidden:.0%}",
    )
    cropped: float | None = _sign(
        (0.0, 0.25, 0.6),
        "the picture's border cuts the mask above and below in {cropped:.0%} of the "
        "frames: masks cropped to the person do not show where they are",
    )
    frontal: float | None = _sign(
        (0.0, 0.5, 1.0),
        "one camera sees the front or the back in {frontal:.0%} of the frames, where "
        "steps and lean do not show",
    )
    iou: float = _sign(
        (1.0, 0.35, 0.55), "the body and the mask overlap by only {iou:.0%}"
    )
    acceleration: float | None = _sign(
        (0.0, 14.0, 60.0), "joints move jerkily, at {acceleration:.0f} m/s2"
    )
    unknown_signs: Mapping[str, str]

    def __str__(self) -> str:
        return self.sentence


SIGNS = dict[str, Sign]()
for _field in fields(Trust):
    if "sign" in _field.metadata:
        SIGNS[_field.name] = _field.metadata["sign"]


def signs_against(figures: Mapping[str, Any]) -> list[tuple[Grade, str]]:
    """Return what counts against a track.

    Args:
        figures: The figures of a `Trust` by name, None if unknown.

    Returns:
        The grade and the text of each sign against the track, the worst first.
    """
    few = f"only {counted(figures['frames'], 'frame')} to judge the person by"
    # a severity above 0 is doubtful, and above 1 unusable
    signs = [(1.0 - figures["frames"] / MIN_FRAMES, few)]
    for name, sign in SIGNS.items():
        if sign.limits is not None and figures[name] is not None:
            best, doubtful, unusable = sign.limits
            severity = (abs(figures[name] - best) - doubtful) / (unusable - doubtful)
            signs.append((severity, sign.against.format(**figures)))
    signs.sort(key=lambda severity_and_words: severity_and_words[0], reverse=True)
    against: list[tuple[Grade, str]] = []
    for severity, words in signs:
        if severity > 0.0:
            against.append(("do not use" if severity > 1.0 else "doubtful", words))
    return against


def grade_of(signs: Sequence[tuple[Grade, str]]) -> Grade:
    """Return the grade of a track from the signs against it, the worst first.

    It is the grade of the worst sign, but three signs together make a track unusable.
    """
    if not signs:
        return "good"
    if len(signs) >= UNUSABLE_TOGETHER:
        return "do not use"
    return signs[0][0]


def sentence(figures: Mapping[str, Any], signs: Sequence[tuple[Grade, str]]) -> str:
    """Return a sentence with the grade and the worst sign, or with the good signs.

    Args:
        figures: The figures of a `Trust` by name, None if unknown.
        signs: The signs against the track, as `signs_against` returns them.

    Returns:
        The sentence.
    """
    beginning = f"Trust: {_BEGINNING[grade_of(signs)]}"
    if not signs:
        return f"{beginning}No sign counts against it: {_listed(figures)}."
    others = ""
    more = len(signs) - 1
    if more == 1:
        others = ", and 1 more sign counts against it"
    elif more:
        others = f", and {more} more signs count against it"
    return f"{beginning}{signs[0][1]}{others}."


def trust_line(trust: Mapping[str, Any]) -> str:
    """Return all known signs of a track in one line, and why its size is unknown.

    Args:
        trust: The attributes of a `Trust` by name.

    Returns:
        The line.
    """
    line = f"signs: {_listed(trust)}"
    size_unknown = trust["unknown_signs"].get("size_ratio")
    if size_unknown:
        line += f"; size unknown: {size_unknown}"
    return line


def _listed(figures: Mapping[str, Any]) -> str:
    """Return the texts of the known signs."""
    texts = []
    for name, sign in SIGNS.items():
        if figures[name] is not None and sign.listed:
            texts.append(sign.listed.format(**figures))
    return ", ".join(texts)


def trust_of(
    scene: Scene,
    tracked: Sequence[Frame],
    frames: Sequence[Frame],
    table: Table,
    iou: float,
    training: Sequence[Motion],
) -> Trust:
    """Return whether a track can be trusted.

    Shares are of the frames that show enough of the person.

    Args:
        scene: The footage.
        tracked: The frames of the tracker.
        frames: The final frames, smoothed.
        table: The columns of frames.csv.
        iou: The overlap of the final frames with the masks.
        training: The motions that the method learned from.

    Returns:
        The grade, its sentence, all signs, and why some signs are unknown.
    """
    usable = table["usable"] == 1.0
    borders = [_borders(observation) for observation in scene.observations]
    cut, cropped = np.array(borders).T
    few = usable.sum() < MIN_FRAMES
    several = len(scene.cameras) > 1
    fps = scene.fps
    joints = scene.motion(frames).joints
    camera = scene.cameras[0]
    in_stance = standing(joints, fps) & usable[:, None]
    in_place = few
    if not few:
        ground = joints[usable, 0][:, [0, 2]]  # (n, 2), the root's path
        in_place = np.ptp(ground, axis=0).max() <= MAX_STATIONARY_METRES
    # smoothing would hide how much depths jump, so use the tracker's frames
    places = np.array([frame.translation for frame in tracked])  # (T, 3)
    depths = places @ camera.rotation[2] + camera.translation[2]
    # how far the person is turned away from the camera, in radians
    turns = np.empty(len(frames))
    for k, frame in enumerate(frames):
        turns[k] = frame.pose[0] - facing(camera, frame.translation)
    radii = table["interval_mm"][usable]
    # each of `SIGNS`, as its figure or as the reason why it is unknown
    signs: dict[str, float | str] = {
        "size_ratio": _figure(
            {ONE_CAMERA: not several}, lambda: _size(scene, frames, usable), TOO_FEW
        ),
        "depth_scatter": _figure(
            {TOO_FEW: few}, lambda: depth_scatter(depths, usable, fps), TOO_FEW
        ),
        "foot_share": _figure(
            {TOO_FEW: few, IN_PLACE: in_place},
            lambda: float(in_stance.any(axis=1)[usable].mean()),
        ),
        "stance_spread_m": _figure(
            {TOO_FEW: few},
            lambda: stance_spread(joints, in_stance),
            "no foot touches the ground twice",
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
            "the method learned from no motion",
        ),
        "lost": _figure({}, lambda: flagged_share(table, "lost"), NOT_REPORTED),
        "unknown": _figure(
            {}, lambda: flagged_share(table, "unknown_sides"), NOT_REPORTED
        ),
        "hidden": hidden_share(usable, cut),
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
    reasons = dict[str, str]()
    figures = dict[str, Any]()
    for name, value in signs.items():
        if isinstance(value, str):
            reasons[name] = value
            figures[name] = None
        else:
            figures[name] = value
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
    """Return whether the picture's border cuts the person.

    The first value is whether it does in any view, the second whether it does above and
    below in all views.
    """
    masks = [silhouette.mask for silhouette in observation.silhouettes]
    cut = any(map(touches_border, masks))
    cropped = all(mask[0].any() and mask[-1].any() for mask in masks)
    return cut, cropped


def _figure(
    reasons: Mapping[str, bool],
    compute: Callable[[], float | None],
    otherwise: str = "",
) -> float | str:
    """Return a figure, or the reason why it is unknown.

    Args:
        reasons: Whether each reason holds. The first that does is returned.
        compute: Computes the figure if none of them holds.
        otherwise: The reason if the result is None.
    """
    for reason, holds in reasons.items():
        if holds:
            return reason
    value = compute()
    return otherwise if value is None else value


def _training_mm(
    scene: Scene,
    frames: Sequence[Frame],
    usable: NDArray[np.bool_],
    training: Sequence[Motion],
) -> float | None:
    """Return the mean distance of usable frames' poses from motions in millimetres."""
    poses = np.array([frame.pose for frame in frames])[usable]
    sampled = poses[:: max(1, len(poses) // SAMPLED_FRAMES)]
    return mean_known(1e3 * training_distances(scene.body.skeleton, sampled, training))


def _size(
    scene: Scene, frames: Sequence[Frame], usable: NDArray[np.bool_]
) -> float | None:
    """Return the size of the person's masks divided by the fitted body's.

    It is the median over all cameras and sampled frames, or None if no mask is whole.
    """
    shown = np.flatnonzero(usable).tolist()
    ratios = []
    for k in shown[:: max(1, len(shown) // SAMPLED_FRAMES)]:
        frame = frames[k]
        silhouettes = scene.observations[k].silhouettes
        for camera, silhouette in zip(scene.cameras, silhouettes, strict=True):
            observed = longer_side(silhouette.mask)
            body = project(scene.body, camera, frame.pose, frame.translation)
            fitted = longer_side(body)
            # a mask that the picture cuts has no size
            if observed and fitted:
                ratios.append(observed / fitted)
    if ratios:
        return float(np.median(ratios))
    return None
