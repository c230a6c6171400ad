"""How much a track of the same film depends on the seed.

    python docs/studies/seeds.py FILM --frames 55:166 --seeds 8

FILM is the demonstration video of Sports2D, or any other. Frames, height and segmenter
are chosen as for `posefit track`. The table has a line for each seed: lost and unknown
frames, the IoU, the verdict, and lengths of limbs. The last line is the median distance
of the same joint in two tracks.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import combinations
from typing import Any

import click
import numpy as np

from posefit.arrays import Array
from posefit.cli.options import EXTRACTION, FRAMES, options, track_flags
from posefit.cli.output import Command
from posefit.cli.tracking import extraction_of
from posefit.evaluation.errors import LOST
from posefit.footage.views import Range
from posefit.geometry.skeleton import BONES
from posefit.progress import QUIET
from posefit.tracking.front import track
from table import WORKERS, markdown, measured, percent

LIMBS = {"thigh": ("lfemur",), "forearm": ("lradius", "lwrist")}


def seed_row(film: str, how: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the figures of a film tracked with a seed, and its joints in mm."""
    result = track(film, seed=seed, progress=QUIET, **how)
    usable = result.table["usable"] > 0.0
    skeleton = result.motion.skeleton
    lengths = dict(zip(BONES, skeleton.lengths, strict=True))
    return {
        "seed": seed,
        "lost": float((result.table["lost"][usable] >= LOST).mean()),
        "unknown": float((result.table["unknown_sides"][usable] == 1.0).mean()),
        "iou": result.measures.iou,
        "grade": None if result.trust is None else result.trust.grade,
        **{
            f"{name}_mm": 1e3 * sum(lengths[bone] for bone in bones)
            for name, bones in LIMBS.items()
        },
        "joints_mm": (1e3 * result.motion.joints).round().astype(int).tolist(),
    }


def median_distance(tracks: Sequence[Array]) -> float:
    """Return the median distance of joints (T, 27, 3) between tracks.

    It is over all pairs of tracks, all frames and all joints.
    """
    distances = [
        np.linalg.norm(first - second, axis=2)
        for first, second in combinations(tracks, 2)
    ]
    return float(np.median(distances)) if distances else 0.0


def seeds_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the table of all seeds, and the distances between their joints."""
    heads = [
        "seed",
        "lost %",
        "unknown %",
        "IoU",
        "verdict",
        *(f"{name} mm" for name in LIMBS),
    ]
    cells = [
        [
            str(row["seed"]),
            *(percent(row[name], 0) for name in ("lost", "unknown")),
            *(f"{row['iou']:.3f}", str(row["grade"])),
            *(f"{row[f'{name}_mm']:.0f}" for name in LIMBS),
        ]
        for row in rows
    ]
    yield from markdown(heads, cells, 1)
    tracks = [np.array(row["joints_mm"]) for row in rows]
    apart = median_distance(tracks)
    about_root = median_distance([joints - joints[:, :1] for joints in tracks])
    yield (
        f"joints of two seeds are {apart:.0f} mm apart, median; "
        f"about the root {about_root:.0f}"
    )


@click.command(cls=Command, help=__doc__)
@click.argument("film")
@click.option(
    "--seeds",
    type=click.IntRange(1),
    default=4,
    show_default=True,
    help="Number of seeds, from 0.",
)
@click.option(
    "--rows",
    metavar="FILE",
    help="File with one row a line. An earlier run there is continued.",
)
@WORKERS
@options((FRAMES, *track_flags("height"), *EXTRACTION))
def main(
    film: str,
    seeds: int,
    rows: str | None,
    workers: int | None,
    frames: Range,
    height: float | None,
    **options: Any,
) -> None:
    how = {
        "frames": frames,
        "height": height,
        "extraction": extraction_of(options, "video"),
    }
    jobs = {seed: partial(seed_row, film, how, seed) for seed in range(seeds)}
    for line in seeds_lines(
        [*measured(jobs, rows, lambda row: int(row["seed"]), workers).values()]
    ):
        click.echo(line)


if __name__ == "__main__":
    main()
