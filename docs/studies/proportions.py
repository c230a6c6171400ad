"""How much people's proportions vary: the numbers of a build's prior.

    python docs/studies/proportions.py MEN WOMEN

MEN and WOMEN are the public tables of ANSUR II, ANSUR_II_MALE_Public.csv and
ANSUR_II_FEMALE_Public.csv, from https://www.openlab.psu.edu/ansur2 (Gordon et al. 2014,
NATICK/TR-15/007). It prints the standard deviations of the logarithms of stature and of
lengths relative to stature, and the correlations of these lengths, for a population
with as many men as women.
"""

import csv
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np

from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.reading import existing
from table import markdown

# Each proportion is a sum of measures, some with a minus sign, divided by stature.
MEASURES = {
    "thighs": ("trochanterionheight", "-lateralfemoralepicondyleheight"),
    "shanks": ("lateralfemoralepicondyleheight", "-lateralmalleolusheight"),
    "feet": ("footlength",),
    "torso": ("cervicaleheight", "-trochanterionheight"),
    "neck": ("stature", "-cervicaleheight"),
    "shoulders": ("biacromialbreadth",),
    "upper arms": ("acromionradialelength",),
    "forearms": ("radialestylionlength", "handlength"),
}


def proportions(table: Path) -> Array:
    """Return logarithms of stature in metres and of proportions, (people, 9)."""
    with existing(table).open(encoding="latin-1", newline="") as file:
        rows = list(csv.DictReader(file))
    names = {"stature", *(name.strip("-") for of in MEASURES.values() for name in of)}
    columns = {name: np.array([float(row[name]) for row in rows]) for name in names}
    lengths = [
        sum(columns[name.strip("-")] * (-1 if name[0] == "-" else 1) for name in of)
        for of in MEASURES.values()
    ]
    stature = columns["stature"]
    shares = [length / stature for length in lengths]
    return np.asarray(np.log(np.column_stack([1e-3 * stature, *shares])))


def moments(men: Array, women: Array) -> tuple[Array, Array]:
    """Return standard deviations (n,) and correlations (n, n) of a population.

    It has as many men as women.
    """
    middle = 0.5 * (men.mean(axis=0) + women.mean(axis=0))
    covariance = sum(
        0.5 * (people - middle).T @ (people - middle) / len(people)
        for people in (men, women)
    )
    spread = np.sqrt(np.diag(covariance))
    return spread, covariance / np.outer(spread, spread)


def proportions_lines(men: Path, women: Path) -> Iterator[str]:
    spread, correlation = moments(proportions(men), proportions(women))
    heads = ["", "spread", *MEASURES]
    rows = zip(MEASURES, spread[1:], correlation[1:, 1:], strict=True)
    cells = [
        [name, f"{deviation:.3f}", *(f"{value:.2f}" for value in row)]
        for name, deviation, row in rows
    ]
    yield f"stature: {spread[0]:.3f}"
    yield from markdown(heads, cells, 1)


@click.command(cls=Command, help=__doc__)
@click.argument("men", type=click.Path(path_type=Path))
@click.argument("women", type=click.Path(path_type=Path))
def main(men: Path, women: Path) -> None:
    for line in proportions_lines(men, women):
        click.echo(line)


if __name__ == "__main__":
    main()
