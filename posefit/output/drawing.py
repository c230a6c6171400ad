"""The parts of a track's pictures: text, the body, and another mode as thin bones.

Colours are in OpenCV's order: blue, green, red. Uncertain limbs are faint.
"""

import math
from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, PARENTS, SIDES
from posefit.silhouette.foreground import Image
from posefit.silhouette.outlines import NEAR

BACKGROUND = (28, 24, 22)
# the areas Y, R and B of the cost
BOTH = (186, 214, 168)
MISSED = (90, 90, 235)  # pixels of the mask only
SPILLED = (235, 160, 70)  # pixels of the body only
LEFT = (80, 150, 245)
RIGHT = (225, 165, 85)
MIDDLE = (205, 205, 205)
OTHER = (198, 156, 227)  # another likely pose of a frame
TEXT = (240, 240, 240)
LINES = (70, 66, 64)  # the lines of a chart
_FONT = cv2.FONT_HERSHEY_SIMPLEX

SIDE_VIEW_DISTANCE = 6.0  # metres
# metres, the radius of a joint's 80 % interval: below it bones are solid
SOLID_RADIUS = 0.05
# metres: above it bones are faintest
FAINTEST_RADIUS = 0.3
FAINTEST = 0.2  # the opacity of the faintest limbs
_STARTS = np.array(PARENTS[1:])  # the joint that each bone starts from
_TURN = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
_CIRCLE = np.column_stack([np.cos(_TURN), np.sin(_TURN)])  # the outline of a joint
SIDE_COLOURS = {"left": LEFT, "right": RIGHT, "middle": MIDDLE}
_ENDS = [JOINTS.index(side + name) for side in "lr" for name in ("wrist", "foot")]


def blank(height: int, width: int) -> Image:
    """Return an empty picture (height, width, 3)."""
    # a copy takes a tenth of the time that filling a picture with a colour does
    return _background(height, width).copy()


@lru_cache(maxsize=1)
def _background(height: int, width: int) -> Image:
    return np.full((height, width, 3), BACKGROUND, dtype=np.uint8)


def write(
    image: Image, text: str, at: tuple[int, int], colour: Any = TEXT, scale: float = 0.5
) -> None:
    """Write a text into an image."""
    cv2.putText(image, text, at, _FONT, scale, colour, 1, cv2.LINE_AA)


def width_of(text: str, scale: float = 0.5) -> int:
    """Return the width of a text in pixels."""
    return int(cv2.getTextSize(text, _FONT, scale, 1)[0][0])


def wrapped(text: str, width: int, scale: float) -> list[str]:
    """Return a text as lines that are at most `width` pixels wide.

    A word that is wider has a line to itself.
    """
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if width_of(longer, scale) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return [*filter(None, lines)]


def hexadecimal(colour: tuple[int, int, int]) -> str:
    """Return a colour in the notation of web pages, such as `#e1a555`."""
    blue, green, red = colour
    return f"#{red:02x}{green:02x}{blue:02x}"


def opacities(radii: Array) -> Array:
    """Return the opacity, 0 to 1, of each bone (26,).

    `radii` (27,) are the radii in metres of the joints' intervals. A bone is as solid
    as the fainter of its two ends. An end with an unknown radius, NaN, counts as solid.
    """
    span = FAINTEST_RADIUS - SOLID_RADIUS
    share = (FAINTEST_RADIUS - np.nan_to_num(radii)) / span  # (27,)
    solid = np.clip(share, FAINTEST, 1.0)
    return np.asarray(np.minimum(solid[_STARTS], solid[1:]))


def side_camera(
    body: Body, camera: Camera, pose: Array, translation: Array, side: int
) -> Camera:
    """Return a camera to the right of another one, which sees the whole body."""
    joints = body.skeleton.joints(pose, translation)
    middle = 0.5 * (joints.min(axis=0) + joints.max(axis=0))
    back = -camera.rotation[2]
    azimuth = math.atan2(back[0], back[2]) + 0.5 * math.pi
    tall = 1.25 * (float(np.ptp(joints[:, 1])) + 2.0 * float(body.radii.max()))
    return Camera.around(
        middle,
        azimuth,
        SIDE_VIEW_DISTANCE,
        (side, side),
        2.0 * math.atan(0.5 * tall / SIDE_VIEW_DISTANCE),
    )


def side_view(
    body: Body, camera: Camera, pose: Array, translation: Array, side: int
) -> Image:
    """Return a picture (side, side, 3) of the body from the camera's right.

    Left limbs are orange and right limbs blue.
    """
    image = blank(side, side)
    viewed = side_camera(body, camera, pose, translation, side)
    draw_body(image, body, viewed, pose, translation)
    return image


def draw_body(
    image: Image,
    body: Body,
    camera: Camera,
    pose: Array,
    translation: Array,
    solid: Array | None = None,
) -> None:
    """Draw the body into an image of the camera's size, far bones first.

    Left limbs are orange and right limbs blue. `solid` (26,) is the opacity of each
    bone; the picture behind a bone shows through the rest.
    """
    for bone, pixels, radii, shade in _cones(body, camera, pose, translation):
        colour = tuple(min(255.0, shade * c) for c in SIDE_COLOURS[SIDES[bone + 1]])
        opacity = 1.0 if solid is None else float(solid[bone])
        _cone(image, pixels, radii, colour, opacity)


def solid_map(
    body: Body, camera: Camera, pose: Array, translation: Array, solid: Array
) -> Array:
    """Return the opacity of a body, 0 to 1, at each pixel (height, width) of a camera.

    Pixels without the body have 1.
    """
    image = np.full((camera.height, camera.width), 255, dtype=np.uint8)
    for bone, pixels, radii, _ in _cones(body, camera, pose, translation):
        level = round(255.0 * float(solid[bone]))
        cv2.fillConvexPoly(image, _hull(pixels, radii), level, cv2.LINE_8, 4)
    return image / 255.0


def draw_bones(
    image: Image,
    body: Body,
    camera: Camera,
    pose: Array,
    translation: Array,
    colour: Any = None,
) -> None:
    """Draw bones as thin lines, in one colour or in the colours of their sides.

    Wrists and feet always have the colours of their sides.
    """
    pixels, depths = camera.project(body.skeleton.joints(pose, translation))
    thick = max(1, round(camera.height / 240))
    # the centres of pixels are at +0.5 here, but at whole numbers in OpenCV
    points = np.rint((np.nan_to_num(pixels) - 0.5) * 16).astype(np.int64).tolist()
    for joint, parent in enumerate(PARENTS[1:], 1):
        if min(depths[joint], depths[parent]) > NEAR:
            line = SIDE_COLOURS[SIDES[joint]] if colour is None else colour
            cv2.line(image, points[parent], points[joint], line, thick, cv2.LINE_AA, 4)
    for joint in _ENDS:
        if depths[joint] > NEAR:
            colour_of_side = SIDE_COLOURS[SIDES[joint]]
            radius = 16 * (thick + 1)
            cv2.circle(image, points[joint], radius, colour_of_side, -1, cv2.LINE_AA, 4)


def _cones(
    body: Body, camera: Camera, pose: Array, translation: Array
) -> Iterator[tuple[int, Array, Array, float]]:
    """Yield the bones in front of a camera, far ones first.

    Each has its number, the pixels of its ends (2, 2), its radii there (2,), and its
    shade.
    """
    pixels, depths = camera.project(body.skeleton.joints(pose, translation))
    # the same scale as in the cost if the two focal lengths differ
    scale = np.sqrt(camera.focal.prod()) / depths
    for bone in np.argsort(-(depths[_STARTS] + depths[1:])):
        ends = [int(_STARTS[bone]), int(bone) + 1]
        if depths[ends].min() <= NEAR:
            continue
        # bones that are nearer than the root are lighter, so that depth can be seen
        behind = float(np.clip(depths[ends].mean() - depths[0], -0.4, 0.4))
        shade = 1.0 - 0.25 * behind / 0.4
        yield int(bone), pixels[ends], body.radii[bone] * scale[ends], shade


def _hull(centres: Array, radii: Array) -> Any:
    outline = centres[:, None] + radii[:, None, None] * _CIRCLE
    return cv2.convexHull(np.rint(outline.reshape(-1, 2) * 16).astype(np.int32))


def _cone(
    image: Image, centres: Array, radii: Array, colour: Any, solid: float
) -> None:
    hull = _hull(centres, radii)
    # only the part of the picture that the cone can touch is copied and blended
    left, top, wide, high = cv2.boundingRect(hull // 16)
    part = image[
        max(top - 2, 0) : max(top + high + 3, 0),
        max(left - 2, 0) : max(left + wide + 3, 0),
    ]
    behind = part.copy() if solid < 1.0 else None
    cv2.fillConvexPoly(image, hull, colour, cv2.LINE_AA, 4)
    cv2.polylines(image, [hull], True, BACKGROUND, 1, cv2.LINE_AA, 4)
    if behind is not None and behind.size:
        part[:] = cv2.addWeighted(part, solid, behind, 1.0 - solid, 0.0)
