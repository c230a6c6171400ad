"""Pictures of a track: the observed silhouette with the fitted body on it, beside a view of the body from its side."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.fitting.tracker import Frame, Observation
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import Array
from posefit.geometry.skeleton import BONES, PARENTS
from posefit.silhouette.cost import project
from posefit.study.source import Scene

Image = NDArray[np.uint8]  # (height, width, 3) blue, green, red

BACKGROUND = (28, 24, 22)
BOTH, MISSED, SPILLED = (186, 214, 168), (90, 90, 235), (235, 160, 70)  # Y, R, B
LEFT, RIGHT, MIDDLE = (80, 150, 245), (225, 165, 85), (205, 205, 205)
TEXT = (240, 240, 240)
PANEL = 480  # pixels high
STILLS = 6  # frames on the summary
_FONT = cv2.FONT_HERSHEY_SIMPLEX


class Painter:
    """Paints frame after frame; keeps small stills of a few of them for the summary."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self.camera = scene, scene.cameras[0]
        self._wanted = np.unique(np.linspace(0, scene.count - 1, STILLS).round().astype(int)).tolist()
        self._stills: list[Image] = []
        self._count = 0

    def add(self, frame: Frame, observation: Observation, row: Mapping[str, float]) -> Image:
        """Return the picture (height, width, 3) of a frame."""
        body, camera = self._scene.body, self.camera
        mask = observation.silhouettes[0].mask
        fitted = project(body, camera, frame.pose, frame.translation)
        overlay = np.full((*mask.shape, 3), BACKGROUND, dtype=np.uint8)
        overlay[mask & ~fitted], overlay[fitted & ~mask], overlay[mask & fitted] = MISSED, SPILLED, BOTH
        height = PANEL
        width = 2 * round(mask.shape[1] * height / mask.shape[0] / 2)
        left = np.asarray(cv2.resize(overlay, (width, height), interpolation=cv2.INTER_NEAREST), dtype=np.uint8)
        side = side_view(body, camera, frame.pose, frame.translation, PANEL)
        image = np.hstack([left, side])
        label = "   ".join(
            [f"frame {self._count}", f"cost {row['cost']:.2f}", f"IoU {row['iou']:.3f}"]
            + ([f"error {row['error_degrees']:.2f} deg"] if "error_degrees" in row else [])
        )
        _write(image, label, (12, 26))
        _write(image, "from the side", (width + 12, 26))
        for k, (name, colour) in enumerate((("both", BOTH), ("observed only", MISSED), ("body only", SPILLED))):
            _write(image, name, (12 + 130 * k, PANEL - 14), colour)
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


def side_view(body: Body, camera: Camera, pose: Array, translation: Array, side: int) -> Image:
    """Return the body (side, side, 3) seen from the camera's right: left limbs orange, right ones blue."""
    joints = body.skeleton.joints(pose, translation)
    middle = 0.5 * (joints.min(axis=0) + joints.max(axis=0))
    back = -camera.rotation[2]
    azimuth = math.atan2(back[0], back[2]) + 0.5 * math.pi
    tall = 1.25 * (float(np.ptp(joints[:, 1])) + 2.0 * float(body.radii.max()))
    distance = 6.0
    view = Camera.around(middle, azimuth, distance, (side, side), 2.0 * math.atan(0.5 * tall / distance))
    pixels, depths = view.project(joints)
    scale = view.focal[0] / depths
    image = np.full((side, side, 3), BACKGROUND, dtype=np.uint8)
    parents = np.array(PARENTS[1:])
    for bone in np.argsort(-(depths[parents] + depths[1:])):
        ends = (int(parents[bone]), int(bone) + 1)
        radii = body.radii[bone] * scale[list(ends)]
        shade = 1.0 - 0.25 * float(np.clip(depths[list(ends)].mean() - distance, -0.4, 0.4)) / 0.4
        colour = (
            MIDDLE if BONES[bone] in ("lowerback", "lowerneck") else {"l": LEFT, "r": RIGHT}.get(BONES[bone][0], MIDDLE)
        )
        _cone(image, pixels[list(ends)], radii, tuple(min(255.0, shade * c) for c in colour))
    return image


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
        _write(image, f"{level:.2f}", (8, row + 4), scale=0.4)
    points = np.rint(np.column_stack([x, y]) * 16).astype(np.int32)
    cv2.polylines(image, [points], False, BOTH, 2, cv2.LINE_AA, 4)
    _write(image, f"{name}, frame by frame: 0, mean and maximum", (60, 16), scale=0.45)
    return image


def _write(image: Image, text: str, at: tuple[int, int], colour: Any = TEXT, scale: float = 0.5) -> None:
    cv2.putText(image, text, at, _FONT, scale, colour, 1, cv2.LINE_AA)
