"""Bodies in a picture as a camera would see them: cones with clothes, light from one side, a soft shadow, soft edges.

Colours are painted at twice the size, nearest surface first, and scaled down with the edges. The edges are those of the
rasteriser, so that a mask of the picture is the mask that a pose is compared with.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from composites.clothes import LENGTH, TILE, Outfit
from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS, kind
from posefit.silhouette.cost import project
from posefit.silhouette.mask import Mask
from posefit.silhouette.rasteriser import NEAR

FINER = 2  # pixels to a side of a pixel, in which bodies are painted
LIGHT = np.array([0.45, -0.75, 0.48])  # the way the light goes, in the world
AMBIENT = 0.55  # share of the light that comes from everywhere
SHADE = 0.4  # share of the light that a cast shadow takes
SOFT = 3.0  # pixels: the spread of a shadow's edge
OVER = 1.06  # by how much more than its radius a cone is painted, so that no pixel of its mask is without colour
_PARENTS = np.array(PARENTS[1:])
_HIPS = JOINTS.index("lhipjoint"), JOINTS.index("rhipjoint")
_SPINE = JOINTS.index("root"), JOINTS.index("thorax")
_FORWARD = np.array([kind(bone) in ("foot", "toes") for bone in BONES])  # these go forward themselves


class Posed(NamedTuple):
    """Somebody in one frame."""

    body: Body
    pose: Array  # (66,)
    place: Array  # (3,)
    outfit: Outfit


def composited(picture: NDArray[np.float32], camera: Camera, people: Sequence[Posed]) -> NDArray[np.float32]:
    """Return a picture with people in it."""
    image = picture * _shadow(camera, people)[..., None]
    fine = finer(camera)
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
    share = cv2.resize(part.astype(np.float32), small, interpolation=cv2.INTER_AREA)[..., None]
    seen = cv2.resize(colours, small, interpolation=cv2.INTER_AREA)
    rows, columns = (slice(one.start // FINER, one.stop // FINER) for one in box)
    image[rows, columns] = (1.0 - share) * image[rows, columns] + seen
    return np.asarray(image, dtype=np.float32)


def true_masks(camera: Camera, people: Sequence[Posed]) -> list[Mask]:
    """Return what is seen of each person: those whose root is nearer hide the others."""
    whole = [project(one.body, camera, one.pose, one.place) for one in people]
    depths = [camera.project(one.place)[1] for one in people]
    seen = []
    for k, mask in enumerate(whole):
        hidden = [other for other, depth in zip(whole, depths, strict=True) if depth < depths[k]]
        seen.append(mask & ~np.any(hidden, axis=0) if hidden else mask)
    return seen


def finer(camera: Camera) -> Camera:
    """Return a camera with more pixels."""
    width, height = FINER * camera.width, FINER * camera.height
    return Camera(width, height, FINER * camera.focal, FINER * camera.centre, camera.rotation, camera.translation)


def _box(mask: Mask) -> Any:
    """Return the part of a fine mask that is not empty, of whole coarse pixels; None where all is."""
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    if not len(rows):
        return None
    return tuple(slice(FINER * (one[0] // FINER), FINER * (one[-1] // FINER + 1)) for one in (rows, columns))


def _painted(camera: Camera, box: Any, people: Sequence[Posed]) -> NDArray[np.float32]:
    """Return the colours (height, width, 3) of the nearest surfaces in a part of a picture."""
    shape = box[0].stop - box[0].start, box[1].stop - box[1].start
    colours, nearest = np.zeros((*shape, 3), dtype=np.float32), np.full(shape, np.inf, dtype=np.float32)
    for one in people:
        for part, depths, painted in _cones(camera, box, one):
            nearer = depths < nearest[part]
            nearest[part][nearer] = depths[nearer]
            colours[part][nearer] = painted[nearer]
    return colours


def _cones(camera: Camera, box: Any, one: Posed) -> Iterator[tuple[Any, Array, Array]]:
    """Yield the part of the box that each bone covers, with depths (inf where it is not) and colours there."""
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
        low = np.maximum((pixels[ends] - radii[:, None]).min(axis=0) - [box[1].start, box[0].start], 0.0)
        high = (pixels[ends] + radii[:, None]).max(axis=0) - [box[1].start, box[0].start] + 1.0
        left, top = low.astype(int)
        right, bottom = np.minimum(high, [box[1].stop - box[1].start, box[0].stop - box[0].start]).astype(int)
        if left >= right or top >= bottom:
            continue
        y, x = np.mgrid[top:bottom, left:right] + 0.5
        way = pixels[ends[1]] - pixels[ends[0]]
        off_x, off_y = x + box[1].start - pixels[ends[0], 0], y + box[0].start - pixels[ends[0], 1]
        along = np.clip((off_x * way[0] + off_y * way[1]) / max(way @ way, 1e-9), 0.0, 1.0)
        off_x, off_y = off_x - along * way[0], off_y - along * way[1]
        radius = radii[0] + along * (radii[1] - radii[0])
        aside = np.hypot(off_x, off_y) / radius
        bulge = np.sqrt(np.clip(1.0 - aside**2, 0.0, 1.0))
        normals = np.stack([off_x / radius, off_y / radius, -bulge], axis=-1) @ camera.rotation
        depth = depths[ends[0]] + along * (depths[ends[1]] - depths[ends[0]])
        depth = np.where(aside <= 1.0, depth - bulge * radius / scale[ends].mean(), np.inf)
        axis = joints[ends[1]] - joints[ends[0]]
        reference = across if _FORWARD[bone] else ahead
        colour = _lit(one.outfit, bone, normals, along, axis, reference)
        yield np.s_[top:bottom, left:right], depth.astype(np.float32), colour


def _lit(outfit: Outfit, bone: int, normals: Array, along: Array, axis: Array, reference: Array) -> Array:
    """Return the colours of a bone's surface: its weave goes around the axis from a direction that turns with it."""
    long = float(np.linalg.norm(axis))
    axis = axis / max(long, 1e-9)
    first = reference - (reference @ axis) * axis
    first /= max(float(np.linalg.norm(first)), 1e-9)
    around = np.arctan2(normals @ np.cross(axis, first), normals @ first) / (2.0 * np.pi)
    column = (around * TILE).astype(int) % TILE
    row = ((37 * bone) + along * long / LENGTH * TILE).astype(int) % TILE
    woven = 1.0 + outfit.strengths[bone] * outfit.weave[row, column]
    towards = -LIGHT / np.linalg.norm(LIGHT)
    light = AMBIENT + (1.0 - AMBIENT) * np.clip(normals @ towards, 0.0, 1.0) * 1.6
    return np.asarray((woven * light)[..., None] * outfit.colours[bone], dtype=np.float32)


def _shadow(camera: Camera, people: Sequence[Posed]) -> NDArray[np.float32]:
    """Return what share of the light is left at each pixel of the ground y = 0, where bodies cast a soft shadow."""
    dark = np.zeros((camera.height, camera.width), dtype=np.uint8)
    for one in people:
        joints = one.body.skeleton.joints(one.pose, one.place)
        ground = joints - joints[:, 1:2] / LIGHT[1] * LIGHT
        pixels, depths = camera.project(ground)
        for bone in range(len(BONES)):
            ends = [int(_PARENTS[bone]), bone + 1]
            if depths[ends].min() <= 1.0:
                continue
            thick = 2.0 * float(one.body.radii[bone].mean() * camera.focal[0] / depths[ends].mean())
            points = np.clip(16.0 * pixels[ends], -1e6, 1e6).astype(int)
            # the ground is seen at a grazing angle, and so is the thickness of what lies on it
            cv2.line(dark, points[0].tolist(), points[1].tolist(), 255, max(1, round(0.4 * thick)), cv2.LINE_AA, 4)
    soft = cv2.GaussianBlur(dark, (0, 0), SOFT)
    return np.asarray(1.0 - SHADE * soft.astype(np.float32) / 255.0)
