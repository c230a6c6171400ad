"""Figures 8 and 10 of the SAPSO paper on real footage.

    python docs/studies/footage_figures.py "S1/Image_Data/Walking_1_(C1).avi"
        --height 1.75 --out humaneva

Figure 8 shows poses of single real images, figure 10 a track of 100 frames. Masks come
from a mixture of Gaussians, as in the paper. The paper does not say which frames it
used, or what it knew of camera, body and place. Here the camera is the data set's or a
guess, the place in each image is aligned to the mask, and the first yaw is unknown.

A film's files are found by the layouts of KTH's actions (Schuldt, Laptev and Caputo,
ICPR 2004), HumanEva-I (Sigal, Balan and Black, IJCV 2010) and CMU's motion capture
database, as public readers of these sets expect them. None of the sets may be
redistributed, and none was available here. HumanEva's calibrations are read as in its
own Matlab code.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import click
import cv2
import numpy as np

from posefit.cli.options import EXTRACTION, FRAMES, options, track_flags
from posefit.cli.output import Command
from posefit.cli.tracking import extraction_of
from posefit.errors import InputError
from posefit.files import new_folder
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame
from posefit.footage.agreement import extent_of
from posefit.footage.extraction import Extraction
from posefit.footage.options import SourceOptions
from posefit.footage.scene import Scene
from posefit.footage.source import scene_of
from posefit.footage.video import Video
from posefit.footage.views import Range, span
from posefit.geometry.calibration import Calibration
from posefit.motion.motion import Motion
from posefit.output.drawing import draw_body, write
from posefit.reading import existing, read_text
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette
from posefit.tracking.defaults import completed
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit_reproduce.commands import CLIPS
from posefit_reproduce.experiment import Table
from posefit_reproduce.sapso.experiment import ITERATIONS, estimate_images, options_of
from posefit_reproduce.sapso.methods import LABELS as METHOD_LABELS
from posefit_reproduce.sapso.methods import LETTER, OURS, PAPER
from posefit_reproduce.sapso.motions import paper_motions
from posefit_reproduce.sapso.paper import FRAMES as FRAMES_OF_THE_PAPER

Activity = Literal["walk", "run"]
ACTIVITIES: dict[str, Activity] = {
    "walking": "walk",
    "jogging": "run",
    "jog": "run",
    "running": "run",
}
# the first frames of HumanEva's films are copies of one: a fault of their codec
HUMANEVA_START = 5
MAX_TEXT_BYTES = 1_000_000
MILLIMETRES = 1e3  # in a metre
IMAGES = 6  # number of images that are estimated alone and shown
TALL = 300  # pixels of a picture in a figure
SQUARE = 0.65  # half the side of such a picture, in units of the person's height
SOLID = 0.65  # opacity of the body on the film
SINGLE = "PCA + SAPSO, images"
TRACKED = (*PAPER, LETTER)
LABELS = {SINGLE: SINGLE} | {
    name: f"{METHOD_LABELS[name]}, tracked" for name in TRACKED
}
Estimates = dict[int, Frame]  # the poses of some frames of a scene


@dataclass(frozen=True, eq=False)
class Recording:
    """A film, and what its data set states about it."""

    name: str
    film: Path
    activity: Activity | None = None
    frames: Range = (None, None)  # in which the person is visible
    calibration: Calibration | None = None
    skeleton: Path | None = None  # the person's .asf file


def recording_of(film: Path) -> Recording:
    """Return a film with what its data set states about it.

    A name of no data set gives nothing. Raises InputError if files that belong to the
    film are missing or invalid.
    """
    name = existing(film).stem
    above = film.resolve().parent.parent
    if kth := re.fullmatch(r"(person\d+_(walking|jogging|running)_d\d)_uncomp", name):
        tables = [folder / "00sequences.txt" for folder in (film.parent, above)]
        table = next((table for table in tables if table.is_file()), tables[1])
        return Recording(kth[1], film, ACTIVITIES[kth[2]], _kth_frames(table, kth[1]))
    if humaneva := re.fullmatch(
        r"(?P<trial>(Walking|Jog)_\d+)_\((?P<camera>(C|BW)\d)\)", name
    ):
        camera = humaneva["camera"]
        calibration = read_calibration(
            above / "Calibration_Data" / f"{camera}.cal", Video.of(film).size
        )
        activity = ACTIVITIES[humaneva[2].lower()]
        named = f"{above.name}_{humaneva['trial']}_{camera}"
        return Recording(named, film, activity, (HUMANEVA_START, None), calibration)
    if cmu := re.fullmatch(r"(\d+)_\d+", name):
        return Recording(name, film, skeleton=existing(film.with_name(f"{cmu[1]}.asf")))
    return Recording(name, film)


def _kth_frames(table: Path, name: str) -> Range:
    """Return the first range of frames with the person, from 0 and exclusive.

    The file counts from 1 and includes the last frame.
    """
    text = read_text(existing(table), MAX_TEXT_BYTES)
    line = re.search(rf"^\s*{name}\s+frames\s+(\d+)\s*-\s*(\d+)", text, re.MULTILINE)
    if line is None:
        raise InputError(
            f"{table}: expected a line such as '{name} frames 1-75, 120-190', got none"
        )
    return int(line[1]) - 1, int(line[2])


def read_calibration(path: Path, size: tuple[int, int]) -> Calibration:
    """Return a camera of HumanEva's .cal file for films of a size.

    Its 22 numbers are two focal lengths, two of the principal point, the skew, which is
    ignored, five of the distortion, nine of the rotation row by row and three of the
    translation. Rotation and translation are camera_from_world, in millimetres. Raises
    InputError if the file is invalid.
    """
    words = read_text(existing(path), MAX_TEXT_BYTES).split()
    try:
        values = np.array([float(word) for word in words[:22]])
        rotation = values[10:19].reshape(3, 3)
        valid = (
            np.isfinite(values).all()
            and np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-2
        )
    except ValueError:
        valid = False
    if not valid or len(words) < 22 or min(values[:2]) <= 0.0:
        raise InputError(
            f"{path}: expected 22 numbers: focal lengths, centre, skew, "
            "distortion, rotation, translation"
        )
    matrix = np.array(
        [[values[0], 0.0, values[2]], [0.0, values[1], values[3]], [0.0, 0.0, 1.0]]
    )
    return Calibration(
        path.stem, size, matrix, values[5:10], rotation, values[19:] / MILLIMETRES
    )


def filmed_scene(
    recording: Recording, frames: Range = (None, None), **view: Any
) -> tuple[Scene, int]:
    """Return a film's scene and the number of its first frame.

    The scene has 100 frames, or the chosen ones.
    """
    count = Video.of(recording.film).count()
    start, stop = span(recording.frames if frames == (None, None) else frames, count)
    if frames == (None, None):
        stop = min(stop, start + FRAMES_OF_THE_PAPER)
    camera = () if recording.calibration is None else (recording.calibration,)
    scene = scene_of(
        [recording.film],
        SourceOptions(
            camera=camera, frames=(start, stop), asf=recording.skeleton, **view
        ),
    )
    return replace(scene, name=recording.name), start


def estimates_of(scene: Scene, training: Sequence[Motion]) -> dict[str, Estimates]:
    """Return the poses of all frames by the paper's methods, and of single images.

    Sections 5.3 and 5.4. The first yaw of a track is unknown, with restarts, and so is
    every yaw of an image. As in the paper, no build is fitted and nothing is smoothed.
    """
    estimates: dict[str, Estimates] = {}
    for name in TRACKED:
        how = TrackOptions(
            **options_of(name, training, ITERATIONS), smooth=False, body_frames=0
        )
        track = track_scene(
            replace(scene, yaw=None), training, completed(how, scene.truth)
        )
        estimates[name] = dict(enumerate(track.frames))
    usable = [k for k in range(scene.count) if scene.observations[k].usable]
    chosen = [
        usable[k]
        for k in np.unique(np.linspace(0, len(usable) - 1, IMAGES).round().astype(int))
    ]
    images = {k: replace(scene.observations[k], yaw=None) for k in chosen}
    single = estimate_images(scene, images, training, OURS, ITERATIONS, 0)
    return {SINGLE: dict(zip(chosen, single, strict=True)), **estimates}


def figures_of(estimates: Estimates, scene: Scene) -> dict[str, float]:
    """Return how well an estimate fits, averaged over its usable frames."""
    usable = [frame for k, frame in estimates.items() if scene.observations[k].usable]
    return {
        "frames": len(estimates),
        "usable": len(usable),
        "iou": float(np.mean([metrics.iou(frame.areas)[0] for frame in usable])),
        "cost": float(np.mean([frame.cost for frame in usable])),
    }


def picture(
    scene: Scene, estimates: dict[str, Estimates], frames: Sequence[int], first: int
) -> Image:
    """Return the person in frames of a film side by side, with the estimates below.

    `frames` are numbers in the scene. The scene's first frame has the number `first` in
    the film.
    """
    assert scene.pictures is not None
    films = {k: image for k, image in enumerate(scene.pictures()) if k in frames}
    masks = {k: scene.observations[k].silhouettes[0] for k in frames}
    rows = [np.hstack([_square(films[k], masks[k]) for k in frames])]
    for name, results in estimates.items():
        squares = []
        for k in frames:
            drawn = films[k].copy()
            draw_body(
                drawn,
                scene.body,
                scene.cameras[0],
                results[k].pose,
                results[k].translation,
            )
            squares.append(
                _square(
                    cv2.addWeighted(drawn, SOLID, films[k], 1.0 - SOLID, 0.0), masks[k]
                )
            )
        rows.append(np.hstack(squares))
        write(rows[-1], LABELS[name], (8, 20))
    for number, k in enumerate(frames):
        write(rows[0], f"frame {first + k}", (number * TALL + 8, 20))
    return np.asarray(np.vstack(rows), dtype=np.uint8)


def _square(image: Any, silhouette: Silhouette) -> Image:
    """Return the square of a picture around the person.

    It is black beyond the borders, and darker under its label.
    """
    (x, y), tall = extent_of(silhouette)
    half = SQUARE * tall
    shift = np.array([[1.0, 0.0, half - x], [0.0, 1.0, half - y]])
    placed = TALL / (2.0 * half) * shift
    square: Image = np.asarray(
        cv2.warpAffine(image, placed, (TALL, TALL)), dtype=np.uint8
    )
    square[:28] //= 4
    return square


def table_of(name: str, figures: dict[str, dict[str, float]]) -> Table:
    """Return the table of a film's estimates; there is no truth to compare with."""
    rows = [
        [
            LABELS[method],
            *(str(row[key]) for key in ("frames", "usable")),
            f"{row['iou']:.3f}",
            f"{row['cost']:.2f}",
        ]
        for method, row in figures.items()
    ]
    return Table(
        name, ["method", "frames", "usable", "IoU with the mask", "cost (4)"], rows
    )


@click.command(cls=Command)
@click.argument("films", nargs=-1, required=True, type=click.Path(path_type=Path))
@click.option(
    "--activity",
    type=click.Choice(["walk", "run"]),
    help="The activity of films if their names do not state it.",
)
@CLIPS
@click.option(
    "--out",
    required=True,
    metavar="DIR",
    help="New folder for the tables and the pictures of both figures.",
)
@options((FRAMES, *track_flags("height"), *EXTRACTION))
def main(
    films: tuple[Path, ...],
    activity: Activity | None,
    clips: str | None,
    out: str,
    frames: Range,
    height: float | None,
    **extraction: Any,
) -> None:
    """Figures 8 and 10 of Acta Automatica Sinica 38(5), on real films.

    FILMS are films of KTH's actions, HumanEva-I or CMU's motion capture database as
    unpacked, or any others. By default 100 frames of a film are taken, from the first
    that shows the person according to the data set; --frames chooses others.
    """
    view = {
        "height": height,
        "extraction": extraction_of(extraction, "video") or Extraction(),
    }
    recordings = [recording_of(film) for film in films]
    for recording in recordings:
        if recording.activity is None and activity is None:
            raise InputError(
                "--activity must be given for films with names that do not state it, "
                f"such as {recording.film}"
            )
    motions = paper_motions(clips, FRAMES_OF_THE_PAPER)
    with new_folder(out) as folder:
        for recording in recordings:
            shows = recording.activity or activity
            scene, first = filmed_scene(recording, frames, **view)
            estimates = estimates_of(scene, motions[str(shows)].training)
            table = table_of(
                recording.name,
                {name: figures_of(each, scene) for name, each in estimates.items()},
            )
            (folder / f"{table.name}.md").write_text(f"{table}\n", encoding="utf-8")
            last = first + scene.count - 1
            head = (
                f"{recording.name}: {shows}, frames {first} to {last}, "
                f"camera {scene.placing}"
            )
            click.echo("\n".join([f"{head}\n\n{table}\n", *scene.warnings]))
            shown = list(estimates[SINGLE])
            single = {SINGLE: estimates.pop(SINGLE)}
            for figure, each in (("figure-8", single), ("figure-10", estimates)):
                image = picture(scene, each, shown, first)
                cv2.imwrite(
                    str(folder / f"{figure}-{recording.name}.jpg"),
                    image,
                    [cv2.IMWRITE_JPEG_QUALITY, 85],
                )


if __name__ == "__main__":
    main()
