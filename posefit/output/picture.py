"""Pictures of a track: the observed silhouette with the fitted body on it, beside a view of the body from its side.

Where a method reports its uncertainty, uncertain limbs are faint, another mode is drawn as thin bones, and lost
frames have a border.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

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
from posefit.uncertainty.calibration import MAIN_LEVEL
from posefit.uncertainty.modes import Mode, other_mode, other_modes

Row = Mapping[str, float]  # of a table
PANEL = 480  # pixels high
# times the panels' height that a picture is wide at most, as MPEG-4 has no frames of
# more than 8,191 pixels; wider ones are lower
MAX_ASPECT = 4
MIN_OVERLAY = 240  # pixels of its width, so that there is room for the words
# of neither, the mask, the body, and both
OVERLAP = np.array([BACKGROUND, MISSED, SPILLED, BOTH], dtype=np.uint8)
SUMMARY_STILLS = 6  # frames on the summary
SUMMARY_SCALE = 0.65  # of its words, which a page shows at three quarters of their size
LABEL_HEIGHT = 38  # pixels that the label stands on
SOLID = 0.65  # how much of the footage the body hides
MIN_OTHER_WEIGHT = 0.2  # above which another mode is drawn
# other modes on the summary of a single frame, at most, and their least weight
ALTERNATIVES = 3
MIN_WEIGHT = 0.05
BORDER = 6  # pixels around a lost frame
LINE_HEIGHT = 22  # pixels from one line to the next
# a curve ends at twice what nine in ten frames have at most; what is above is a peak
PEAK = 2.0
PEAK_QUANTILE = 0.9
MAX_PEAKS = 3  # that are named


class Painter:
    """Paints frame after frame; keeps small stills of a few of them for the summary, of those that are `usable`."""

    def __init__(self, scene: Scene, usable: Sequence[bool] = ()) -> None:
        self._scene = scene
        # as many columns of cameras as rows, or one more
        self._columns = math.ceil(math.sqrt(len(scene.cameras)))
        self._panel = PANEL // math.ceil(len(scene.cameras) / self._columns)
        widths = [
            panel_size(camera.width, camera.height, self._panel)[0]
            for camera in scene.cameras
        ]
        # even, as a video's width has to be
        self._widest = max(*widths, MIN_OVERLAY // self._columns // 2 * 2)
        shown = np.flatnonzero(usable) if any(usable) else np.arange(scene.count)
        self._wanted = np.unique(
            shown[np.linspace(0, len(shown) - 1, SUMMARY_STILLS).round().astype(int)]
        ).tolist()
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
        """Return the picture (height, width, 3) of a frame: on what was `filmed`, or on the masks.

        `radii` (levels, 27) are those of its joints' intervals, where it has a posterior.
        """
        skeleton = self._scene.body.skeleton
        solid = None if radii is None else opacities(radii[MAIN_LEVEL])
        other = other_mode(skeleton, frame.modes, frame.pose, MIN_OTHER_WEIGHT)
        image = self._panels(frame, observation, filmed, solid, other)
        others = (
            other_modes(skeleton, frame.modes, frame.pose)
            if self._scene.count == 1
            else []
        )
        if self._count in self._wanted:
            weight = sum(mode.weight for mode in frame.modes) - sum(
                mode.weight for mode in others
            )
            self._stills.append(
                self._still(image, row, f", {100.0 * weight:.0f} %" if others else "")
            )
        for mode in [mode for mode in others if mode.weight > MIN_WEIGHT][
            :ALTERNATIVES
        ]:
            alternative = replace(frame, pose=mode.pose, translation=mode.translation)
            still = self._panels(alternative, observation, filmed)
            self._stills.append(
                _labelled(still, f"or this, {100.0 * mode.weight:.0f} %")
            )
        label = [
            f"frame {self._scene.first + self._count}",
            f"cost {row['cost']:.2f}",
            f"IoU {row['iou']:.3f}",
        ]
        label += (
            [f"error {row['error_degrees']:.2f} deg"] if "error_degrees" in row else []
        )
        label += [] if observation.usable else ["pose held"]
        image[:LABEL_HEIGHT] //= 4  # so that the label stands out from a bright sky
        write(image, "   ".join(label), (12, 26))
        side_column = image.shape[1] - PANEL + 12
        write(image, "from the camera's right", (side_column, 26))
        if filmed is None or len(self._scene.cameras) > 1:
            _write_legend(image, PANEL - 14)
        lost = row["lost"] >= LOST
        notes = [("lost", MISSED)] if lost else []
        notes += (
            [("left and right unknown", OTHER)] if row["unknown_sides"] == 1.0 else []
        )
        notes += (
            [(f"thin: may be this, {100.0 * other.weight:.0f} %", OTHER)]
            if other is not None
            else []
        )
        for k, (words, colour) in enumerate(reversed(notes)):
            write(image, words, (side_column, PANEL - 14 - LINE_HEIGHT * k), colour)
        if lost:
            _draw_border(image, BORDER)
        self._count += 1
        return image

    def _panels(
        self,
        frame: Frame,
        observation: Observation,
        filmed: Image | None,
        solid: Array | None = None,
        other: Mode | None = None,
    ) -> Image:
        """Return the `overlay` of a frame, and to its right the body viewed from its side."""
        body = self._scene.body
        pose = frame.pose
        place = frame.translation
        camera = side_camera(body, self._scene.cameras[0], pose, place, PANEL)
        side = blank(PANEL, PANEL)
        draw_body(side, body, camera, pose, place, solid)
        if other is not None:
            draw_bones(side, body, camera, other.pose, other.translation, OTHER)
        return np.hstack([self.overlay(frame, observation, filmed, solid, other), side])

    def _still(self, image: Image, row: Row, weight: str) -> Image:
        """Return a small picture whose words, with the `weight` of its pose, can be read in a page."""
        worth = (
            f"error {row['error_degrees']:.1f} deg"
            if "error_degrees" in row
            else f"cost {row['cost']:.1f}"
        )
        label = f"frame {self._scene.first + self._count}, {worth}{weight}"
        return _labelled(image, label, row["lost"] >= LOST)

    def overlay(
        self,
        frame: Frame,
        observation: Observation,
        filmed: Image | None,
        solid: Array | None = None,
        other: Mode | None = None,
    ) -> Image:
        """Return the body on what was `filmed` by the first camera, and on the masks of the others: (height, width, 3).

        On masks its bones show which side is left.
        """
        body = self._scene.body
        pose = frame.pose
        place = frame.translation
        height = self._panel
        panels = []
        for number, camera in enumerate(self._scene.cameras):
            if filmed is not None and number == 0:
                drawn = filmed.copy()
                draw_body(drawn, body, camera, pose, place, solid)
                panel = panel_of(
                    np.asarray(
                        cv2.addWeighted(drawn, SOLID, filmed, 1.0 - SOLID, 0.0),
                        np.uint8,
                    ),
                    height,
                )
                zoomed = _zoomed(camera, panel)
            else:
                mask = observation.silhouettes[number].mask
                fitted = project(body, camera, pose, place)
                panel = OVERLAP[
                    panel_of(
                        mask.view(np.uint8) + 2 * fitted.view(np.uint8),
                        height,
                        sharp=True,
                    )
                ]
                zoomed = _zoomed(camera, panel)
                if solid is not None:
                    share = solid_map(body, zoomed, pose, place, solid)
                    faint = share < 1.0
                    share = share[share < 1.0, None]
                    panel[faint] = share * panel[faint] + (1.0 - share) * np.array(
                        BACKGROUND
                    )
                draw_bones(panel, body, zoomed, pose, place)
            if other is not None:
                draw_bones(panel, body, zoomed, other.pose, other.translation, OTHER)
            panels.append(panel)
        panels = [_padded(panel, self._widest, height) for panel in panels]
        grid = _grid(panels, self._columns, 0)
        # the rows of seven or more do not fill the height
        return _padded(grid, grid.shape[1], PANEL)

    def summary(self, table: Table, notes: Sequence[str] = ()) -> Image:
        """Return notes and stills, above a curve of a track's error, or of its cost where truth is unknown."""
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
        return np.vstack(
            [
                *parts,
                curve(
                    table[name], name.replace("_", " "), width, 180, self._scene.first
                ),
            ]
        )


def _labelled(image: Image, label: str, lost: bool = False) -> Image:
    """Return a picture at half its size below a label."""
    still = np.asarray(
        cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8
    )
    if lost:
        _draw_border(still, BORDER // 2)
    head = blank(LABEL_HEIGHT, still.shape[1])
    write(head, label, (12, 26), scale=SUMMARY_SCALE)
    return np.vstack([head, still])


def _draw_border(image: Image, width: int) -> None:
    # OpenCV's own thick lines are a pixel wider
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
    """Return the size, of an even width, at which a picture of some size fits into panels of some height."""
    even = 2 * round(width * panel / height / 2)
    widest = MAX_ASPECT * panel
    if even > widest:
        return widest, max(round(height * widest / width), 1)
    return max(even, 2), panel


def panel_of(image: Image, height: int, sharp: bool = False) -> Image:
    """Return a picture in a `panel_size`; a sharp one has no values between its own."""
    size = panel_size(image.shape[1], image.shape[0], height)
    how = (
        cv2.INTER_NEAREST
        if sharp
        else cv2.INTER_AREA
        if size[1] < image.shape[0]
        else cv2.INTER_LINEAR
    )
    return np.asarray(cv2.resize(image, size, interpolation=how), dtype=np.uint8)


def _zoomed(camera: Camera, panel: Image) -> Camera:
    """Return a camera that sees the same in a panel."""
    height, width = panel.shape[:2]
    zoom = np.array([width / camera.width, height / camera.height])
    # whole pixels may take a camera beyond the longest or the shortest lens
    shortest, longest = np.multiply(FOCALS, max(width, height))
    return replace(
        camera,
        width=width,
        height=height,
        focal=np.clip(zoom * camera.focal, shortest, longest),
        centre=zoom * camera.centre,
    )


def _padded(image: Image, width: int, height: int) -> Image:
    """Return a picture with black to its right and below it, of some size."""
    right = width - image.shape[1]
    below = height - image.shape[0]
    return np.pad(image, ((0, below), (0, right), (0, 0)))


def _grid(panels: list[Image], columns: int, background: int) -> Image:
    panels = panels + [np.full_like(panels[0], background)] * (-len(panels) % columns)
    return np.vstack(
        [np.hstack(panels[k : k + columns]) for k in range(0, len(panels), columns)]
    )


def curve(values: Array, name: str, width: int, height: int, first: int = 0) -> Image:
    """Return a plot (height, width, 3) of values (T,), one a frame, from 0 up; peaks above its top are named."""
    image = blank(height, width)
    left = 66
    right = width - 16
    limit = PEAK * float(np.quantile(values, PEAK_QUANTILE))
    # one a run of frames, the highest first
    peaks = sorted(
        (
            start + int(values[start:stop].argmax())
            for start, stop in runs(values > limit)
        ),
        key=lambda k: -values[k],
    )
    top = limit if peaks and limit > 0.0 else float(values.max())
    scale = (height - 56) / (max(top, 1e-9) * 1.15)
    for lines, level in enumerate((0.0, float(np.mean(values)), top)):
        row = int(height - 24 - level * scale)
        cv2.line(image, (left, row), (right, row), LINES, 1)
        write(
            image,
            f"{level:.2f}",
            (8, min(row, height - 24 - lines * LINE_HEIGHT) + 6),
            scale=SUMMARY_SCALE - 0.1,
        )
    x = np.linspace(left, right, max(len(values), 2))[: len(values)]
    points = np.rint(
        np.column_stack([x, height - 24 - scale * np.minimum(values, 1.1 * top)]) * 16
    ).astype(np.int32)
    cv2.polylines(image, [points], False, BOTH, 2, cv2.LINE_AA, 4)
    words = "mean and maximum"
    if top == limit:
        named = ", ".join(
            f"{values[k]:.1f} in frame {first + k}" for k in peaks[:MAX_PEAKS]
        )
        more = f" and {len(peaks) - MAX_PEAKS} more" if len(peaks) > MAX_PEAKS else ""
        words = f"mean, and the top; above it {named}{more}"
    write(image, f"{name}, frame by frame: 0, {words}", (left, 20), scale=SUMMARY_SCALE)
    return image
