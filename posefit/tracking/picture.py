"""Pictures of a track: the observed silhouette with the fitted body on it, beside a view of the body from its side.

Where a method says how sure it is, limbs that are unsure are faint, another mode is drawn as thin bones, and lost
frames have a border.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion.steadiness import runs
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.tracking.drawing import (
    BACKGROUND,
    BOTH,
    LINES,
    MISSED,
    OTHER,
    RIGHT,
    SPILLED,
    TEXT,
    draw_body,
    draw_stick,
    opacities,
    side_camera,
    solid_map,
    width_of,
    write,
)
from posefit.tracking.evaluation import LOST
from posefit.uncertainty.calibration import LEVELS
from posefit.uncertainty.modes import Mode, other_mode

PANEL = 480  # pixels high
SUMMARY_STILLS = 6  # frames on the summary
SUMMARY_SCALE = 0.65  # of its words, which a page shows at three quarters of their size
LABEL_HEIGHT = 38  # pixels that the label stands on
SOLID = 0.65  # how much of the footage the body hides
DRAWN_LEVEL = LEVELS.index(0.8)  # the interval that a limb fades by
MIN_OTHER_WEIGHT = 0.2  # above which another mode is drawn
BORDER = 6  # pixels around a lost frame
LINE_HEIGHT = 22  # pixels from one line to the next


class Painter:
    """Paints frame after frame; keeps small stills of a few of them for the summary, of those that are `usable`."""

    def __init__(self, scene: Scene, usable: Sequence[bool] = ()) -> None:
        self._scene = scene
        shown = np.flatnonzero(usable) if any(usable) else np.arange(scene.count)
        self._wanted = np.unique(shown[np.linspace(0, len(shown) - 1, SUMMARY_STILLS).round().astype(int)]).tolist()
        self._stills: list[Image] = []
        self._count = 0

    def add(
        self,
        frame: Frame,
        observation: Observation,
        row: Mapping[str, float],
        filmed: Image | None = None,
        radii: Array | None = None,
    ) -> Image:
        """Return the picture (height, width, 3) of a frame: on what was `filmed`, or on the masks.

        `radii` (levels, 27) are those of its joints' intervals, where it has a posterior.
        """
        body, camera, pose, place = self._scene.body, self._scene.cameras[0], frame.pose, frame.translation
        solid = None if radii is None else opacities(radii[DRAWN_LEVEL])
        other = other_mode(body.skeleton, frame.modes, pose, MIN_OTHER_WEIGHT)
        left = self.overlay(frame, observation, filmed, solid, other)
        width = left.shape[1]
        from_side = side_camera(body, camera, pose, place, PANEL)
        side = np.full((PANEL, PANEL, 3), BACKGROUND, dtype=np.uint8)
        draw_body(side, body, from_side, pose, place, solid)
        self._draw_other(side, from_side, other)
        image = np.hstack([left, side])
        if self._count in self._wanted:
            self._stills.append(self._still(image, row))
        label = [f"frame {self._count}", f"cost {row['cost']:.2f}", f"IoU {row['iou']:.3f}"]
        label += [f"error {row['error_degrees']:.2f} deg"] if "error_degrees" in row else []
        label += [] if observation.usable else ["pose held"]
        image[:LABEL_HEIGHT] //= 4  # so that the label stands out from a bright sky
        write(image, "   ".join(label), (12, 26))
        write(image, "from the camera's right", (width + 12, 26))
        if filmed is None:
            _write_legend(image, PANEL - 14)
        lost = row["lost"] >= LOST
        notes = [("lost", MISSED)] if lost else []
        notes += [("left and right unknown", OTHER)] if row["unknown_sides"] == 1.0 else []
        notes += [(f"thin: may be this, {100.0 * other.weight:.0f} %", OTHER)] if other is not None else []
        for k, (words, colour) in enumerate(reversed(notes)):
            write(image, words, (width + 12, PANEL - 14 - LINE_HEIGHT * k), colour)
        if lost:
            _draw_border(image, BORDER)
        self._count += 1
        return image

    def _still(self, image: Image, row: Mapping[str, float]) -> Image:
        """Return a small picture whose words are large enough to be read in a page."""
        still = np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
        worth = f"error {row['error_degrees']:.1f} deg" if "error_degrees" in row else f"cost {row['cost']:.1f}"
        label = f"frame {self._count}, {worth}"
        still[:LABEL_HEIGHT, : width_of(label, SUMMARY_SCALE) + 24] //= 4
        write(still, label, (12, 26), scale=SUMMARY_SCALE)
        if row["lost"] >= LOST:
            _draw_border(still, BORDER // 2)
        return still

    def overlay(
        self,
        frame: Frame,
        observation: Observation,
        filmed: Image | None,
        solid: Array | None = None,
        other: Mode | None = None,
    ) -> Image:
        """Return the body on what was `filmed`, or on the masks of all cameras, as a picture (height, width, 3)."""
        if filmed is not None:
            drawn, camera = filmed.copy(), self._scene.cameras[0]
            draw_body(drawn, self._scene.body, camera, frame.pose, frame.translation, solid)
            panel = _panel(np.asarray(cv2.addWeighted(drawn, SOLID, filmed, 1.0 - SOLID, 0.0), np.uint8), PANEL)
            self._draw_other(panel, _zoomed(camera, panel), other)
            return panel
        body, panels = self._scene.body, []
        columns = min(2, len(self._scene.cameras))
        height = PANEL // -(-len(self._scene.cameras) // columns)
        for camera, silhouette in zip(self._scene.cameras, observation.silhouettes, strict=True):
            mask, fitted = silhouette.mask, project(body, camera, frame.pose, frame.translation)
            view = np.full((*mask.shape, 3), BACKGROUND, dtype=np.uint8)
            view[mask & ~fitted], view[fitted & ~mask], view[mask & fitted] = MISSED, SPILLED, BOTH
            if solid is not None:
                share = solid_map(body, camera, frame.pose, frame.translation, solid)[..., None]
                view = np.asarray(share * view + (1.0 - share) * np.array(BACKGROUND), np.uint8)
            panel = _panel(view, height, sharp=True)
            self._draw_other(panel, _zoomed(camera, panel), other)
            panels.append(panel)
        wide = max(panel.shape[1] for panel in panels)
        panels = [np.pad(panel, ((0, 0), (0, wide - panel.shape[1]), (0, 0))) for panel in panels]
        return _grid(panels, columns, 0)

    def _draw_other(self, image: Image, camera: Camera, other: Mode | None) -> None:
        if other is not None:
            draw_stick(image, self._scene.body, camera, other.pose, other.translation)

    def summary(
        self, rows: Sequence[Mapping[str, float]], radii: Array | None = None, title: str = "", trust: str = ""
    ) -> Image:
        """Return stills of the track above a curve of its error, or of its cost where there is no truth.

        Where a method says how sure it is, a chart of that stands below: of the radii (T, levels, 27) of the joints'
        intervals, and of `title`, which says in words what was not determined. `trust` is a sentence at the top.
        """
        grid = _grid(self._stills, 2, BACKGROUND[0])
        if self._scene.pictures is None:
            grid = np.vstack([grid, np.full((LABEL_HEIGHT, *grid.shape[1:]), BACKGROUND, np.uint8)])
            _write_legend(grid, grid.shape[0] - 12, SUMMARY_SCALE)
        name, width = "error_degrees" if "error_degrees" in rows[0] else "cost", grid.shape[1]
        parts = [grid, curve([row[name] for row in rows], name.replace("_", " "), width, 180)]
        if trust:
            head = np.full((LABEL_HEIGHT, width, 3), BACKGROUND, dtype=np.uint8)
            write(head, trust, (12, 26), scale=SUMMARY_SCALE * min(1.0, (width - 24) / width_of(trust, SUMMARY_SCALE)))
            parts.insert(0, head)
        if radii is not None or np.isfinite([[row["unknown_sides"], row["lost"]] for row in rows]).any():
            parts.append(certainty_chart(rows, radii, title, width, 240))
        return np.vstack(parts)


def _draw_border(image: Image, width: int) -> None:
    cv2.rectangle(image, (0, 0), (image.shape[1] - 1, image.shape[0] - 1), MISSED, 2 * width - 1)


def _write_legend(image: Image, row: int, scale: float = 0.5) -> None:
    """Write what the colours of an overlay on masks mean."""
    at = 12
    for name, colour in (("both", BOTH), ("observed only", MISSED), ("body only", SPILLED)):
        write(image, name, (at, row), colour, scale)
        at += width_of(name, scale) + 24


def _panel(image: Image, height: int, sharp: bool = False) -> Image:
    width = 2 * round(image.shape[1] * height / image.shape[0] / 2)
    how = cv2.INTER_NEAREST if sharp else cv2.INTER_AREA if height < image.shape[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=how), dtype=np.uint8)


def _zoomed(camera: Camera, panel: Image) -> Camera:
    """Return a camera that sees the same in a panel."""
    height, width = panel.shape[:2]
    zoom = np.array([width / camera.width, height / camera.height])
    return replace(camera, width=width, height=height, focal=zoom * camera.focal, centre=zoom * camera.centre)


def _grid(panels: list[Image], columns: int, background: int) -> Image:
    """Return pictures of one size in one, so many beside each other."""
    panels = panels + [np.full_like(panels[0], background)] * (-len(panels) % columns)
    return np.vstack([np.hstack(panels[k : k + columns]) for k in range(0, len(panels), columns)])


# Charts below the stills: a figure over the frames, and how certain the track is, with marks of frames.
LEFT_MARGIN, RIGHT_MARGIN = 66, 16  # pixels
HEAD, FOOT = 60, 54  # pixels of what is written above, and of the two rows of marks below
MARKS_HEIGHT = 14  # pixels of a row of marks
GRID_STEPS = (5, 10, 20, 50, 100, 200, 500, 1000)  # millimetres between two lines
BAND_STRENGTHS = (0.85, 0.5, 0.25)  # of the bands' colour, the narrowest first
ROOT = JOINTS.index("root")  # which every interval is relative to


def curve(values: Sequence[float], name: str, width: int, height: int) -> Image:
    """Return a plot (height, width, 3) of values, one a frame, from 0 up."""
    image = np.full((height, width, 3), BACKGROUND, dtype=np.uint8)
    top = max(max(values), 1e-9) * 1.15
    x, _ = _columns(len(values), width)
    for level in (0.0, float(np.mean(values)), max(values)):
        _grid_line(image, f"{level:.2f}", int(height - 24 - level / top * (height - 56)))
    _polyline(image, x, height - 24 - np.array(values) / top * (height - 56))
    write(image, f"{name}, frame by frame: 0, mean and maximum", (LEFT_MARGIN, 20), scale=SUMMARY_SCALE)
    return image


def certainty_chart(
    rows: Sequence[Mapping[str, float]], radii: Array | None, title: str, width: int, height: int
) -> Image:
    """Return a chart (height, width, 3) of how far joints may be off, and of which frames are doubtful.

    Bands are the radii (T, levels, 27) of intervals, the mean over joints; where the truth is known, a line is how far
    joints really are off. Rows of marks are frames whose sides are unknown, and lost ones. `title` is written above.
    """
    image = np.full((height, width, 3), BACKGROUND, dtype=np.uint8)
    bottom = height - FOOT
    x, half = _columns(len(rows), width)
    bands = np.empty((len(rows), 0)) if radii is None else 1e3 * np.delete(radii, ROOT, axis=2).mean(axis=2)
    error = np.array([row.get("mpjpe_mm", np.nan) for row in rows])
    values = np.column_stack([error, bands])
    top = 1.05 * max(float(values[np.isfinite(values)].max(initial=0.0)), GRID_STEPS[0])

    def height_of(value: Any) -> Any:
        return bottom - np.asarray(value) / top * (bottom - HEAD)

    for k in reversed(range(bands.shape[1])):
        strength = BAND_STRENGTHS[k]
        colour = tuple(strength * c + (1.0 - strength) * b for c, b in zip(RIGHT, BACKGROUND, strict=True))
        for start, stop in runs(np.isfinite(bands[:, k])):
            frames = np.arange(start, stop)
            ends = np.concatenate([[x[start] - half], x[frames], [x[stop - 1] + half]]).clip(x[0], width - RIGHT_MARGIN)
            heights = height_of(bands[[start, *frames, stop - 1], k])
            edge = [*zip(ends, heights, strict=True), (ends[-1], bottom), (ends[0], bottom)]
            cv2.fillPoly(image, [np.rint(np.array(edge) * 16).astype(np.int32)], colour, cv2.LINE_AA, 4)
    step = next((step for step in GRID_STEPS if top / step <= 4.0), GRID_STEPS[-1])
    for level in range(0, int(top) + 1, step):
        _grid_line(image, f"{level}", int(height_of(level)))
    error_known = bool(np.isfinite(error).all())
    if error_known:
        _polyline(image, x, height_of(error))
    marks = (("unknown_sides", "sides", 1.0, OTHER), ("lost", "lost", LOST, MISSED))
    for k, (name, label, least, colour) in enumerate(marks):
        row = bottom + 8 + k * (MARKS_HEIGHT + 6)
        cv2.rectangle(image, (LEFT_MARGIN, row), (width - RIGHT_MARGIN, row + MARKS_HEIGHT), LINES, 1)
        for at in x[np.array([values[name] >= least for values in rows])]:
            left, right = (
                np.rint(np.clip([at - half, at + half], LEFT_MARGIN, width - RIGHT_MARGIN)).astype(int).tolist()
            )
            cv2.rectangle(image, (left, row), (right, row + MARKS_HEIGHT), colour, -1)
        write(image, label, (8, row + MARKS_HEIGHT), colour, SUMMARY_SCALE - 0.1)
    write(image, title or "nothing is reported as unknown or lost", (LEFT_MARGIN, 20), scale=SUMMARY_SCALE)
    levels = ", ".join(f"{100 * level:.0f}" for level in LEVELS)
    legend = [("mm, the mean over joints:", TEXT)] if radii is not None or error_known else []
    legend += [(f"intervals of {levels} %", RIGHT)] if radii is not None else []
    legend += [("true error", BOTH)] if error_known else []
    at = LEFT_MARGIN
    for word, colour in [*legend, ("left and right unknown", OTHER), ("lost", MISSED)]:
        write(image, word, (at, 44), colour, SUMMARY_SCALE)
        at += width_of(word, SUMMARY_SCALE) + 18
    return image


def _columns(count: int, width: int) -> tuple[Array, float]:
    """Return where frames stand from left to right (count,), and half of what is between two."""
    x = np.linspace(LEFT_MARGIN, width - RIGHT_MARGIN, max(count, 2))[:count]
    return x, 0.5 * (width - RIGHT_MARGIN - LEFT_MARGIN) / max(count - 1, 1)


def _grid_line(image: Image, label: str, row: int) -> None:
    cv2.line(image, (LEFT_MARGIN, row), (image.shape[1] - RIGHT_MARGIN, row), LINES, 1)
    write(image, label, (8, row + 6), scale=SUMMARY_SCALE - 0.1)


def _polyline(image: Image, x: Array, y: Array) -> None:
    points = np.rint(np.column_stack([x, y]) * 16).astype(np.int32)
    cv2.polylines(image, [points], False, BOTH, 2, cv2.LINE_AA, 4)
