"""Pictures of a track: the fitted body on the observed silhouette, and from its side.

If a method reports its uncertainty, uncertain limbs are faint, another mode is drawn as
thin bones, and lost frames have a border.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple, Self

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.evaluation.errors import LOST, Table
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.camera import FOCALS, Camera
from posefit.motion.steadiness import runs
from posefit.output.drawing import (
    BACKGROUND,
    BOTH,
    LINES,
    MISSED,
    OTHER,
    SPILLED,
    blank,
    draw_body,
    draw_bones,
    opacities,
    side_camera,
    solid_map,
    width_of,
    wrapped,
    write,
)
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.uncertainty.calibration import MAIN_LEVEL
from posefit.uncertainty.modes import Mode, other_mode, other_modes

Row = Mapping[str, float]  # one row of a table
PANEL = 480  # pixels high
# the greatest ratio of a picture's width to its height, because MPEG-4 allows at most
# 8,191 pixels; wider pictures get a smaller height
MAX_ASPECT = 4
MIN_OVERLAY = 240  # pixels of width, so that the words fit
# the colours of the background, mask only, body only, and both, in OpenCV's order
OVERLAP = np.zeros((256, 1, 3), dtype=np.uint8)
OVERLAP[:4, 0] = [BACKGROUND, MISSED, SPILLED, BOTH]
SUMMARY_STILLS = 6  # frames on the summary
SUMMARY_SCALE = 0.65  # scale of its text, which a page shows at three quarters
LABEL_HEIGHT = 38  # pixels of the strip behind the label
SOLID = 0.65  # the opacity of the body over the footage
MIN_OTHER_WEIGHT = 0.2  # modes with less weight are not drawn
# the most other modes on the summary of a single frame, and their least weight
ALTERNATIVES = 3
MIN_ALTERNATIVE_WEIGHT = 0.05
BORDER = 6  # pixels around a lost frame
LINE_HEIGHT = 22  # pixels from one line to the next
# the top of a curve is twice the 0.9 quantile; values above it are peaks
PEAK = 2.0
PEAK_QUANTILE = 0.9
MAX_PEAKS = 3  # this many peaks are named


class _Certainty(NamedTuple):
    """Whether a method calls a frame lost, and its sides unknown."""

    lost: bool
    side_unknown: bool

    @classmethod
    def of(cls, row: Row, observation: Observation) -> Self:
        """Return the certainty of a frame by its row of the table.

        A pose that was held was not searched, and the frame counts as neither, as in
        the figures of a track.
        """
        searched = observation.usable
        lost = searched and row["lost"] >= LOST
        return cls(lost, searched and row["unknown_sides"] == 1.0)


class Painter:
    """Paints frame after frame, and keeps small stills of a few for the summary.

    The stills are of `usable` frames, if there are any.
    """

    def __init__(self, scene: Scene, usable: Sequence[bool] = ()) -> None:
        self._scene = scene
        # the grid of cameras has as many columns as rows, or one more
        self._columns = math.ceil(math.sqrt(len(scene.cameras)))
        self._panel = PANEL // math.ceil(len(scene.cameras) / self._columns)
        # the width of a video must be even
        self._widest = MIN_OVERLAY // self._columns // 2 * 2
        for camera in scene.cameras:
            width, _ = panel_size(camera.width, camera.height, self._panel)
            self._widest = max(self._widest, width)
        shown = np.flatnonzero(usable) if any(usable) else np.arange(scene.count)
        spaced = np.linspace(0, len(shown) - 1, SUMMARY_STILLS).round().astype(int)
        self._wanted = np.unique(shown[spaced]).tolist()
        self._stills: list[Image] = []
        self._count = 0

    @property
    def size(self) -> tuple[int, int]:
        """The width and the height in pixels of every frame's picture."""
        return self._columns * self._widest + PANEL, PANEL

    def add(
        self,
        frame: Frame,
        observation: Observation,
        row: Row,
        filmed: Image | None = None,
        radii: Array | None = None,
    ) -> Image:
        """Return the picture (height, width, 3) of the next frame.

        Args:
            frame: The estimate.
            observation: The masks.
            row: The frame's row of the table.
            filmed: The footage, or None to draw on the masks.
            radii: The radii (levels, 27) of the joints' intervals, or None if the frame
                has no posterior.
        """
        skeleton = self._scene.body.skeleton
        solid = None if radii is None else opacities(radii[MAIN_LEVEL])
        other = other_mode(skeleton, frame.modes, frame.pose, MIN_OTHER_WEIGHT)
        image = self._panels(frame, observation, filmed, solid, other)
        certainty = _Certainty.of(row, observation)
        if self._scene.count == 1:
            self._add_modes(image, frame, observation, row, filmed)
        elif self._count in self._wanted:
            self._stills.append(self._still(image, row, certainty.lost))
        self._write_head(image, row, observation)
        if filmed is None or len(self._scene.cameras) > 1:
            _write_legend(image, PANEL - 14)
        notes = []
        if certainty.lost:
            notes.append(("lost", MISSED))
        if certainty.side_unknown:
            notes.append(("left and right unknown", OTHER))
        if other is not None:
            words = f"thin: may be this, {100.0 * other.weight:.0f} %"
            notes.append((words, OTHER))
        column = image.shape[1] - PANEL + 12
        for k, (words, colour) in enumerate(reversed(notes)):
            write(image, words, (column, PANEL - 14 - LINE_HEIGHT * k), colour)
        if certainty.lost:
            _draw_border(image, BORDER)
        self._count += 1
        return image

    def _add_modes(
        self,
        image: Image,
        frame: Frame,
        observation: Observation,
        row: Row,
        filmed: Image | None,
    ) -> None:
        """Keep stills of all poses that a single frame may show, with their weights.

        `image` shows the estimate. The others are as for `add`.
        """
        others = other_modes(self._scene.body.skeleton, frame.modes, frame.pose)
        share = ""
        if others:
            all_weights = sum(mode.weight for mode in frame.modes)
            weight = all_weights - sum(mode.weight for mode in others)
            share = f", {100.0 * weight:.0f} %"
        lost = _Certainty.of(row, observation).lost
        self._stills.append(self._still(image, row, lost, share))
        alternatives = [mode for mode in others if mode.weight > MIN_ALTERNATIVE_WEIGHT]
        for mode in alternatives[:ALTERNATIVES]:
            alternative = replace(frame, pose=mode.pose, translation=mode.translation)
            still = self._panels(alternative, observation, filmed)
            words = f"or this, {100.0 * mode.weight:.0f} %"
            self._stills.append(_labelled(still, words))

    def _write_head(self, image: Image, row: Row, observation: Observation) -> None:
        """Write a frame's figures above its picture."""
        label = [
            f"frame {self._scene.first + self._count}",
            f"cost {row['cost']:.2f}",
            f"IoU {row['iou']:.3f}",
        ]
        if "error_degrees" in row:
            label.append(f"error {row['error_degrees']:.2f} deg")
        if not observation.usable:
            label.append("pose held")
        # darkened, so that the label can be read on a bright sky
        image[:LABEL_HEIGHT] //= 4
        write(image, "   ".join(label), (12, 26))
        write(image, "from the camera's right", (image.shape[1] - PANEL + 12, 26))

    def _panels(
        self,
        frame: Frame,
        observation: Observation,
        filmed: Image | None,
        solid: Array | None = None,
        other: Mode | None = None,
    ) -> Image:
        """Return the `overlay` of a frame, with the body from its side to the right."""
        body = self._scene.body
        pose = frame.pose
        place = frame.translation
        camera = side_camera(body, self._scene.cameras[0], pose, place, PANEL)
        side = blank(PANEL, PANEL)
        draw_body(side, body, camera, pose, place, solid)
        if other is not None:
            draw_bones(side, body, camera, other.pose, other.translation, OTHER)
        return np.hstack([self.overlay(frame, observation, filmed, solid, other), side])

    def _still(self, image: Image, row: Row, lost: bool, weight: str = "") -> Image:
        """Return a small picture below a label, which ends with the pose's `weight`."""
        quality = f"cost {row['cost']:.1f}"
        if "error_degrees" in row:
            quality = f"error {row['error_degrees']:.1f} deg"
        label = f"frame {self._scene.first + self._count}, {quality}{weight}"
        return _labelled(image, label, lost)

    def overlay(
        self,
        frame: Frame,
        observation: Observation,
        filmed: Image | None,
        solid: Array | None = None,
        other: Mode | None = None,
    ) -> Image:
        """Return a picture (height, width, 3) of the body in all cameras' views.

        The body is drawn on the first camera's picture `filmed`, and on the masks of
        the other cameras. On masks, coloured bones show which side is left.
        """
        panels = []
        for number, camera in enumerate(self._scene.cameras):
            if filmed is not None and number == 0:
                panel = self._on_footage(camera, frame, filmed, solid)
            else:
                mask = observation.silhouettes[number].mask
                panel = self._on_mask(camera, frame, mask, solid)
            if other is not None:
                zoomed = _zoomed(camera, panel)
                body = self._scene.body
                draw_bones(panel, body, zoomed, other.pose, other.translation, OTHER)
            panels.append(_padded(panel, self._widest, self._panel))
        grid = _grid(panels, self._columns, 0)
        # the rows of seven or more cameras do not fill the height exactly
        return _padded(grid, grid.shape[1], PANEL)

    def _on_footage(
        self, camera: Camera, frame: Frame, filmed: Image, solid: Array | None
    ) -> Image:
        """Return a panel of the body on a picture of the footage."""
        drawn = filmed.copy()
        body = self._scene.body
        draw_body(drawn, body, camera, frame.pose, frame.translation, solid)
        mixed = cv2.addWeighted(drawn, SOLID, filmed, 1.0 - SOLID, 0.0)
        return panel_of(np.asarray(mixed, np.uint8), self._panel)

    def _on_mask(
        self, camera: Camera, frame: Frame, mask: Mask, solid: Array | None
    ) -> Image:
        """Return a panel of the body and its bones on a mask."""
        body = self._scene.body
        pose = frame.pose
        place = frame.translation
        fitted = project(body, camera, pose, place)
        # 0 for neither, 1 for the mask, 2 for the body, 3 for both
        overlap = mask.view(np.uint8) + 2 * fitted.view(np.uint8)
        numbers = panel_of(overlap, self._panel, sharp=True)
        # a tenth of the time that indexing with NumPy takes
        panel = np.asarray(cv2.applyColorMap(numbers, OVERLAP), np.uint8)
        zoomed = _zoomed(camera, panel)
        if solid is not None:
            share = solid_map(body, zoomed, pose, place, solid).ravel()
            # by number: a third of the time that choosing by truth values takes
            faint = np.flatnonzero(share < 1.0)
            share = share[faint, None]
            pixels = panel.reshape(-1, 3)
            behind = (1.0 - share) * np.array(BACKGROUND)
            pixels[faint] = share * pixels[faint] + behind
        draw_bones(panel, body, zoomed, pose, place)
        return panel

    def summary(self, table: Table, notes: Sequence[str] = ()) -> Image:
        """Return the notes and stills above a curve of the track.

        The curve is the error, or the cost if the truth is unknown.
        """
        grid = _grid(self._stills, 2, BACKGROUND[0])
        width = grid.shape[1]
        parts = []
        for note in notes:
            lines = wrapped(note, width - 24, SUMMARY_SCALE)
            head = blank(LABEL_HEIGHT + LINE_HEIGHT * (len(lines) - 1), width)
            for k, line in enumerate(lines):
                write(head, line, (12, 26 + LINE_HEIGHT * k), scale=SUMMARY_SCALE)
            parts.append(head)
        parts.append(grid)
        if self._scene.pictures is None or len(self._scene.cameras) > 1:
            parts.append(blank(LABEL_HEIGHT, width))
            _write_legend(parts[-1], LABEL_HEIGHT - 12, SUMMARY_SCALE)
        if self._scene.count == 1:
            return np.vstack(parts)
        name = "error_degrees" if "error_degrees" in table else "cost"
        label = name.replace("_", " ")
        parts.append(curve(table[name], label, width, 180, self._scene.first))
        return np.vstack(parts)


def _labelled(image: Image, label: str, lost: bool = False) -> Image:
    """Return a picture at half size, below a label."""
    still = np.asarray(
        cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8
    )
    if lost:
        _draw_border(still, BORDER // 2)
    head = blank(LABEL_HEIGHT, still.shape[1])
    write(head, label, (12, 26), scale=SUMMARY_SCALE)
    return np.vstack([head, still])


def _draw_border(image: Image, width: int) -> None:
    # written here, because OpenCV's thick lines are a pixel wider
    image[:width] = image[-width:] = MISSED
    image[:, :width] = image[:, -width:] = MISSED


def _write_legend(image: Image, row: int, scale: float = 0.5) -> None:
    at = 12
    for name, colour in (
        ("both", BOTH),
        ("observed only", MISSED),
        ("body only", SPILLED),
    ):
        write(image, name, (at, row), colour, scale)
        at += width_of(name, scale) + 24


def panel_size(width: int, height: int, panel: int) -> tuple[int, int]:
    """Return the size of a picture in a panel `panel` pixels high; the width is even.

    A picture wider than `MAX_ASPECT` times the height gets a smaller height.
    """
    even = 2 * round(width * panel / height / 2)
    widest = MAX_ASPECT * panel
    if even > widest:
        return widest, max(round(height * widest / width), 1)
    return max(even, 2), panel


def panel_of(image: Image, height: int, sharp: bool = False) -> Image:
    """Return a picture scaled to its `panel_size`.

    A `sharp` picture keeps its values; others are interpolated.
    """
    size = panel_size(image.shape[1], image.shape[0], height)
    if sharp:
        interpolation = cv2.INTER_NEAREST
    elif size[1] < image.shape[0]:
        interpolation = cv2.INTER_AREA
    else:
        interpolation = cv2.INTER_LINEAR
    scaled = cv2.resize(image, size, interpolation=interpolation)
    return np.asarray(scaled, dtype=np.uint8)


def _zoomed(camera: Camera, panel: Image) -> Camera:
    """Return the camera for a picture that was scaled to a panel."""
    height, width = panel.shape[:2]
    zoom = np.array([width / camera.width, height / camera.height])
    # rounding to whole pixels may lead beyond the longest or the shortest lens
    shortest, longest = np.multiply(FOCALS, max(width, height))
    return replace(
        camera,
        width=width,
        height=height,
        focal=np.clip(zoom * camera.focal, shortest, longest),
        centre=zoom * camera.centre,
    )


def _padded(image: Image, width: int, height: int) -> Image:
    """Return a picture enlarged to a size, with black to its right and below it."""
    right = width - image.shape[1]
    below = height - image.shape[0]
    if right == below == 0:
        return image
    return np.pad(image, ((0, below), (0, right), (0, 0)))


def _grid(panels: list[Image], columns: int, background: int) -> Image:
    """Return panels side by side in rows; the last row is filled with `background`."""
    missing = -len(panels) % columns
    if missing:
        panels = panels + [np.full_like(panels[0], background)] * missing
    if len(panels) == 1:
        return panels[0]
    rows = [np.hstack(panels[k : k + columns]) for k in range(0, len(panels), columns)]
    return np.vstack(rows)


def curve(values: Array, name: str, width: int, height: int, first: int = 0) -> Image:
    """Return a plot (height, width, 3) of values (T,), one per frame, from 0 up.

    Peaks above the top of the plot are named in its title.
    """
    image = blank(height, width)
    left = 66
    right = width - 16
    bottom = height - 24  # the row of 0
    limit = PEAK * float(np.quantile(values, PEAK_QUANTILE))
    peaks = _peaks(values, limit)
    top = limit if peaks and limit > 0.0 else float(values.max())
    # a margin above the top, for peaks and the title
    scale = (bottom - 32) / (max(top, 1e-9) * 1.15)
    for lines, level in enumerate((0.0, float(np.mean(values)), top)):
        row = int(bottom - level * scale)
        cv2.line(image, (left, row), (right, row), LINES, 1)
        # labels keep a line's distance, even if their levels are closer
        text_row = min(row, bottom - lines * LINE_HEIGHT) + 6
        write(image, f"{level:.2f}", (8, text_row), scale=SUMMARY_SCALE - 0.1)
    x = np.linspace(left, right, max(len(values), 2))[: len(values)]
    y = bottom - scale * np.minimum(values, 1.1 * top)  # (T,)
    points = np.rint(np.column_stack([x, y]) * 16).astype(np.int32)
    cv2.polylines(image, [points], False, BOTH, 2, cv2.LINE_AA, 4)
    words = "mean and maximum"
    if top == limit:
        named = [f"{values[k]:.1f} in frame {first + k}" for k in peaks[:MAX_PEAKS]]
        words = f"mean, and the top; above it {', '.join(named)}"
        if len(peaks) > MAX_PEAKS:
            words += f" and {len(peaks) - MAX_PEAKS} more"
    write(image, f"{name}, frame by frame: 0, {words}", (left, 20), scale=SUMMARY_SCALE)
    return image


def _peaks(values: Array, limit: float) -> list[int]:
    """Return the highest frame of each run above a limit, the highest run first."""
    peaks = []
    for start, stop in runs(values > limit):
        peaks.append(start + int(values[start:stop].argmax()))
    return sorted(peaks, key=lambda k: -values[k])
