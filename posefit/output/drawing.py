"""What pictures of a track are made of: colours, words, a body, and the thin bones of another mode.

Colours are blue, green, red, as OpenCV has them. What is uncertain is faint.
"""

import math
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS, PARENTS, SIDES
from posefit.silhouette.foreground import Image
from posefit.silhouette.rasteriser import NEAR

BACKGROUND = (28, 24, 22)
# Y, R, B
BOTH = (186, 214, 168)
MISSED = (90, 90, 235)
SPILLED = (235, 160, 70)
LEFT = (80, 150, 245)
RIGHT = (225, 165, 85)
MIDDLE = (205, 205, 205)
OTHER = (198, 156, 227)  # what else a frame may show
TEXT = (240, 240, 240)
LINES = (70, 66, 64)  # of a chart
_FONT = cv2.FONT_HERSHEY_SIMPLEX

SIDE_VIEW_DISTANCE = 6.0  # metres
# metres of a joint's 80 % interval: bones are solid, and faintest
SOLID_RADIUS = 0.05
FAINTEST_RADIUS = 0.3
FAINTEST = 0.2  # how much of a faintest limb's colour is left
_STARTS = np.array(PARENTS[1:])  # the joint that each bone starts from
SIDE_COLOURS = {"left": LEFT, "right": RIGHT, "middle": MIDDLE}
_ENDS = [JOINTS.index(side + name) for side in "lr" for name in ("wrist", "foot")]


def blank(height: int, width: int) -> Image:
    """Return a picture (height, width, 3) of nothing."""
    return np.full((height, width, 3), BACKGROUND, dtype=np.uint8)


def write(
    image: Image, text: str, at: tuple[int, int], colour: Any = TEXT, scale: float = 0.5
) -> None:
    """Write a text into an image."""
    cv2.putText(image, text, at, _FONT, scale, colour, 1, cv2.LINE_AA)


def width_of(text: str, scale: float = 0.5) -> int:
    """Return how many pixels wide a text is."""
    return int(cv2.getTextSize(text, _FONT, scale, 1)[0][0])


def wrapped(text: str, width: int, scale: float) -> list[str]:
    """Return the lines of a text that are at most so many pixels wide, where no word is wider."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if width_of(longer, scale) <= width:
            lines[-1] = longer
        else:
            lines.append(word)
    return [*filter(None, lines)]


def hexadecimal(colour: tuple[int, int, int]) -> str:
    """Return a colour as a page has it."""
    blue, green, red = colour
    return f"#{red:02x}{green:02x}{blue:02x}"


def opacities(radii: Array) -> Array:
    """Return how solid each bone (26,) is drawn, 0 to 1, given how far its joints (27,) may be off in metres.

    A bone is as solid as the fainter of its two ends. Where that is unknown, NaN, it is solid.
    """
    solid = np.clip(
        (FAINTEST_RADIUS - np.nan_to_num(radii)) / (FAINTEST_RADIUS - SOLID_RADIUS),
        FAINTEST,
        1.0,
    )
    return np.asarray(np.minimum(solid[_STARTS], solid[1:]))


def side_camera(
    body: Body, camera: Camera, pose: Array, translation: Array, side: int
) -> Camera:
    """Return a camera that sees the whole body from the right of another one."""
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
    """Return the body (side, side, 3) viewed from the camera's right: left limbs orange, right ones blue."""
    image = blank(side, side)
    draw_body(
        image,
        body,
        side_camera(body, camera, pose, translation, side),
        pose,
        translation,
    )
    return image


def draw_body(
    image: Image,
    body: Body,
    camera: Camera,
    pose: Array,
    translation: Array,
    solid: Array | None = None,
) -> None:
    """Draw the body into an image of a camera's size, far bones first: left limbs orange, right ones blue.

    `solid` (26,) is how much of each bone's colour is left; what lies behind shows through the rest.
    """
    for bone, pixels, radii, shade in _cones(body, camera, pose, translation):
        colour = tuple(min(255.0, shade * c) for c in SIDE_COLOURS[SIDES[bone + 1]])
        _cone(
            image, pixels, radii, colour, 1.0 if solid is None else float(solid[bone])
        )


def solid_map(
    body: Body, camera: Camera, pose: Array, translation: Array, solid: Array
) -> Array:
    """Return how solid a body is at each pixel (height, width) of a camera, 0 to 1; 1 where there is none."""
    image = np.full((camera.height, camera.width), 255, dtype=np.uint8)
    for bone, pixels, radii, _ in _cones(body, camera, pose, translation):
        cv2.fillConvexPoly(
            image,
            _hull(pixels, radii),
            round(255.0 * float(solid[bone])),
            cv2.LINE_8,
            4,
        )
    return image / 255.0


def draw_bones(
    image: Image,
    body: Body,
    camera: Camera,
    pose: Array,
    translation: Array,
    colour: Any = None,
) -> None:
    """Draw bones as thin lines, of one colour or those of their sides; wrists and feet have the colours of theirs."""
    pixels, depths = camera.project(body.skeleton.joints(pose, translation))
    thick = max(1, round(camera.height / 240))
    # pixel centres are at +0.5 here, and at whole numbers in OpenCV
    points = np.rint((np.nan_to_num(pixels) - 0.5) * 16).astype(np.int64).tolist()
    for joint, parent in enumerate(PARENTS[1:], 1):
        if min(depths[joint], depths[parent]) > NEAR:
            line = SIDE_COLOURS[SIDES[joint]] if colour is None else colour
            cv2.line(image, points[parent], points[joint], line, thick, cv2.LINE_AA, 4)
    for joint in _ENDS:
        if depths[joint] > NEAR:
            cv2.circle(
                image,
                points[joint],
                16 * (thick + 1),
                SIDE_COLOURS[SIDES[joint]],
                -1,
                cv2.LINE_AA,
                4,
            )


def _cones(
    body: Body, camera: Camera, pose: Array, translation: Array
) -> Iterator[tuple[int, Array, Array, float]]:
    """Yield bones before a camera, far ones first: number, pixels of both ends, radii there, and shade."""
    pixels, depths = camera.project(body.skeleton.joints(pose, translation))
    # as in the cost, where the two focal lengths differ
    scale = np.sqrt(camera.focal.prod()) / depths
    for bone in np.argsort(-(depths[_STARTS] + depths[1:])):
        ends = [int(_STARTS[bone]), int(bone) + 1]
        if depths[ends].min() <= NEAR:
            continue
        shade = (
            1.0
            - 0.25 * float(np.clip(depths[ends].mean() - depths[0], -0.4, 0.4)) / 0.4
        )
        yield int(bone), pixels[ends], body.radii[bone] * scale[ends], shade


def _hull(centres: Array, radii: Array) -> Any:
    angles = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    outline = centres[:, None] + radii[:, None, None] * circle
    return cv2.convexHull(np.rint(outline.reshape(-1, 2) * 16).astype(np.int32))


def _cone(
    image: Image, centres: Array, radii: Array, colour: Any, solid: float
) -> None:
    hull = _hull(centres, radii)
    # what is behind it, where it is not solid: no more of the picture than it can touch
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
