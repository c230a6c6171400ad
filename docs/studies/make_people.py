"""Draws frames of people outside the library.

    python docs/studies/make_people.py docs/pictures/people.jpg

A row is a clip of each group of `people.py`, from 45 degrees: the best frame, four of
the film, and the worst.
"""

from typing import Any

import click
import cv2
import numpy as np

from clips import GROUPS, METHOD, SIDES, Clip, cell_fields, track_of
from posefit.arrays import Array
from posefit.output.drawing import BACKGROUND, TEXT, draw_body, write
from posefit.sweep.cell import cell_scene
from posefit.sweep.check import cell_of

STILLS = 4  # stills of the film, between its best and its worst frame
SIDE = 208  # pixels of a still
SILHOUETTE = (150, 150, 150)
SOLID = 0.75  # opacity of the body on the silhouette


def strip(clip: Clip) -> Array:
    """Return stills of a clip's track, a picture (SIDE, SIDE * (STILLS + 2), 3)."""
    cell = cell_of(cell_fields(clip, SIDES[1], clip.frames, method=METHOD))
    scene = cell_scene(cell)
    track = track_of(cell, scene)
    errors = track.table["mpjpe_mm"]
    film = np.linspace(0, len(errors) - 1, STILLS + 2).astype(int)[1:-1]
    named = [
        ("best", errors.argmin()),
        *((f"{k / scene.fps:.1f} s", k) for k in film),
        ("worst", errors.argmax()),
    ]
    stills = []
    for name, k in named:
        mask = scene.observations[int(k)].silhouettes[0].mask
        seen = np.full((*mask.shape, 3), BACKGROUND, np.uint8)
        seen[mask] = SILHOUETTE
        drawn = seen.copy()
        draw_body(
            drawn,
            scene.body,
            scene.cameras[0],
            track.motion.poses[k],
            track.motion.translations[k],
        )
        drawn = cv2.addWeighted(drawn, SOLID, seen, 1.0 - SOLID, 0.0)
        rows, columns = np.nonzero(mask)
        side = int(1.25 * max(int(np.ptp(rows)), int(np.ptp(columns)), 40))
        corner = np.array(
            [np.mean([rows.min(), rows.max()]), np.mean([columns.min(), columns.max()])]
        ).astype(int)
        padded = cv2.copyMakeBorder(
            drawn, side, side, side, side, cv2.BORDER_CONSTANT, value=BACKGROUND
        )
        top, left = corner + side - side // 2
        still: Any = cv2.resize(
            padded[top : top + side, left : left + side],
            (SIDE, SIDE),
            interpolation=cv2.INTER_CUBIC,
        )
        write(still, f"{name}, {errors[k]:.0f} mm", (8, SIDE - 10), TEXT, 0.45)
        stills.append(still)
    write(stills[0], f"{clip.name} {clip.shows.partition(',')[0]}", (8, 18), TEXT, 0.45)
    return np.hstack(stills)


@click.command()
@click.argument("out")
def main(out: str) -> None:
    """Track a clip of each group, and draw it."""
    cv2.imwrite(
        out,
        np.vstack([strip(clips[0]) for clips in GROUPS.values()]),
        [cv2.IMWRITE_JPEG_QUALITY, 85],
    )


if __name__ == "__main__":
    main()
