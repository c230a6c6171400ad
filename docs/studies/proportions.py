"""How far people's proportions differ: the numbers of a build's prior, and how well they describe other people.

MEN and WOMEN are the public tables of ANSUR II, ANSUR_II_MALE_Public.csv and ANSUR_II_FEMALE_Public.csv of
https://www.openlab.psu.edu/ansur2 (Gordon et al. 2014, NATICK/TR-15/007). The other people are those of the library,
whose skeletons were fitted to markers on their bodies.
"""

import csv
from collections.abc import Iterator
from pathlib import Path

import click
import numpy as np
from scipy.stats import multivariate_normal

from posefit.arrays import Array
from posefit.fitting.shape import COVARIANCE, LENGTHS
from posefit.geometry.body import Body
from posefit.geometry.skeleton import BONES, kind
from posefit.motion import built_in, recorded
from posefit.reading import existing
from table import markdown

# Each proportion is a sum of measures, some with a minus, over stature.
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
UNMEASURED = ("hips", "forearms")  # by ANSUR II; and by the library, one of whose people has the wrist elsewhere


def proportions(table: Path) -> Array:
    """Return the logarithms of people's stature in metres and of their proportions (people, 9)."""
    with existing(table).open(encoding="latin-1", newline="") as file:
        rows = list(csv.DictReader(file))
    columns = {name: np.array([float(row[name]) for row in rows]) for name in _measures()}
    lengths = [sum(columns[name.strip("-")] * (-1 if name[0] == "-" else 1) for name in of) for of in MEASURES.values()]
    stature = columns["stature"]
    return np.log(np.column_stack([1e-3 * stature, *(length / stature for length in lengths)]))


def _measures() -> set[str]:
    """Return the columns that are read."""
    return {"stature", *(name.strip("-") for of in MEASURES.values() for name in of)}


def moments(men: Array, women: Array) -> tuple[Array, Array]:
    """Return the standard deviations (n,) and correlations (n, n) of a population of as many men as women."""
    middle = 0.5 * (men.mean(axis=0) + women.mean(axis=0))
    covariance = sum(0.5 * (people - middle).T @ (people - middle) / len(people) for people in (men, women))
    spread = np.sqrt(np.diag(covariance))
    return spread, covariance / np.outer(spread, spread)


def library_factors() -> Array:
    """Return the logarithms of the factors (n, 9) on the lengths over stature of the library's people."""

    def shares(body: Body) -> Array:
        lengths = dict(zip(BONES, body.skeleton.lengths, strict=True))
        left = {kind(bone): lengths[bone] for bone in BONES if not bone.startswith("r")}
        return np.log([sum(left[bone] for bone in group) / body.stature for group in LENGTHS.values()])

    people = [shares(Body.of(recorded.clips([subject])[0].skeleton)) for subject in recorded.subjects()]
    return np.array(people) - shares(Body.of(built_in.average_skeleton()))


def proportions_lines(men: Path, women: Path) -> Iterator[str]:
    """Yield the spreads, the correlations, and how well some priors describe the library's people."""
    spread, correlation = moments(proportions(men), proportions(women))
    heads = ["", "spread", *MEASURES]
    rows = zip(MEASURES, spread[1:], correlation[1:, 1:], strict=True)
    cells = [[name, f"{deviation:.3f}", *(f"{value:.2f}" for value in row)] for name, deviation, row in rows]
    yield f"stature: {spread[0]:.3f}"
    yield from markdown(heads, cells, 1)
    priors = {f"{percent} % each": np.eye(len(LENGTHS)) * (percent / 100.0) ** 2 for percent in (2, 3, 4, 6)}
    lengths = slice(1, 1 + len(LENGTHS))
    priors |= {"these spreads": np.diag(np.diag(COVARIANCE[lengths, lengths]))}
    priors |= {"and correlations": COVARIANCE[lengths, lengths]}

    def density(factors: Array, covariance: Array) -> float:
        return float(multivariate_normal(cov=covariance).logpdf(factors).mean())

    measured = [k for k, name in enumerate(LENGTHS) if name not in UNMEASURED]
    table = [
        [name, *(f"{density(factors[:, of], prior[np.ix_(of, of)]):.1f}" for of in (measured, range(len(LENGTHS))))]
        for factors in [library_factors()]
        for name, prior in priors.items()
    ]
    yield ""
    yield from markdown(["prior", "log density of seven lengths", "of all nine"], table, 1)


@click.command(help=__doc__)
@click.argument("men", type=click.Path(path_type=Path))
@click.argument("women", type=click.Path(path_type=Path))
def main(men: Path, women: Path) -> None:
    for line in proportions_lines(men, women):
        click.echo(line)


if __name__ == "__main__":
    main()
