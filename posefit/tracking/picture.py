"""Pictures of a track: the observed silhouette with the fitted body on it, beside a view of the body from its side."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import PARENTS, SIDES
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.silhouette.rasteriser import NEAR

BACKGROUND = (28, 24, 22)
BOTH, MISSED, SPILLED = (186, 214, 168), (90, 90, 235), (235, 160, 70)  # Y, R, B
LEFT, RIGHT, MIDDLE = (80, 150, 245), (225, 165, 85), (205, 205, 205)
TEXT = (240, 240, 240)
PANEL = 480  # pixels high
STILLS = 6  # frames on the summary
BAND = 38  # pixels that the label stands on
SOLID = 0.65  # how much of what was filmed the body hides
DISTANCE = 6.0  # metres from the view from the side
_FONT = cv2.FONT_HERSHEY_SIMPLEX


class Painter:
    """Paints frame after frame; keeps small stills of a few of them for the summary."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._wanted = np.unique(np.linspace(0, scene.count - 1, STILLS).round().astype(int)).tolist()
        self._stills: list[Image] = []
        self._count = 0

    def add(
        self, frame: Frame, observation: Observation, row: Mapping[str, float], filmed: Image | None = None
    ) -> Image:
        """Return the picture (height, width, 3) of a frame: on what was `filmed`, or on the masks."""
        body, cameras = self._scene.body, self._scene.cameras
        if filmed is None:
            seen = [
                _overlay(silhouette.mask, project(body, camera, frame.pose, frame.translation))
                for camera, silhouette in zip(cameras, observation.silhouettes, strict=True)
            ]
            left = _grid(seen)
        else:
            drawn = filmed.copy()
            draw_body(drawn, body, cameras[0], frame.pose, frame.translation)
            left = _panel(np.asarray(cv2.addWeighted(drawn, SOLID, filmed, 1.0 - SOLID, 0.0), np.uint8), PANEL)
        width = left.shape[1]
        image = np.hstack([left, side_view(body, cameras[0], frame.pose, frame.translation, PANEL)])
        label = "   ".join(
            [f"frame {self._count}", f"cost {row['cost']:.2f}", f"IoU {row['iou']:.3f}"]
            + ([f"error {row['error_degrees']:.2f} deg"] if "error_degrees" in row else [])
            + ([] if observation.usable else ["pose held"])
        )
        image[:BAND] //= 4  # so that the label is seen before a bright sky
        write(image, label, (12, 26))
        write(image, "from the camera's right", (width + 12, 26))
        if filmed is None:
            for k, (name, colour) in enumerate((("both", BOTH), ("observed only", MISSED), ("body only", SPILLED))):
                write(image, name, (12 + 130 * k, PANEL - 14), colour)
        if self._count in self._wanted:
            self._stills.append(
                np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
            )
        self._count += 1
        return image

    def summary(self, rows: Sequence[Mapping[str, float]]) -> Image:
        """Return stills of the track above a curve of its error, or of its cost where there is no truth."""
        stills = self._stills + [np.full_like(self._stills[0], BACKGROUND[0])] * (-len(self._stills) % 3)
        grid = np.vstack([np.hstack(stills[k : k + 3]) for k in range(0, len(stills), 3)])
        name = "error_degrees" if "error_degrees" in rows[0] else "cost"
        return np.vstack([grid, curve([row[name] for row in rows], name.replace("_", " "), grid.shape[1], 160)])


def _overlay(mask: Mask, fitted: Mask) -> Image:
    overlay = np.full((*mask.shape, 3), BACKGROUND, dtype=np.uint8)
    overlay[mask & ~fitted], overlay[fitted & ~mask], overlay[mask & fitted] = MISSED, SPILLED, BOTH
    return overlay


def _panel(image: Image, height: int, sharp: bool = False) -> Image:
    width = 2 * round(image.shape[1] * height / image.shape[0] / 2)
    how = cv2.INTER_NEAREST if sharp else cv2.INTER_AREA if height < image.shape[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=how), dtype=np.uint8)


def _grid(views: Sequence[Image]) -> Image:
    """Return the views of all cameras in one panel, two beside each other."""
    columns = min(2, len(views))
    height = PANEL // -(-len(views) // columns)
    panels = [_panel(view, height, sharp=True) for view in views]
    wide = max(panel.shape[1] for panel in panels)
    panels = [np.pad(panel, ((0, 0), (0, wide - panel.shape[1]), (0, 0))) for panel in panels]
    panels += [np.zeros_like(panels[0])] * (-len(panels) % columns)
    return np.vstack([np.hstack(panels[k : k + columns]) for k in range(0, len(panels), columns)])


def side_view(body: Body, camera: Camera, pose: Array, translation: Array, side: int) -> Image:
    """Return the body (side, side, 3) seen from the camera's right: left limbs orange, right ones blue."""
    joints = body.skeleton.joints(pose, translation)
    middle = 0.5 * (joints.min(axis=0) + joints.max(axis=0))
    back = -camera.rotation[2]
    azimuth = math.atan2(back[0], back[2]) + 0.5 * math.pi
    tall = 1.25 * (float(np.ptp(joints[:, 1])) + 2.0 * float(body.radii.max()))
    view = Camera.around(middle, azimuth, DISTANCE, (side, side), 2.0 * math.atan(0.5 * tall / DISTANCE))
    image = np.full((side, side, 3), BACKGROUND, dtype=np.uint8)
    draw_body(image, body, view, pose, translation)
    return image


def draw_body(image: Image, body: Body, camera: Camera, pose: Array, translation: Array) -> None:
    """Draw the body into an image of a camera's size, far bones first: left limbs orange, right ones blue."""
    joints = body.skeleton.joints(pose, translation)
    pixels, depths = camera.project(joints)
    scale = np.sqrt(camera.focal.prod()) / depths  # as in the cost, where the two focal lengths differ
    parents = np.array(PARENTS[1:])
    for bone in np.argsort(-(depths[parents] + depths[1:])):
        ends = [int(parents[bone]), int(bone) + 1]
        if depths[ends].min() <= NEAR:
            continue
        shade = 1.0 - 0.25 * float(np.clip(depths[ends].mean() - depths[0], -0.4, 0.4)) / 0.4
        colour = {"left": LEFT, "right": RIGHT, "middle": MIDDLE}[SIDES[bone + 1]]
        _cone(image, pixels[ends], body.radii[bone] * scale[ends], tuple(min(255.0, shade * c) for c in colour))


def _cone(image: Image, centres: Array, radii: Array, colour: Any) -> None:
    outline: list[Array] = []
    for centre, radius in zip(centres, radii, strict=True):
        angles = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
        outline.append(centre + radius * np.column_stack([np.cos(angles), np.sin(angles)]))
    hull = cv2.convexHull(np.rint(np.vstack(outline) * 16).astype(np.int32))
    cv2.fillConvexPoly(image, hull, colour, cv2.LINE_AA, 4)
    cv2.polylines(image, [hull], True, BACKGROUND, 1, cv2.LINE_AA, 4)


def curve(values: Sequence[float], name: str, width: int, height: int) -> Image:
    """Return a plot (height, width, 3) of values, one a frame, from 0 up."""
    image = np.full((height, width, 3), BACKGROUND, dtype=np.uint8)
    top = max(max(values), 1e-9) * 1.15
    x = np.linspace(56, width - 16, max(len(values), 2))[: len(values)]
    y = height - 24 - np.array(values) / top * (height - 48)
    for level in (0.0, float(np.mean(values)), max(values)):
        row = int(height - 24 - level / top * (height - 48))
        cv2.line(image, (56, row), (width - 16, row), (70, 66, 64), 1)
        write(image, f"{level:.2f}", (8, row + 4), scale=0.4)
    points = np.rint(np.column_stack([x, y]) * 16).astype(np.int32)
    cv2.polylines(image, [points], False, BOTH, 2, cv2.LINE_AA, 4)
    write(image, f"{name}, frame by frame: 0, mean and maximum", (60, 16), scale=0.45)
    return image


def write(image: Image, text: str, at: tuple[int, int], colour: Any = TEXT, scale: float = 0.5) -> None:
    """Write a text into an image."""
    cv2.putText(image, text, at, _FONT, scale, colour, 1, cv2.LINE_AA)
