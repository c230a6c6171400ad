"""Figures 8 and 10 of the SAPSO paper: poses of single real images, and 100 frames of a real film, tracked.

Masks are those of a mixture of Gaussians, as in the paper. It says neither which frames it took nor what it knew of
camera, body and place: here the camera is the data set's or a guess, the place in each image is aligned to the mask,
and the first yaw is unknown.
"""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import click
import cv2
import numpy as np

from footage_sets import Activity, Recording, errors_mm, films_in, recording_of
from posefit.cli.options import EXTRACTION, FRAMES, JSON, options, track_flags
from posefit.cli.output import progress, say
from posefit.errors import InputError
from posefit.files import new_folder
from posefit.fitting import metrics
from posefit.fitting.tracker import Frame
from posefit.footage.masks import Range, span
from posefit.footage.quality import extent_of
from posefit.footage.scene import Scene
from posefit.footage.segmentation import Extraction
from posefit.footage.source import scene_of
from posefit.footage.video import Video
from posefit.motion.motion import Motion
from posefit.silhouette.foreground import Image
from posefit.silhouette.mask import Silhouette
from posefit.tracking.drawing import draw_body, write
from posefit.tracking.options import ITERATIONS, TrackOptions
from posefit.tracking.pipeline import track_scene
from posefit_reproduce.commands import CLIPS
from posefit_reproduce.sapso.experiment import estimate_images
from posefit_reproduce.sapso.motions import paper_motions
from posefit_reproduce.sapso.paper import FRAMES as FRAMES_OF_THE_PAPER
from posefit_reproduce.sapso.paper import METHODS, OURS, PAPER, settings_of

IMAGES = 6  # estimated by themselves, and shown
TALL = 300  # pixels of a picture in a figure
LABEL_HEIGHT = 28  # pixels
SQUARE = 0.65  # of the person's height in pixels: half the side of such a picture
SOLID = 0.65  # how much of the film the body hides
SINGLE = "PCA + SAPSO, images"
Progress = Callable[[Iterator[Any], int], Iterator[Any]]


class Estimate(NamedTuple):
    """The poses of some frames of a scene, each by itself or tracked."""

    method: str
    frames: Sequence[int]  # their numbers in the scene
    results: Sequence[Frame]


@dataclass(frozen=True, kw_only=True)
class Choice:
    """What is run."""

    folder: str | Path
    only: str = ""  # in the paths of films; "" for one walk and one run
    activity: Activity | None = None  # of films that do not say
    frames: Range = (None, None)  # by default 100 from the first that shows the person
    clips: str | Path | None = None  # what priors learn from: a folder of CMU clips, or None for built-in motions
    height: float | None = None  # metres that the person stands
    extraction: Extraction | None = None  # of the masks; by default a mixture of Gaussians, as in the paper
    seed: int = 0
    iterations: int = ITERATIONS


def footage_report(choice: Choice, out: str | Path | None, progress: Progress) -> dict[str, Any]:
    """Return what single images and tracks of each film give, and write it with the pictures to `out`, if given.

    Raises InputError where files or choices do not fit.
    """
    chosen, motions = _chosen(choice), paper_motions(choice.clips, FRAMES_OF_THE_PAPER)
    with nullcontext() if out is None else new_folder(out) as folder:
        rows: dict[str, Any] = {}
        figures: list[str] = []
        for recording, activity in progress(iter(chosen), len(chosen)):
            scene, first = filmed_scene(recording, choice)
            training = motions[activity].training
            tracks = [tracked(scene, training, name, choice) for name in PAPER]
            images = single_images(scene, training, choice)  # last, so that its seconds are not those of compiling
            rows[recording.name] = {
                "activity": activity,
                "frames": [first, first + scene.count],
                "camera": scene.placing,
                "warnings": list(scene.warnings),
                "estimates": {each.method: _figures(each, scene, recording, first) for each in (images, *tracks)},
            }
            if folder is not None:
                for figure, shown in (("figure-8", [images]), ("figure-10", tracks)):
                    name = f"{figure}-{recording.name}.png"
                    cv2.imwrite(str(folder / name), picture(scene, shown, images.frames, first))
                    figures.append(name)
        report = {"seed": choice.seed, "iterations": choice.iterations, "films": rows, "figures": figures}
        if folder is not None:
            (folder / "report.json").write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    return report


def _chosen(choice: Choice) -> list[tuple[Recording, Activity]]:
    """Return the films that are run, and what they show; without a name those of one walk and one run."""
    chosen: dict[Path, Activity] = {}
    for film, named in films_in(choice.folder, choice.only).items():
        activity = named or choice.activity
        if activity is None:
            raise InputError(f"activity must be walk or run for films that do not say, such as {film.name}, got none")
        if choice.activity in (None, activity) and (choice.only or activity not in chosen.values()):
            chosen[film] = activity
    return [(recording_of(film), activity) for film, activity in chosen.items()]


def filmed_scene(recording: Recording, choice: Choice) -> tuple[Scene, int]:
    """Return the scene of 100 frames of a film, or of those chosen, and the number of its first frame."""
    given, count = choice.frames != (None, None), Video.of(recording.film).count()
    start, stop = span(choice.frames if given else recording.frames, count)
    stop = stop if given else min(stop, start + FRAMES_OF_THE_PAPER)
    scene = scene_of(
        [recording.film],
        camera=() if recording.calibration is None else (recording.calibration,),
        frames=(start, stop),
        extraction=choice.extraction,
        asf=recording.skeleton,
        height=choice.height,
    )
    return replace(scene, name=recording.name), start


def single_images(scene: Scene, training: Sequence[Motion], choice: Choice) -> Estimate:
    """Return the poses of a few images, each by itself, from a full circle of yaws. SAPSO section 5.3, figure 8."""
    usable = [k for k in range(scene.count) if scene.observations[k].usable]
    chosen = [usable[k] for k in np.unique(np.linspace(0, len(usable) - 1, IMAGES).round().astype(int))]
    images = {k: replace(scene.observations[k], yaw=None) for k in chosen}
    return Estimate(SINGLE, chosen, estimate_images(scene, images, training, OURS, choice.iterations, choice.seed))


def tracked(scene: Scene, training: Sequence[Motion], name: str, choice: Choice) -> Estimate:
    """Return the poses of all frames, tracked by a method of the paper. SAPSO section 5.4, figure 10.

    The first yaw is unknown, with restarts; as in the paper no build is fitted and nothing is smoothed.
    """
    options = TrackOptions(
        method=name,
        settings=settings_of(name),
        iterations=choice.iterations,
        seed=choice.seed,
        smooth=False,
        body_frames=0,
    )
    track = track_scene(replace(scene, yaw=None), training, options)
    return Estimate(name, range(scene.count), track.estimates)


def _figures(estimate: Estimate, scene: Scene, recording: Recording, first: int) -> dict[str, float | int | None]:
    """Return what fits how well: means over an estimate's frames."""
    usable = np.array([scene.observations[k].usable for k in estimate.frames])
    values = {
        "iou": [float(metrics.iou(frame.areas)[0]) for frame in estimate.results],
        "cost": [frame.cost for frame in estimate.results],
        "seconds_per_frame": [frame.seconds for frame in estimate.results],
    }
    row: dict[str, float | int | None] = {"frames": len(usable), "usable": int(usable.sum())}
    row |= {name: float(np.array(each)[usable].mean()) for name, each in values.items()}
    if recording.truth is not None:
        truth = recording.truth(first, first + scene.count)[list(estimate.frames)]
        joints = np.array([scene.body.skeleton.joints(each.pose, each.translation) for each in estimate.results])
        for name, relative in (("error_mm", False), ("relative_error_mm", True)):
            errors = errors_mm(truth, joints, relative)
            known = np.isfinite(errors) & usable
            row[name] = float(errors[known].mean()) if known.any() else None
    return row


def picture(scene: Scene, estimates: Sequence[Estimate], frames: Sequence[int], first: int) -> Image:
    """Return the person in frames of a film side by side, and below with the body of each estimate.

    `frames` are their numbers in the scene, whose first frame has the number `first` in the film.
    """
    assert scene.pictures is not None
    films = {k: image for k, image in enumerate(scene.pictures()) if k in frames}
    masks = {k: scene.observations[k].silhouettes[0] for k in frames}
    rows = [np.hstack([_square(films[k], masks[k]) for k in frames])]
    for estimate in estimates:
        poses = dict(zip(estimate.frames, estimate.results, strict=True))
        rows.append(np.hstack([_square(_drawn(scene, films[k], poses[k]), masks[k]) for k in frames]))
        write(rows[-1], METHODS[estimate.method].label if estimate.method in METHODS else SINGLE, (8, 20))
    for number, k in enumerate(frames):
        write(rows[0], f"frame {first + k}", (number * TALL + 8, 20))
    return np.asarray(np.vstack(rows), dtype=np.uint8)


def _drawn(scene: Scene, film: Image, frame: Frame) -> Image:
    """Return a frame of a film with the body on it, half seen through."""
    image = film.copy()
    draw_body(image, scene.body, scene.cameras[0], frame.pose, frame.translation)
    return np.asarray(cv2.addWeighted(image, SOLID, film, 1.0 - SOLID, 0.0), dtype=np.uint8)


def _square(image: Image, silhouette: Silhouette) -> Image:
    """Return the square of a picture that shows the person, black beyond its borders and darker under its label."""
    (x, y), tall = extent_of(silhouette)
    half = SQUARE * tall
    placed = TALL / (2.0 * half) * np.array([[1.0, 0.0, half - x], [0.0, 1.0, half - y]])
    square: Image = np.asarray(cv2.warpAffine(image, placed, (TALL, TALL)), dtype=np.uint8)
    square[:LABEL_HEIGHT] //= 4
    return square


def _lines(report: dict[str, Any]) -> Iterator[str]:
    for name, film in report["films"].items():
        first, stop = film["frames"]
        yield f"{name}: {film['activity']}, frames {first} to {stop - 1}, camera {film['camera']}"
        yield f"{'':24}{'frames':>8}{'usable':>8}{'IoU':>8}{'cost':>8}{'s':>8}{'mm':>8}{'rel. mm':>9}"
        for method, row in film["estimates"].items():
            label = f"{METHODS[method].label}, tracked" if method in METHODS else method
            errors = [row.get("error_mm"), row.get("relative_error_mm")]
            shown = ["-" if error is None else f"{error:.1f}" for error in errors]
            yield (
                f"  {label:22}{row['frames']:8}{row['usable']:8}{row['iou']:8.3f}{row['cost']:8.2f}"
                f"{row['seconds_per_frame']:8.3f}{shown[0]:>8}{shown[1]:>9}"
            )
        for warning in film["warnings"]:
            yield f"  {warning}"
    yield "mm: HumanEva's error, the mean distance of 15 virtual markers, and the same with both pelvises in one place"


@click.command()
@click.argument("folder", type=click.Path())
@click.option("--only", default="", metavar="TEXT", help="Films with it in their path; by default a walk and a run.")
@click.option("--activity", type=click.Choice(["walk", "run"]), help="What films show whose names do not say it.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of all random numbers.")
@CLIPS
@click.option("--out", metavar="DIR", help="New folder for report.json and the pictures of figures 8 and 10.")
@options((FRAMES, *track_flags("height"), *EXTRACTION, JSON))
def main(out: str | None, as_json: bool, **given: Any) -> None:
    """Figures 8 and 10 of Acta Automatica Sinica 38(5), on real films.

    FOLDER is that of KTH's actions, HumanEva-I or CMU's motion capture database as unpacked, or a film by itself. Of
    each film 100 frames are taken, from the first that shows the person by what its data set says, unless --frames
    chooses others.
    """
    how = {name: given.pop(name) for name in ("background", "roi", "ignore", "width")}
    how["method"] = given.pop("extraction")
    extraction = Extraction(**{name: value for name, value in how.items() if value is not None})
    try:
        report = footage_report(Choice(**given, extraction=extraction), out, partial(progress, unit="film"))
    except InputError as mistake:
        say(f"posefit: {mistake}")
        sys.exit(2)
    click.echo(json.dumps(report) if as_json else "\n".join(_lines(report)))
    if out and not as_json:
        click.echo(f"written to {out}: look at {', '.join(report['figures'])}")


if __name__ == "__main__":
    main()
