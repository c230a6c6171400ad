"""Videos with a known truth: recorded people, composed into real empty pictures.

composites.py imports this module; it prints nothing. A scene has the videos, the true
motions and masks, and cameras whose calibration is slightly wrong.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.footage.video import Video
from posefit.footage.writing import VideoWriter
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import BONES, JOINTS, MIRROR, PARENTS, kind
from posefit.motion import recorded
from posefit.motion.motion import Motion
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.silhouette.outlines import NEAR

# side of a weave in texels; it is one turn around a limb and `LENGTH` metres along it
TILE = 256
LENGTH = 0.6
ROUGH = (4, 12, 40, 128)  # waves along a weave's side, the coarse ones first
GARMENTS: Mapping[str, str] = {
    "hipjoint": "trousers",
    "femur": "trousers",
    "tibia": "trousers",
    "foot": "shoes",
    "toes": "shoes",
    "lowerneck": "skin",
    "upperneck": "skin",
    "head": "skin",
    "wrist": "skin",
    "hand": "skin",
    "radius": "skin",
}  # all others belong to the shirt
SKIN = ((140, 165, 205), (95, 120, 165), (60, 80, 115))  # blue, green, red
# None is the colour of the background
SHIRTS = ((60, 60, 170), (150, 90, 50), (215, 215, 220), None)
TROUSERS = ((110, 70, 40), None, (45, 45, 50), (95, 140, 165))
SHOES = ((40, 40, 45), (220, 220, 220))
# strength of a weave, as a share of the colour
STRENGTH = {"shirt": 0.22, "trousers": 0.14, "skin": 0.05, "shoes": 0.1}


@dataclass(frozen=True, eq=False)
class Outfit:
    """The colour of each bone (26, 3), a weave (TILE, TILE), and its strength (26,)."""

    colours: Array = field(repr=False)
    strengths: Array = field(repr=False)
    weave: NDArray[np.float32] = field(repr=False)


def outfit(number: int, behind: Image) -> Outfit:
    """Return clothes by their number.

    A garment without a colour has that of the middle of the picture behind it.
    """
    rng = np.random.default_rng([number, 3])
    height, width = behind.shape[:2]
    about = behind[height // 3 : 4 * height // 5, width // 4 : 3 * width // 4].reshape(
        -1, 3
    )
    near = np.median(about, axis=0) * rng.uniform(0.9, 1.1)
    colours = {
        "shirt": SHIRTS[number % len(SHIRTS)],
        "trousers": TROUSERS[number % len(TROUSERS)],
        "skin": SKIN[number % len(SKIN)],
        "shoes": SHOES[number % len(SHOES)],
    }
    worn = [GARMENTS.get(kind(bone), "shirt") for bone in BONES]
    each = [near if colours[garment] is None else colours[garment] for garment in worn]
    return Outfit(
        np.array(each, dtype=np.float64),
        np.array([STRENGTH[garment] for garment in worn]),
        _weave(rng),
    )


def _weave(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return a periodic pattern of mean 0 and standard deviation 1."""
    whole = np.zeros((TILE, TILE), dtype=np.float32)
    for waves in ROUGH:
        small = np.pad(
            rng.normal(size=(waves, waves)).astype(np.float32), 2, mode="wrap"
        )
        edge = round(2 * TILE / waves)
        large = cv2.resize(
            small, (TILE + 2 * edge, TILE + 2 * edge), interpolation=cv2.INTER_CUBIC
        )
        whole += large[edge : edge + TILE, edge : edge + TILE]
    return np.asarray((whole - whole.mean()) / whole.std())


FILMED = (1768, 994)  # pixels of the video
# an odd number of frames: a pixel is empty in most of them
EMPTY = (0, 8, 16, 24, 30, *range(216, 230))
# the first frames; their differences from the empty picture are its movements
LIVING = 31
PEOPLE = 25  # grey levels: a pixel that ever differs by more shows a person
SEEN = (1240, 697)  # pixels of the part that a camera sees
# left and top of each camera's part
CORNERS = ((260, 297), (0, 297), (120, 250), (330, 200))
FLICKER = 0.012  # slow change of the brightness; a third of it from frame to frame
NOISE = 2.0  # grey levels, of the sensor


@dataclass(frozen=True, eq=False)
class Plate:
    """The empty pictures of one camera."""

    still: NDArray[np.float32] = field(repr=False)  # (height, width, 3)
    # (frames, height, width, 3), movements that are added to it
    living: NDArray[np.int8] = field(repr=False)

    def frame(self, k: int) -> NDArray[np.float32]:
        """Return the picture of frame k, without flicker or noise.

        The movements run forwards and backwards.
        """
        last = len(self.living) - 1
        return np.asarray(self.still + self.living[last - abs(k % (2 * last) - last)])


def plate(video: str | Path, camera: int, size: tuple[int, int]) -> Plate:
    """Return the empty pictures of a camera by its number."""
    still, living = _empty(str(video))
    left, top = CORNERS[camera % len(CORNERS)]
    part = np.s_[top : top + SEEN[1], left : left + SEEN[0]]

    def scaled(image: Any) -> Any:
        seen = cv2.resize(
            image[part].astype(np.float32), size, interpolation=cv2.INTER_AREA
        )
        return seen[:, ::-1] if camera % 2 else seen

    return Plate(
        scaled(still), np.stack([scaled(one).astype(np.int8) for one in living])
    )


def sensed(image: NDArray[np.float32], k: int, rng: np.random.Generator) -> Image:
    """Return the sensor's picture of frame k."""
    gain = 1.0 + FLICKER * (np.sin(0.21 * k) + rng.normal() / 3.0)
    noise = NOISE * rng.standard_normal(image.shape, dtype=np.float32)
    return np.asarray(np.clip(gain * image + noise, 0.0, 255.0).astype(np.uint8))


def check_video(path: str) -> Video:
    """Return the video of empty pictures. Raises ValueError if it is another one."""
    video = Video.of(path)
    frames = max(EMPTY) + 1
    count = video.count() if video.size == FILMED else 0
    if count != frames:
        wanted, came = (f"{width}x{height}" for width, height in (FILMED, video.size))
        wanted = f"{wanted} pixels and {frames} frames"
        came = f"{came} and {count} frames" if count else f"{came}"
        raise InputError(
            f"{path}: expected the demonstration video of Sports2D, {wanted}, "
            f"got {came}"
        )
    return video


@lru_cache(maxsize=1)
def _empty(path: str) -> tuple[NDArray[np.float32], list[NDArray[np.int8]]]:
    """Return the empty picture, and the movements of the first frames in it.

    Movements are zero where a person is.
    """
    video = check_video(path)
    frames = {
        k: image for k, image in enumerate(video.frames()) if k in EMPTY or k < LIVING
    }
    half = len(EMPTY) // 2  # an odd number of frames: the median is one of them
    still = np.partition([frames[k] for k in EMPTY], half, axis=0)[half].astype(
        np.float32
    )
    most = np.zeros(still.shape[:2], dtype=np.float32)
    away = []
    for k in range(LIVING):
        differs = frames[k].astype(np.float32) - still
        most = np.maximum(
            most, cv2.GaussianBlur(np.abs(differs).max(axis=2), (0, 0), 4.0)
        )
        # a quarter of the memory
        away.append(np.clip(differs, -128.0, 127.0).astype(np.int8))
    somebody = (
        cv2.dilate((most > PEOPLE).astype(np.uint8), np.ones((41, 41), dtype=np.uint8))
        > 0
    )
    for one in away:
        one[somebody] = 0
    return still, away


FINER = 2  # a body is painted with this many pixels along a pixel's side
LIGHT = np.array([0.45, -0.75, 0.48])  # direction of the light in the world
AMBIENT = 0.55  # share of the light that comes from everywhere
SHADE = 0.4  # share of the light that a cast shadow removes
SOFT = 3.0  # pixels: the spread of a shadow's edge
# a painted cone's radius in units of the true one, so that every pixel of its mask has
# a colour
OVER = 1.06
_PARENTS = np.array(PARENTS[1:])
_HIPS = JOINTS.index("lhipjoint"), JOINTS.index("rhipjoint")
_SPINE = JOINTS.index("root"), JOINTS.index("thorax")
# feet and toes, which point forwards
_FORWARD = np.array([kind(bone) in ("foot", "toes") for bone in BONES])


class Posed(NamedTuple):
    """A person in one frame."""

    body: Body
    pose: Array  # (66,)
    place: Array  # (3,)
    outfit: Outfit


def composited(
    picture: NDArray[np.float32], camera: Camera, people: Sequence[Posed]
) -> NDArray[np.float32]:
    image = picture * _shadow(camera, people)[..., None]
    width = FINER * camera.width
    height = FINER * camera.height
    fine = replace(
        camera,
        width=width,
        height=height,
        focal=FINER * camera.focal,
        centre=FINER * camera.centre,
    )
    mask = np.zeros((fine.height, fine.width), dtype=bool)
    for one in people:
        mask |= project(one.body, fine, one.pose, one.place)
    box = _box(mask)
    if box is None:
        return np.asarray(image, dtype=np.float32)
    colours = _painted(fine, box, people)
    part = mask[box]
    colours[~part] = 0.0
    small = part.shape[1] // FINER, part.shape[0] // FINER
    share = cv2.resize(part.astype(np.float32), small, interpolation=cv2.INTER_AREA)[
        ..., None
    ]
    seen = cv2.resize(colours, small, interpolation=cv2.INTER_AREA)
    rows, columns = (slice(one.start // FINER, one.stop // FINER) for one in box)
    image[rows, columns] = (1.0 - share) * image[rows, columns] + seen
    return np.asarray(image, dtype=np.float32)


def true_masks(camera: Camera, people: Sequence[Posed]) -> list[Mask]:
    """Return the visible mask of each person: nearer roots hide farther ones."""
    whole = [project(one.body, camera, one.pose, one.place) for one in people]
    depths = [camera.project(one.place)[1] for one in people]
    seen = []
    for k, mask in enumerate(whole):
        hidden = [
            other
            for other, depth in zip(whole, depths, strict=True)
            if depth < depths[k]
        ]
        seen.append(mask & ~np.any(hidden, axis=0) if hidden else mask)
    return seen


def _box(mask: Mask) -> Any:
    """Return the bounding box of a fine mask in coarse pixels, or None if empty."""
    rows = np.flatnonzero(mask.any(axis=1))
    columns = np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    return tuple(
        slice(FINER * (one[0] // FINER), FINER * (one[-1] // FINER + 1))
        for one in (rows, columns)
    )


def _painted(camera: Camera, box: Any, people: Sequence[Posed]) -> NDArray[np.float32]:
    """Return the colours (height, width, 3) of the nearest surfaces in a box."""
    shape = box[0].stop - box[0].start, box[1].stop - box[1].start
    colours = np.zeros((*shape, 3), dtype=np.float32)
    nearest = np.full(shape, np.inf, dtype=np.float32)
    for one in people:
        for part, depths, painted in _cones(camera, box, one):
            nearer = depths < nearest[part]
            nearest[part][nearer] = depths[nearer]
            colours[part][nearer] = painted[nearer]
    return colours


def _cones(camera: Camera, box: Any, one: Posed) -> Iterator[tuple[Any, Array, Array]]:
    """Yield each bone's part of the box, with depths and colours there.

    Depths are infinite where the bone is not.
    """
    joints = one.body.skeleton.joints(one.pose, one.place)
    pixels, depths = camera.project(joints)
    scale = np.sqrt(camera.focal.prod()) / depths
    across = joints[_HIPS[0]] - joints[_HIPS[1]]
    ahead = np.cross(across, joints[_SPINE[1]] - joints[_SPINE[0]])
    for bone in range(len(BONES)):
        ends = [int(_PARENTS[bone]), bone + 1]
        if depths[ends].min() <= NEAR:
            continue
        radii = OVER * one.body.radii[bone] * scale[ends] + 1.0
        low = np.maximum(
            (pixels[ends] - radii[:, None]).min(axis=0) - [box[1].start, box[0].start],
            0.0,
        )
        high = (
            (pixels[ends] + radii[:, None]).max(axis=0)
            - [box[1].start, box[0].start]
            + 1.0
        )
        left, top = low.astype(int)
        right, bottom = np.minimum(
            high, [box[1].stop - box[1].start, box[0].stop - box[0].start]
        ).astype(int)
        if left >= right or top >= bottom:
            continue
        y, x = np.mgrid[top:bottom, left:right] + 0.5
        way = pixels[ends[1]] - pixels[ends[0]]
        off_x = x + box[1].start - pixels[ends[0], 0]
        off_y = y + box[0].start - pixels[ends[0], 1]
        along = np.clip(
            (off_x * way[0] + off_y * way[1]) / max(way @ way, 1e-9), 0.0, 1.0
        )
        off_x = off_x - along * way[0]
        off_y = off_y - along * way[1]
        radius = radii[0] + along * (radii[1] - radii[0])
        aside = np.hypot(off_x, off_y) / radius
        bulge = np.sqrt(np.clip(1.0 - aside**2, 0.0, 1.0))
        normals = (
            np.stack([off_x / radius, off_y / radius, -bulge], axis=-1)
            @ camera.rotation
        )
        depth = depths[ends[0]] + along * (depths[ends[1]] - depths[ends[0]])
        depth = np.where(
            aside <= 1.0, depth - bulge * radius / scale[ends].mean(), np.inf
        )
        axis = joints[ends[1]] - joints[ends[0]]
        reference = across if _FORWARD[bone] else ahead
        colour = _lit(one.outfit, bone, normals, along, axis, reference)
        yield np.s_[top:bottom, left:right], depth.astype(np.float32), colour


def _lit(
    outfit: Outfit,
    bone: int,
    normals: Array,
    along: Array,
    axis: Array,
    reference: Array,
) -> Array:
    """Return the colours of a bone's surface.

    The weave goes around the axis, from a direction that turns with the bone.
    """
    long = float(np.linalg.norm(axis))
    axis = axis / max(long, 1e-9)
    first = reference - (reference @ axis) * axis
    first /= max(float(np.linalg.norm(first)), 1e-9)
    around = np.arctan2(normals @ np.cross(axis, first), normals @ first) / (
        2.0 * np.pi
    )
    column = (around * TILE).astype(int) % TILE
    row = ((37 * bone) + along * long / LENGTH * TILE).astype(int) % TILE
    woven = 1.0 + outfit.strengths[bone] * outfit.weave[row, column]
    towards = -LIGHT / np.linalg.norm(LIGHT)
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ towards, 0.0, 1.0) * 1.6
    return np.asarray(
        (woven * light)[..., None] * outfit.colours[bone], dtype=np.float32
    )


def _shadow(camera: Camera, people: Sequence[Posed]) -> NDArray[np.float32]:
    """Return the share of light at each pixel of the ground y = 0, under shadows."""
    dark = np.zeros((camera.height, camera.width), dtype=np.uint8)
    for one in people:
        joints = one.body.skeleton.joints(one.pose, one.place)
        ground = joints - joints[:, 1:2] / LIGHT[1] * LIGHT
        pixels, depths = camera.project(ground)
        for bone in range(len(BONES)):
            ends = [int(_PARENTS[bone]), bone + 1]
            if depths[ends].min() <= 1.0:
                continue
            thick = 2.0 * float(
                one.body.radii[bone].mean() * camera.focal[0] / depths[ends].mean()
            )
            points = np.clip(16.0 * pixels[ends], -1e6, 1e6).astype(int)
            # the ground is seen at a grazing angle, which also flattens thickness on it
            cv2.line(
                dark,
                points[0].tolist(),
                points[1].tolist(),
                255,
                max(1, round(0.4 * thick)),
                cv2.LINE_AA,
                4,
            )
    soft = cv2.GaussianBlur(dark, (0, 0), SOFT)
    return np.asarray(1.0 - SHADE * soft.astype(np.float32) / 255.0)


CYCLE = (20, 50)  # frames that a walking cycle may last
ALONG = 0.5 * np.pi  # direction of +x about the vertical, where 0 is +z


@dataclass(frozen=True, eq=False)
class Actor:
    """A person in a scene: body, motion, presence and clothes."""

    body: Body
    # of the whole scene; meaningless where the person is absent
    motion: Motion = field(repr=False)
    present: NDArray[np.bool_] = field(repr=False)  # (T,)
    outfit: int


def frames_of(name: str, start: int = 0, stop: int | None = None) -> Motion:
    motion = recorded.clip(name).motion()
    return motion.frames(start, len(motion) if stop is None else min(stop, len(motion)))


def walked_on(motion: Motion, metres: float) -> Motion:
    """Return a walk over some metres: one cycle of a clip, repeated.

    The difference between the cycle's last and first pose is spread over the cycle, so
    that nothing jumps.
    """
    start, stop = cycle(motion)
    count = stop - start
    poses = motion.poses[start : stop + 1].copy()
    places = motion.translations[start : stop + 1].copy()
    share = np.arange(count + 1)[:, None] / count
    poses -= share * np.concatenate(
        [wrapped(poses[-1, :3] - poses[0, :3]), poses[-1, 3:] - poses[0, 3:]]
    )
    places[:, 1] -= share[:, 0] * (places[-1, 1] - places[0, 1])
    step = places[-1] - places[0]
    times = int(np.ceil(metres / np.linalg.norm(step)))
    far = np.concatenate([places[:-1] + k * step for k in range(times)])
    kept = int(np.searchsorted(np.linalg.norm(far - far[0], axis=1), metres))
    return Motion(
        motion.name,
        motion.skeleton,
        np.tile(poses[:-1], (times, 1))[:kept],
        far[:kept],
        motion.fps,
    )


def cycle(motion: Motion) -> tuple[int, int]:
    """Return the first frame of a clip's best cycle, and the frame after it.

    The frame after it is the most similar to the first.
    """
    joints = motion.skeleton.joints(motion.poses)
    feature = np.concatenate([joints[:-1], 5.0 * np.diff(joints, axis=0)], axis=1)
    best = (np.inf, 0, 0)
    for length in range(*CYCLE):
        away = np.linalg.norm(feature[length:] - feature[:-length], axis=2).mean(axis=1)
        if len(away):
            k = int(away.argmin())
            best = min(best, (float(away[k]), k, k + length))
    return best[1], best[2]


def facing_elsewhere(motion: Motion, angle: float) -> Motion:
    poses = motion.poses.copy()
    x, y, z = motion.translations.T
    poses[:, 0] += angle
    sine = np.sin(angle)
    cosine = np.cos(angle)
    places = np.column_stack([cosine * x + sine * z, y, cosine * z - sine * x])
    return Motion(motion.name, motion.skeleton, poses, places, motion.fps)


def on_ground(motion: Motion, body: Body) -> Motion:
    """Return a motion whose lowest point touches the ground."""
    joints = motion.skeleton.joints(motion.poses, motion.translations)
    low = float((joints[..., 1] - body.joint_radii()).min(axis=1).min())
    return moved(motion, np.array([0.0, -low, 0.0]))


def moved(motion: Motion, by: Array) -> Motion:
    return Motion(
        motion.name, motion.skeleton, motion.poses, motion.translations + by, motion.fps
    )


def heading(motion: Motion) -> float:
    """Return the overall direction of a motion about the vertical."""
    way = motion.translations[-1] - motion.translations[0]
    return float(np.arctan2(way[0], way[2]))


def middle_of(motion: Motion) -> Array:
    """Return the middle of the ground that a motion covers, a point (3,) with y = 0."""
    low = motion.translations.min(axis=0)
    high = motion.translations.max(axis=0)
    return np.asarray(0.5 * (low + high) * [1.0, 0.0, 1.0])


def longest(motion: Motion) -> float:
    """Return the direction in which a motion extends farthest, about the vertical."""
    flat = motion.translations[:, [0, 2]]
    _, _, axes = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)
    return float(np.arctan2(axes[0, 0], axes[0, 1]))


def through(
    motion: Motion, body: Body, reach: float, *, back: bool = False, aside: float = 0.0
) -> Motion:
    """Return a walk from x = -reach to x = reach, or back, `aside` metres towards z."""
    long = walked_on(motion, 2.0 * reach)
    ahead = on_ground(
        facing_elsewhere(long, (-ALONG if back else ALONG) - heading(long)), body
    )
    return moved(ahead, [0.0, 0.0, aside] - middle_of(ahead))


def one_after_other(parts: Sequence[Motion | int]) -> tuple[Motion, NDArray[np.bool_]]:
    """Return motions one after the other, and the frames in which a person is present.

    A number stands for frames without a person.
    """
    first = next(part for part in parts if isinstance(part, Motion))
    poses = []
    places = []
    present = []
    for part in parts:
        if isinstance(part, Motion):
            poses.append(part.poses)
            places.append(part.translations)
            present += [True] * len(part)
        else:
            poses.append(
                np.repeat(poses[-1][-1:] if poses else first.poses[:1], part, axis=0)
            )
            places.append(
                np.repeat(
                    places[-1][-1:] if places else first.translations[:1], part, axis=0
                )
            )
            present += [False] * part
    motion = Motion(
        first.name,
        first.skeleton,
        np.concatenate(poses),
        np.concatenate(places),
        first.fps,
    )
    return motion, np.array(present)


SIZE = (640, 360)  # pixels of a frame
# metres of a camera from the middle, and above the ground
DISTANCE = 8.0
HEIGHT = 0.95
ACROSS = np.radians(36.0)  # field of view
# degrees of the cameras, by their number
PLACES: Mapping[int, Sequence[float]] = {
    1: (0.0,),
    2: (-30.0, 30.0),
    4: (-30.0, 30.0, 150.0, 210.0),
}
REACH = {1: 3.4, 2: 5.2, 4: 5.2}  # metres to either side, out of view
# frames without a person: before and after, and until a person comes back
BARE = 10
AWAY = 20
FARTHER = 1.5  # extra metres to either side for each metre aside
NEARER = 0.7  # metres from the middle, of each of two who pass
# the bone on the other side, for each bone
MIRRORED = [joint - 1 for joint in MIRROR[1:]]
# largest difference of a part's girth from the library's, in percent
GIRTH = 10.0
LONGEST = 240  # frames of a person who is always present

# Clips of people who walk through, with at least one cycle; and clips with first and
# last frame of people who are always present. Each seed takes others.
WALKS = ("16_47", "02_01", "49_01")
STAYING: Mapping[str, Sequence[tuple[str, int, int]]] = {
    "stands": (("49_15", 0, 150), ("14_04", 0, 150), ("29_02", 100, 250)),
    "waves": (("29_05", 60, 240), ("14_05", 40, 212), ("02_06", 0, 180)),
    "to and fro": (
        ("29_01", 0, LONGEST),
        ("09_12", 0, LONGEST),
        ("09_12", 200, 200 + LONGEST),
    ),
    "squats": (("02_06", 180, 400), ("14_06", 0, 130), ("14_20", 0, 120)),
}
TREADMILL = 4.0  # metres to either side, walked on the spot


@dataclass(frozen=True, eq=False)
class Situation:
    """Actors and cameras. The first actor is tracked."""

    actors: Sequence[Actor]
    cameras: Sequence[Camera] = field(repr=False)

    def __len__(self) -> int:
        return len(self.actors[0].motion)

    @property
    def people(self) -> Sequence[str]:
        """The actors' subjects in the library."""
        return sorted({actor.motion.name.partition("_")[0] for actor in self.actors})


SHOWS = {
    "through": "a person walks through",
    "again": "the same, who comes again the same way",
    "back": "the same, who comes back the other way",
    "two": "two people who pass each other",
    "to and fro": "a person who is always there and walks to and fro",
    "stands": "a person who is always there and stands",
    "waves": "a person who is always there and moves on the spot",
    "squats": "a person who is always there and bends their knees",
    "treadmill": "a person who is always there and walks on the spot",
    "towards": "the same, seen from the front",
}


def situation(name: str, views: int, seed: int) -> Situation:
    rng = np.random.default_rng([seed, views])
    # degrees; a side view is never exact
    turned = rng.uniform(-8.0, 8.0) + 90.0 * (name == "towards")
    target = np.array([0.0, HEIGHT, 0.0])
    cameras = [
        Camera.around(target, np.radians(degrees + turned), DISTANCE, SIZE, ACROSS)
        for degrees in PLACES[views]
    ]
    return Situation(_actors(name, views, seed), cameras)


def _actors(name: str, views: int, seed: int) -> Sequence[Actor]:
    walk = WALKS[seed % len(WALKS)]
    if name in STAYING:
        return [
            _staying(
                STAYING[name][seed % len(STAYING[name])],
                seed,
                along=name == "to and fro",
            )
        ]
    if name in ("treadmill", "towards"):
        return [_on_treadmill(walk, seed)]
    if name == "through":
        return [_walker(walk, views, seed)]
    if name == "two":
        near = _walker(walk, views, seed, aside=NEARER)
        far = _walker(
            WALKS[(seed + 1) % len(WALKS)], views, seed + 1, back=True, aside=-NEARER
        )
        count = max(len(near.motion), len(far.motion))
        return [_lasting(actor, count) for actor in (near, far)]
    return [_returning(walk, views, seed, back=name == "back")]


def _dressed(motion: Motion, seed: int) -> tuple[Motion, Body]:
    """Return a motion, and its body with random girths, symmetric left and right."""
    body = Body.of(motion.skeleton)
    shares = (
        1.0
        + np.random.default_rng([seed, 1]).uniform(-GIRTH, GIRTH, len(body.radii))
        / 100.0
    )
    return motion, body.scaled(1.0, 0.5 * (shares + shares[MIRRORED]))


def _walker(
    name: str, views: int, seed: int, *, back: bool = False, aside: float = 0.0
) -> Actor:
    motion, body = _dressed(frames_of(name), seed)
    walk = through(
        motion, body, REACH[views] + FARTHER * abs(aside), back=back, aside=aside
    )
    whole, present = one_after_other([BARE, walk, BARE])
    return Actor(body, whole, present, seed)


def _returning(name: str, views: int, seed: int, *, back: bool) -> Actor:
    motion, body = _dressed(frames_of(name), seed)
    first, second = (
        through(motion, body, REACH[views], back=way) for way in (False, back)
    )
    whole, present = one_after_other([BARE, first, AWAY, second, BARE])
    return Actor(body, whole, present, seed)


def _staying(frames: tuple[str, int, int], seed: int, *, along: bool) -> Actor:
    """Return a person who is always present.

    They walk along x, or roughly face the first camera.
    """
    motion, body = _dressed(frames_of(*frames), seed)
    if along:
        turn = ALONG - longest(motion)
    else:
        turn = np.random.default_rng([seed, 2]).uniform(-0.8, 0.8) - motion.poses[0, 0]
    there = on_ground(facing_elsewhere(motion, turn), body)
    there = moved(there, -middle_of(there))
    return Actor(body, there, np.ones(len(there), dtype=bool), seed)


def _on_treadmill(name: str, seed: int) -> Actor:
    motion, body = _dressed(frames_of(name), seed)
    walk = through(motion, body, TREADMILL)
    gone = np.linspace(walk.translations[0], walk.translations[-1], len(walk)) * [
        1.0,
        0.0,
        1.0,
    ]
    there = replace(walk, translations=walk.translations - gone)
    return Actor(body, there, np.ones(len(there), dtype=bool), seed)


def _lasting(actor: Actor, count: int) -> Actor:
    missing = count - len(actor.motion)
    if not missing:
        return actor
    whole, present = one_after_other([actor.motion, missing])
    present[: len(actor.present)] = actor.present
    return replace(actor, motion=whole, present=present)


def film(
    situation: Situation, plates: Sequence[Plate], seed: int, folder: Path
) -> tuple[list[Path], NDArray[np.bool_]]:
    """Return the videos written to a folder, and the visible part of each actor.

    There is a video for each camera. The visible parts are masks (actors, views, T,
    height, width). `plates` are the empty pictures of each camera.
    """
    rng = np.random.default_rng([seed, 4])
    videos = []
    masks = []
    fps = situation.actors[0].motion.fps
    for number, (camera, behind) in enumerate(
        zip(situation.cameras, plates, strict=True)
    ):
        path = folder / f"camera-{number + 1}.mp4"
        visible: list[list[Mask]] = []
        with VideoWriter(path, fps, (camera.width, camera.height)) as writer:
            for k, (people, each) in enumerate(_frames(situation, camera, behind)):
                writer.write(
                    sensed(composited(behind.frame(k), camera, people), k, rng)
                )
                visible.append(each)
        videos.append(path)
        masks.append(np.stack(visible, axis=1))
    return videos, np.stack(masks, axis=1)


def _frames(
    situation: Situation, camera: Camera, behind: Plate
) -> Iterator[tuple[list[Posed], list[Mask]]]:
    """Yield the people in each frame, and the visible part of each actor."""
    clothes = [
        outfit(actor.outfit, behind.still.astype(np.uint8))
        for actor in situation.actors
    ]
    for k in range(len(situation)):
        people = [
            Posed(actor.body, actor.motion.poses[k], actor.motion.translations[k], worn)
            for actor, worn in zip(situation.actors, clothes, strict=True)
            if actor.present[k]
        ]
        visible = iter(true_masks(camera, people))
        nothing = np.zeros((camera.height, camera.width), dtype=bool)
        yield (
            people,
            [
                next(visible) if actor.present[k] else nothing
                for actor in situation.actors
            ],
        )
