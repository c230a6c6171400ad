"""Errors of clinical angles in recorded walks of people who are not in the library.

    python docs/studies/angles.py

Hip and knee flexion and ankle dorsiflexion of both sides are compared with the truth.
The table has a line for each set of views: medians over the walks, in degrees, of the
root mean square error, and of the same after the mean difference is removed
("varies"). composites.py has the same for composed videos.
"""

from collections.abc import Iterator, Mapping
from functools import partial
from itertools import product

import click
import numpy as np
from numpy.typing import NDArray

from clips import FOUR, GROUPS, PAIRS, SIDES, WALKS, Views, cell_fields, track_of
from posefit import clinical_angles
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.motion.motion import Motion
from posefit.sweep.cell import TrackCell, cell_scene
from posefit.sweep.check import cell_of
from posefit_reproduce.jobs import each
from table import WORKERS, bar, markdown

SAGITTAL = ("hip_flexion", "knee_flexion", "ankle_dorsiflexion")


def angle_errors(
    true: Motion, angles: Mapping[str, Array], seen: NDArray[np.bool_]
) -> dict[str, float]:
    """Return the errors in degrees of an estimate's angles (T,) in the frames `seen`.

    Both sides count together. Each angle has its root mean square error, and under
    `_varies` the error after the mean difference is removed.
    """
    truth = clinical_angles(true.skeleton, true.poses)
    found = {}
    for name in SAGITTAL:
        off = np.array(
            [
                (angles[f"{side}_{name}"] - truth[f"{side}_{name}"])[seen]
                for side in ("left", "right")
            ]
        )
        found[name] = float(np.sqrt(np.nanmean(off**2)))
        found[f"{name}_varies"] = float(
            np.sqrt(np.nanmean((off - np.nanmean(off, axis=1, keepdims=True)) ** 2))
        )
    return found


def walk_errors(cell: TrackCell) -> dict[str, float]:
    """Return the errors of a recorded walk, tracked with its translation aligned."""
    result = track_of(cell, cell_scene(cell), translation="aligned")
    true = result.truth
    estimate = result.motion
    assert true is not None
    return angle_errors(
        true,
        clinical_angles(estimate.skeleton, estimate.poses),
        np.ones(len(true), dtype=bool),
    )


def walk_lines(workers: int | None) -> Iterator[str]:
    """Yield the table of recorded walks by view: medians of errors."""
    jobs = {}
    for clip, views in product(GROUPS[WALKS], (*SIDES, *PAIRS, FOUR)):
        cell = cell_of(cell_fields(clip, views, clip.frames))
        jobs[clip.name, clip.instance, views] = partial(walk_errors, cell)
    by_views: dict[Views, list[dict[str, float]]] = {}
    for (*_, views), errors in each(jobs, workers, bar).items():
        by_views.setdefault(views, []).append(errors)
    names = [*SAGITTAL, *(f"{name}_varies" for name in SAGITTAL)]
    cells = []
    for views, rows in by_views.items():
        medians = [np.median([row[name] for row in rows]) for name in names]
        cells.append(
            [
                " + ".join(f"{view:g}" for view in views),
                *(f"{median:.1f}" for median in medians),
            ]
        )
    yield from markdown(
        ["view, degrees", *(name.replace("_", " ") for name in names)], cells
    )


@click.command(cls=Command, help=__doc__)
@WORKERS
def main(workers: int | None) -> None:
    for line in walk_lines(workers):
        click.echo(line)


if __name__ == "__main__":
    main()
