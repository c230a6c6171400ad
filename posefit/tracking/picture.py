"""Pictures of a track: the observed silhouette with the fitted body on it, beside a view of the body from its side.

Where a method says how sure it is, limbs that are unsure are faint, another mode is drawn as thin bones, and lost
frames have a border.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation
from posefit.footage.scene import Scene
from posefit.geometry.camera import Camera
from posefit.silhouette.cost import project
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Mask
from posefit.tracking.drawing.body import draw_body, draw_stick, opacities, side_camera, side_view, solid_map
from posefit.tracking.drawing.chart import curve, doubts, says_doubts
from posefit.tracking.drawing.colours import BACKGROUND, BOTH, MISSED, OTHER, SPILLED, width_of, write
from posefit.tracking.evaluation import LOST
from posefit.uncertainty.calibration import LEVELS
from posefit.uncertainty.modes import Mode, other_mode

PANEL = 480  # pixels high
STILLS = 6  # frames on the summary
BAND = 38  # pixels that the label stands on
SOLID = 0.65  # how much of what was filmed the body hides
DRAWN = LEVELS.index(0.8)  # the interval that a limb fades by
LIKELY = 0.2  # above which another mode is drawn
BORDER = 6  # pixels around a lost frame
LINE = 22  # pixels from one line to the next


class Painter:
    """Paints frame after frame; keeps small stills of a few of them for the summary, of those that are `usable`."""

    def __init__(self, scene: Scene, usable: Sequence[bool] = ()) -> None:
        self._scene = scene
        shown = np.flatnonzero(usable) if any(usable) else np.arange(scene.count)
        self._wanted = np.unique(shown[np.linspace(0, len(shown) - 1, STILLS).round().astype(int)]).tolist()
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
        body, cameras = self._scene.body, self._scene.cameras
        solid = None if radii is None else opacities(radii[DRAWN])
        other = other_mode(body.skeleton, frame.modes, frame.pose, LIKELY)
        if filmed is None:
            left = self._seen(frame, observation, solid, other)
        else:
            drawn = filmed.copy()
            draw_body(drawn, body, cameras[0], frame.pose, frame.translation, solid)
            left = _panel(np.asarray(cv2.addWeighted(drawn, SOLID, filmed, 1.0 - SOLID, 0.0), np.uint8), PANEL)
            if other is not None:
                draw_stick(left, body, _zoomed(cameras[0], left), other.pose, other.translation)
        width = left.shape[1]
        side = side_view(body, cameras[0], frame.pose, frame.translation, PANEL, solid)
        if other is not None:
            camera = side_camera(body, cameras[0], frame.pose, frame.translation, PANEL)
            draw_stick(side, body, camera, other.pose, other.translation)
        image = np.hstack([left, side])
        label = "   ".join(
            [f"frame {self._count}", f"cost {row['cost']:.2f}", f"IoU {row['iou']:.3f}"]
            + ([f"error {row['error_degrees']:.2f} deg"] if "error_degrees" in row else [])
            + ([] if observation.usable else ["pose held"])
        )
        image[:BAND] //= 4  # so that the label stands out from a bright sky
        write(image, label, (12, 26))
        write(image, "from the camera's right", (width + 12, 26))
        if filmed is None:
            for k, (name, colour) in enumerate((("both", BOTH), ("observed only", MISSED), ("body only", SPILLED))):
                write(image, name, (12 + 130 * k, PANEL - 14), colour)
        lost = row["lost"] >= LOST
        said = [("lost", MISSED)] if lost else []
        said += [("left and right unknown", OTHER)] if row["unknown_sides"] == 1.0 else []
        said += [(f"thin: may be this, {100.0 * other.weight:.0f} %", OTHER)] if other is not None else []
        for k, (words, colour) in enumerate(reversed(said)):
            write(image, words, (width + 12, PANEL - 14 - LINE * k), colour)
        if lost:
            cv2.rectangle(image, (0, 0), (image.shape[1] - 1, PANEL - 1), MISSED, 2 * BORDER - 1)
        if self._count in self._wanted:
            self._stills.append(
                np.asarray(cv2.resize(image, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA), np.uint8)
            )
        self._count += 1
        return image

    def _seen(self, frame: Frame, observation: Observation, solid: Array | None, other: Mode | None) -> Image:
        """Return the masks of all cameras with the body on them."""
        body, panels = self._scene.body, []
        columns = min(2, len(self._scene.cameras))
        height = PANEL // -(-len(self._scene.cameras) // columns)
        for camera, silhouette in zip(self._scene.cameras, observation.silhouettes, strict=True):
            view = _overlay(silhouette.mask, project(body, camera, frame.pose, frame.translation))
            if solid is not None:
                share = solid_map(body, camera, frame.pose, frame.translation, solid)[..., None]
                view = np.asarray(share * view + (1.0 - share) * np.array(BACKGROUND), np.uint8)
            panel = _panel(view, height, sharp=True)
            if other is not None:
                draw_stick(panel, body, _zoomed(camera, panel), other.pose, other.translation)
            panels.append(panel)
        return _grid(panels, columns)

    def summary(
        self, rows: Sequence[Mapping[str, float]], radii: Array | None = None, title: str = "", trust: str = ""
    ) -> Image:
        """Return stills of the track above a curve of its error, or of its cost where there is no truth.

        Where a method says how sure it is, a chart of that stands below: of the radii (T, levels, 27) of the joints'
        intervals, and of `title`, which says in words what was not determined. `trust` is a sentence at the top.
        """
        stills = self._stills + [np.full_like(self._stills[0], BACKGROUND[0])] * (-len(self._stills) % 3)
        grid = np.vstack([np.hstack(stills[k : k + 3]) for k in range(0, len(stills), 3)])
        name, width = "error_degrees" if "error_degrees" in rows[0] else "cost", grid.shape[1]
        parts = [] if not trust else [_headed(trust, width)]
        parts += [grid, curve([row[name] for row in rows], name.replace("_", " "), width, 160)]
        if says_doubts(rows, radii):
            parts.append(doubts(rows, radii, title, width, 240))
        return np.vstack(parts)


def _headed(text: str, width: int) -> Image:
    """Return a line of text as wide as a picture."""
    line = np.full((BAND, width, 3), BACKGROUND, dtype=np.uint8)
    write(line, text, (12, 26), scale=min(0.6, 0.6 * (width - 24) / width_of(text, 0.6)))
    return line


def _overlay(mask: Mask, fitted: Mask) -> Image:
    overlay = np.full((*mask.shape, 3), BACKGROUND, dtype=np.uint8)
    overlay[mask & ~fitted], overlay[fitted & ~mask], overlay[mask & fitted] = MISSED, SPILLED, BOTH
    return overlay


def _panel(image: Image, height: int, sharp: bool = False) -> Image:
    width = 2 * round(image.shape[1] * height / image.shape[0] / 2)
    how = cv2.INTER_NEAREST if sharp else cv2.INTER_AREA if height < image.shape[0] else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(image, (width, height), interpolation=how), dtype=np.uint8)


def _zoomed(camera: Camera, panel: Image) -> Camera:
    """Return a camera that sees the same in a panel."""
    height, width = panel.shape[:2]
    zoom = np.array([width / camera.width, height / camera.height])
    return replace(camera, width=width, height=height, focal=zoom * camera.focal, centre=zoom * camera.centre)


def _grid(panels: list[Image], columns: int) -> Image:
    """Return the views of all cameras in one, so many beside each other."""
    wide = max(panel.shape[1] for panel in panels)
    panels = [np.pad(panel, ((0, 0), (0, wide - panel.shape[1]), (0, 0))) for panel in panels]
    panels += [np.zeros_like(panels[0])] * (-len(panels) % columns)
    return np.vstack([np.hstack(panels[k : k + columns]) for k in range(0, len(panels), columns)])
