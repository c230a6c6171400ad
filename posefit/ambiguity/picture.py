"""The picture of `posefit ambiguity`: a body of each cluster from the camera and from the side, and the floor below."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from posefit.ambiguity.run import Ambiguity, Floor
from posefit.ambiguity.table import by_kind
from posefit.geometry.camera import Camera
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette
from posefit.tracking.drawing.body import draw_body, side_view
from posefit.tracking.drawing.colours import BACKGROUND, BOTH, MISSED, SPILLED, TEXT, write
from posefit.tracking.picture import SOLID

SHOWN = 5  # clusters
FEWEST = 3  # columns that the picture is wide, for what is written on it
WIDTH, HEIGHT, BAND = 260, 320, 62  # pixels of a view, and of what is written above the first
AROUND = 1.15  # the silhouette's box, times this, is seen
GREY = (120, 112, 108)  # what was seen
BARS = (BOTH, SPILLED, MISSED, (205, 205, 205), (225, 165, 85))  # one a floor, then the first again
TITLE, LINE, LEGEND = 34, 20, 22  # pixels high
LABEL, FIGURE = 110, 38  # pixels wide
NUMBERED = 4  # floors whose numbers are written beside their bars


def picture_of(found: Ambiguity) -> Image:
    """Return the picture (height, width, 3)."""
    shown = found.clusters[:SHOWN]
    camera, silhouette = nearer(found.moment.cameras[0], found.moment.silhouettes[0])
    columns = [_column(found, k, camera, silhouette) for k in range(len(shown))]
    columns += [_blank(len(columns[0]), WIDTH)] * (FEWEST - len(columns))
    bodies = np.hstack(columns)
    title = _blank(TITLE, bodies.shape[1])
    told = f"{found.scene.name}, frame {found.frame}: {len(found.states):,} poses within {found.within:g} of the least"
    rest = len(found.clusters) - len(shown)
    write(title, f"{told}, {rest} more modes" if rest else told, (12, 23))
    return np.vstack([title, bodies, floors_of(found.floors, bodies.shape[1])])


def nearer(camera: Camera, silhouette: Silhouette) -> tuple[Camera, Image]:
    """Return a camera that sees nothing but the person, in a panel, and what was seen of him there (height, width)."""
    left, top, wide, high = cv2.boundingRect(silhouette.mask.astype(np.uint8))
    middle = np.array([left + 0.5 * wide, top + 0.5 * high])
    zoom = min(WIDTH / wide, HEIGHT / high) / AROUND
    shift = np.array([WIDTH, HEIGHT]) / 2.0 - zoom * middle
    near = replace(camera, width=WIDTH, height=HEIGHT, focal=camera.focal * zoom, centre=camera.centre * zoom + shift)
    # pixel centres are at +0.5 here, and at whole numbers in OpenCV
    matrix = np.column_stack([zoom * np.eye(2), shift + 0.5 * zoom - 0.5])
    seen = cv2.warpAffine(silhouette.mask.astype(np.uint8), matrix, (WIDTH, HEIGHT), flags=cv2.INTER_NEAREST)
    return near, np.asarray(seen, np.uint8)


def _column(found: Ambiguity, k: int, camera: Camera, silhouette: Image) -> Image:
    """Return what is written of a cluster, its body before the silhouette, and its body from the side."""
    one = found.clusters[k]
    body, pose, place = found.moment.body, found.states.poses[one.best], found.states.translations[one.best]
    head = _blank(BAND, WIDTH)
    write(head, f"{one.weight:.2f}", (12, 26), scale=0.75)
    write(head, one.image or ("first" if k == 0 else ""), (90, 26))
    away = f", {one.away_mm:.0f} from first" if k else ""
    write(head, f"spread {one.spread_mm:.0f} mm{away}", (12, 50), scale=0.42)
    front = _blank(HEIGHT, WIDTH)
    front[silhouette > 0] = GREY
    drawn = front.copy()
    draw_body(drawn, body, camera, pose, place)
    front = np.asarray(cv2.addWeighted(drawn, SOLID, front, 1.0 - SOLID, 0.0), np.uint8)
    edges, _ = cv2.findContours(silhouette, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(front, edges, -1, TEXT, 1, cv2.LINE_AA)
    side = side_view(body, found.moment.cameras[0], pose, place, WIDTH)
    write(front, "from the camera", (8, HEIGHT - 10), scale=0.4)
    write(side, "from its right", (8, WIDTH - 10), scale=0.4)
    column = np.vstack([head, front, side])
    column[:, -1] = GREY
    return column


def floors_of(floors: Sequence[Floor], width: int) -> Image:
    """Return bars of each joint's spread, by one camera and by more (height, width, 3)."""
    spreads = [by_kind(floor.joints_mm) for floor in floors]
    names, shown = list(spreads[0]), min(len(floors), NUMBERED)
    longest = width - LABEL - FIGURE * shown - 20
    bar = max(LINE // len(floors) - 1, 3)
    row = len(floors) * bar + 5
    image = _blank(LEGEND * (len(floors) + 1) + 20 + row * len(names), width)
    write(image, "spread of what cannot be told apart, mm", (12, 20))
    for k, floor in enumerate(floors):
        told = f"{floor.spread_mm:.0f}  by {floor.views}, {floor.count:,} poses"
        write(image, told, (12, 20 + LEGEND * (k + 1)), BARS[k % len(BARS)])
    top = LEGEND * (len(floors) + 1) + 10
    most = max(max(max(one.values()) for one in spreads), 1e-9)
    for n, name in enumerate(names):
        y = top + n * row
        write(image, name, (12, y + row - 6), scale=0.4)
        for k, one in enumerate(spreads):
            end = LABEL + round(longest * one[name] / most)
            cv2.rectangle(image, (LABEL, y + k * bar), (end, y + (k + 1) * bar - 2), BARS[k % len(BARS)], -1)
            if k < NUMBERED:
                write(image, f"{one[name]:4.0f}", (width - FIGURE * (shown - k) - 6, y + row - 6), scale=0.4)
    return image


def _blank(height: int, width: int) -> Image:
    return np.full((height, width, 3), BACKGROUND, dtype=np.uint8)
