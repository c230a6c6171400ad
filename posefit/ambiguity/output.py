"""The results of `posefit ambiguity`: the printed table, the JSON summary and the picture."""

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.ambiguity.estimate import YAWS, Ambiguity, Floor
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import JOINTS
from posefit.geometry.symmetry import facing
from posefit.measuring.centres import PLACES
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette
from posefit.tracking.drawing import BOTH, MISSED, SPILLED, TEXT, blank, draw_body, side_view, write
from posefit.tracking.picture import SOLID
from posefit.version import __version__

MIN_POSES = 10  # the spread of fewer depends more on the library than on the silhouette
MAX_LINES = 8  # clusters printed one a line
WIDEST = 3  # joints named


def summary_of(result: Ambiguity) -> dict[str, Any]:
    """Return everything as `--json` prints it: weights, millimetres and degrees."""
    return {
        "source": result.scene.name,
        "frame": result.frame,
        "within": result.within,
        "temperature": result.temperature,
        "translation": result.problem.space.translation,
        "views": len(result.problem.cameras),
        "library": {"clips": len({pose.clip for pose in result.library}), "poses": len(result.library), "yaws": YAWS},
        "similar": len(result.states),
        "least_cost": float(result.states.costs.min()),
        "modes": [_mode(result, k) for k in range(len(result.clusters))],
        "floor": [
            {
                "views": floor.views,
                "similar": floor.count,
                "least_cost": floor.least,
                "spread_mm": floor.spread_mm,
                "joints_mm": dict(zip(JOINTS, floor.joints_mm.tolist(), strict=True)),
            }
            for floor in result.floors
        ],
        "seconds": result.seconds,
        "warnings": list(result.scene.warnings),
        "version": __version__,
    }


def ambiguity_table(result: Ambiguity) -> str:
    """Return the lines that `posefit ambiguity` prints."""
    count, similar = len(result.library), len(result.states)
    lines = [
        f"{result.scene.name}, frame {result.frame}: {count:,} poses of the library at {YAWS} yaws, compared in "
        f"{result.seconds:.1f} s",
        f"{similar:,} cost at most {result.within:g} more than the least, {result.states.costs.min():.2f}, in "
        f"{len(result.clusters)} {'mode' if len(result.clusters) == 1 else 'modes'}",
    ]
    known = result.truth_mm is not None
    lines.append(
        f"{'weight':>6} {'spread mm':>9} {'from first mm':>13} "
        + (f"{'from truth mm':>13} " if known else "")
        + f"{'yaw deg':>7} {'view deg':>13}  {'image':9}  example"
    )
    for k in range(min(MAX_LINES, len(result.clusters))):
        mode = _mode(result, k)
        clip = f"{mode['clip']} frame {mode['clip_frame']}{', mirrored' if mode['clip_mirrored'] else ''}"
        lines.append(
            f"{mode['weight']:6.2f} {mode['spread_mm']:9.0f} {mode['away_mm']:13.0f} "
            + (f"{mode['truth_mm']:13.0f} " if known else "")
            + f"{mode['yaw_degrees']:7.0f} {mode['view_degrees']:13.0f}  {mode['image'] or '-':9}  {clip}"
        )
    if more := result.clusters[MAX_LINES:]:
        lines.append(f"{sum(cluster.weight for cluster in more):6.2f} in {len(more)} more")
    lines.append("spread of poses that cannot be distinguished, mm:")
    for floor in result.floors:
        spreads = by_kind(floor.joints_mm)
        widest = sorted(spreads, key=lambda name: -spreads[name])[:WIDEST]
        joints = ", ".join(f"{name} {spreads[name]:.0f}" for name in widest)
        lines.append(f"{floor.spread_mm:6.0f}  by {floor.views}: {joints}; {floor.count:,} poses")
    if min(floor.count for floor in result.floors) < MIN_POSES:
        lines.append(
            f"fewer than {MIN_POSES} poses depend more on the library than on the silhouette: try a larger --within"
        )
    return "\n".join(lines)


def by_kind(joints_mm: Any) -> dict[str, float]:
    """Return the spreads (27,) by place on the body: the root mean square of left and right."""
    squares: dict[str, list[float]] = {}
    for name, value in zip(PLACES[1:], joints_mm[1:], strict=True):
        squares.setdefault(name.removeprefix("left_").removeprefix("right_"), []).append(float(value) ** 2)
    return {name: float(np.sqrt(np.mean(values))) for name, values in squares.items()}


def _mode(result: Ambiguity, k: int) -> dict[str, Any]:
    cluster, states, poses = result.clusters[k], result.states, result.states.posterior
    origin, yaw = result.library[int(states.rows[cluster.best])], float(poses.poses[cluster.best, 0])
    towards = facing(result.problem.cameras[0], poses.translations[cluster.best])
    return {
        "weight": cluster.weight,
        "poses": len(cluster.members),
        "spread_mm": cluster.spread_mm,
        "away_mm": cluster.away_mm,
        **({} if result.truth_mm is None else {"truth_mm": result.truth_mm[k]}),
        "yaw_degrees": float(np.degrees(yaw)),
        "view_degrees": float(np.degrees(wrapped(np.array(towards - yaw)))),
        "image": cluster.image or None,
        "cost": float(states.costs[cluster.best]),
        "clip": origin.clip,
        "clip_frame": origin.frame,
        "clip_mirrored": origin.mirrored,
    }


MAX_COLUMNS = 5  # clusters drawn
MIN_COLUMNS = 3  # so that the text fits
WIDTH, HEIGHT, BAND = 260, 320, 62  # pixels of a view, and of the text above the first
MARGIN = 1.15  # the view is this much larger than the silhouette's box
GREY = (120, 112, 108)  # the silhouette
BARS = (BOTH, SPILLED, MISSED, (205, 205, 205), (225, 165, 85))  # one a floor, then the first again
TITLE, LINE, LEGEND = 34, 20, 22  # pixels high
LABEL, FIGURE = 110, 38  # pixels wide
NUMBERED = 4  # floors whose numbers are written beside their bars


def picture_of(result: Ambiguity) -> Image:
    """Return the picture (height, width, 3)."""
    count = min(len(result.clusters), MAX_COLUMNS)
    camera, silhouette = nearer(result.problem.cameras[0], result.problem.silhouettes[0])
    columns = [_column(result, k, camera, silhouette) for k in range(count)]
    columns += [blank(len(columns[0]), WIDTH)] * (MIN_COLUMNS - count)
    bodies = np.hstack(columns)
    title, rest = blank(TITLE, bodies.shape[1]), len(result.clusters) - count
    heading = f"{result.scene.name}, frame {result.frame}: {len(result.states):,} poses within {result.within:g}"
    write(title, f"{heading} of the least" + (f", {rest} more modes" if rest else ""), (12, 23))
    return np.vstack([title, bodies, floors_of(result.floors, bodies.shape[1])])


def nearer(camera: Camera, silhouette: Silhouette) -> tuple[Camera, Image]:
    """Return the camera cropped to the person, and the silhouette as it shows it (height, width)."""
    left, top, wide, high = cv2.boundingRect(silhouette.mask.astype(np.uint8))
    middle = np.array([left + 0.5 * wide, top + 0.5 * high])
    zoom = min(WIDTH / wide, HEIGHT / high) / MARGIN
    shift = np.array([WIDTH, HEIGHT]) / 2.0 - zoom * middle
    near = replace(camera, width=WIDTH, height=HEIGHT, focal=camera.focal * zoom, centre=camera.centre * zoom + shift)
    # pixel centres are at +0.5 here, and at whole numbers in OpenCV
    matrix = np.column_stack([zoom * np.eye(2), shift + 0.5 * zoom - 0.5])
    crop = cv2.warpAffine(silhouette.mask.astype(np.uint8), matrix, (WIDTH, HEIGHT), flags=cv2.INTER_NEAREST)
    return near, np.asarray(crop, np.uint8)


def _column(result: Ambiguity, k: int, camera: Camera, silhouette: Image) -> Image:
    """Return the column of a cluster: text, body before the silhouette, body from the side."""
    cluster, body = result.clusters[k], result.problem.body
    states = result.states.posterior
    pose, place = states.poses[cluster.best], states.translations[cluster.best]
    head = blank(BAND, WIDTH)
    write(head, f"{cluster.weight:.2f}", (12, 26), scale=0.75)
    write(head, cluster.image or ("first" if k == 0 else ""), (90, 26))
    away = f", {cluster.away_mm:.0f} from first" if k else ""
    write(head, f"spread {cluster.spread_mm:.0f} mm{away}", (12, 50), scale=0.42)
    front = blank(HEIGHT, WIDTH)
    front[silhouette > 0] = GREY
    drawn = front.copy()
    draw_body(drawn, body, camera, pose, place)
    front = np.asarray(cv2.addWeighted(drawn, SOLID, front, 1.0 - SOLID, 0.0), np.uint8)
    edges, _ = cv2.findContours(silhouette, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(front, edges, -1, TEXT, 1, cv2.LINE_AA)
    side = side_view(body, result.problem.cameras[0], pose, place, WIDTH)
    write(front, "from the camera", (8, HEIGHT - 10), scale=0.4)
    write(side, "from its right", (8, WIDTH - 10), scale=0.4)
    column = np.vstack([head, front, side])
    column[:, -1] = GREY
    return column


def floors_of(floors: Sequence[Floor], width: int) -> Image:
    """Return bars of each joint's spread, one a set of cameras (height, width, 3)."""
    spreads = [by_kind(floor.joints_mm) for floor in floors]
    names, shown = list(spreads[0]), min(len(floors), NUMBERED)
    longest = width - LABEL - FIGURE * shown - 20
    bar = max(LINE // len(floors) - 1, 3)
    row = len(floors) * bar + 5
    image = blank(LEGEND * (len(floors) + 1) + 20 + row * len(names), width)
    write(image, "spread of poses that cannot be distinguished, mm", (12, 20))
    for k, floor in enumerate(floors):
        label = f"{floor.spread_mm:.0f}  by {floor.views}, {floor.count:,} poses"
        write(image, label, (12, 20 + LEGEND * (k + 1)), BARS[k % len(BARS)])
    top = LEGEND * (len(floors) + 1) + 10
    most = max(*(value for spread in spreads for value in spread.values()), 1e-9)
    for n, name in enumerate(names):
        y = top + n * row
        write(image, name, (12, y + row - 6), scale=0.4)
        for k, spread in enumerate(spreads):
            end = LABEL + round(longest * spread[name] / most)
            cv2.rectangle(image, (LABEL, y + k * bar), (end, y + (k + 1) * bar - 2), BARS[k % len(BARS)], -1)
            if k < NUMBERED:
                write(image, f"{spread[name]:4.0f}", (width - FIGURE * (shown - k) - 6, y + row - 6), scale=0.4)
    return image


FILES = ("ambiguity.json", "ambiguity.png")


def write_result(folder: Path, result: Ambiguity) -> None:
    """Write a result's numbers and its picture to a folder. Raises OSError where there is no room."""
    text, picture = FILES
    (folder / text).write_text(json.dumps(summary_of(result), indent=1) + "\n", encoding="utf-8")
    if not cv2.imwrite(str(folder / picture), picture_of(result)):
        raise OSError(f"no room for {picture}")
