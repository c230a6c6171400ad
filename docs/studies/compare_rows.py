"""Compare the rows of one plan from two checkouts, such as before and after a method was rewritten.

    posefit sweep docs/studies/rewritten.toml --out results && posefit report results --csv rows.csv
    python docs/studies/compare_rows.py before/rows.csv after/rows.csv

A line is a method and a figure: its mean in both files, and the mean of the differences of paired cells with its 95 %
interval, by a bootstrap over pairs.
"""

import csv
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

from posefit.arrays import Array
from posefit.cli.output import Command
from table import LEVEL, RESAMPLES, markdown

FIGURES = ("error_degrees.mean", "mpjpe_mm", "lost_rate", "cost", "cpu_seconds_per_frame")
CELL = ("method", "motion", "instance", "view_degrees", "seed")  # what two rows have in common


def figures(path: Path) -> dict[tuple[str, ...], Array]:
    """Return the figures of each cell of a file."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return {tuple(row[name] for name in CELL): np.array([float(row[name]) for name in FIGURES]) for row in rows}


def lines(before: dict[tuple[str, ...], Array], after: dict[tuple[str, ...], Array]) -> Iterator[list[str]]:
    """Yield the cells of the table, method by method."""
    rng = np.random.default_rng(0)
    for method in dict.fromkeys(cell[0] for cell in before):
        cells = [cell for cell in before if cell[0] == method and cell in after]
        old, new = (np.array([rows[cell] for cell in cells]) for rows in (before, after))
        drawn = rng.integers(len(cells), size=(RESAMPLES, len(cells)))
        means = (new - old)[drawn].mean(axis=1)
        low, high = np.quantile(means, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0], axis=0)
        for k, name in enumerate(FIGURES):
            values = old[:, k].mean(), new[:, k].mean()
            difference = f"{values[1] - values[0]:+.3g}", f"{low[k]:+.3g} to {high[k]:+.3g}"
            yield [method, name, str(len(cells)), *(f"{value:.3g}" for value in values), *difference]


@click.command(cls=Command, help=__doc__)
@click.argument("before", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("after", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def main(before: Path, after: Path) -> None:
    heads = ["method", "figure", "pairs", "before", "after", "difference", "95 % interval"]
    for line in markdown(heads, list(lines(figures(before), figures(after))), words=2):
        click.echo(line)


if __name__ == "__main__":
    main()
