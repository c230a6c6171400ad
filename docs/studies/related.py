"""Write the tables of the plan `related` from its ledger.

    posefit sweep docs/studies/related.toml --out results
    python docs/studies/related.py results tables
    python docs/studies/reproduced_pages.py related=tables

There are tables of the methods, of the best method for each condition, and of the
sentences of the SAPSO paper, section 1, about other methods. Each sentence is a
comparison of two methods in paired cells. The figure is the mean difference with its 95
% interval over other conditions of the same motions, by `posefit.statistics.means`. The
sentence holds if the whole interval is on its side of 0, fails if it is on the other
side, and is open otherwise.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import click
import numpy as np

from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.evaluation.measures import MEASURES
from posefit.statistics.means import mean_interval
from posefit.sweep.ledger import Ledger
from table import head_of, markdown, number, percent

Row = Mapping[str, Any]
# motion, number of cameras, whether the first yaw is known, whether masks are clean
Condition = tuple[str, int, bool, bool]


class Sentence(NamedTuple):
    """What the paper says about a method, as a difference above 0."""

    says: str
    method: str
    reference: str
    figure: str  # a row's figure, which must be higher for the method
    rows: Callable[[Condition], bool] = lambda _: True


WORSE = "mpjpe_mm"
SLOWER = "cpu_seconds_per_frame"
SENTENCES = (
    Sentence(
        "a learned manifold has no inverse in closed form",
        "sapso@isomap",
        "sapso@pca",
        WORSE,
    ),
    Sentence(
        "a GPLVM is not continuous: intermediate poses are wrong",
        "sapso@gplvm",
        "sapso@pca",
        WORSE,
    ),
    Sentence("gradients converge fast", "sapso@pca", "gradient", SLOWER),
    Sentence(
        "gradients do not assure the global optimum", "gradient", "sapso@pca", "cost"
    ),
    Sentence("local search in layers is slow", "local@pca", "sapso@pca", SLOWER),
    Sentence(
        "local search in layers ends in local optima", "local@pca", "sapso@pca", "cost"
    ),
    Sentence(
        "smoothing makes a particle filter more accurate",
        "filtered",
        "smoothing",
        WORSE,
    ),
    Sentence(
        "particle filters need too many particles in many dimensions",
        "particle@full",
        "sapso@full",
        "cost",
    ),
    Sentence(
        "a swarm moves a filter's particles to better ones",
        "particle@pca",
        "psopf@pca",
        "cost",
    ),
    Sentence(
        "hierarchical swarms in all angles converge slowly",
        "hpso@full",
        "sapso@full",
        "cost",
    ),
    Sentence(
        "hierarchical swarms in all angles do not assure quality",
        "hpso@full",
        "sapso@pca",
        WORSE,
    ),
    Sentence(
        "generative methods are more accurate than regression",
        "regression",
        "sapso@pca",
        WORSE,
    ),
)


def name_of(row: Row) -> str:
    return str(row["spec"].get("name") or row["spec"]["method"])


def condition_of(row: Row) -> Condition:
    """Return the motion, the number of cameras, and whether yaw and masks are exact."""
    spec = row["spec"]
    view = row["spec"].get("view_degrees", 0)
    cameras = len(view) if isinstance(view, list | tuple) else 1
    return (
        str(spec["motion"]),
        cameras,
        not spec.get("yaw_off_degrees"),
        not spec.get("corruption"),
    )


def methods(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the table of methods, the most accurate first.

    It has medians of all tracks, and of four parts of them.
    """
    parts = {
        f"{views}, {masks}": (views == "one camera", masks == "clean")
        for views in ("one camera", "two")
        for masks in ("clean", "damaged")
    }
    cells = []
    for name in dict.fromkeys(map(name_of, rows)):
        mine = [row for row in rows if name_of(row) == name]
        split: dict[tuple[bool, bool], list[float]] = {
            part: [] for part in parts.values()
        }
        for row in mine:
            _, cameras, _, clean = condition_of(row)
            split[cameras == 1, clean].append(row[WORSE])
        medians = [
            np.median([row[WORSE] for row in mine]),
            *(np.median(some) if some else None for some in split.values()),
        ]
        lost = percent(float(np.mean([row["lost_rate"] for row in mine])))
        figures = [
            number(WORSE, None if median is None else float(median))
            for median in medians
        ]
        cpu = number(SLOWER, float(np.median([row[SLOWER] for row in mine])))
        cells.append([f"`{name}`", figures[0], lost, *figures[1:], cpu])
    cells.sort(key=lambda cell: float(cell[1].replace(",", "")))
    heads = ["method", head_of(WORSE), head_of("lost_rate"), *parts, head_of(SLOWER)]
    yield from markdown(heads, cells)


def paired(
    rows: Sequence[Row], method: str, reference: str, figure: str
) -> dict[tuple[Condition, int], float]:
    """Return the paired differences of a figure between two methods' cells.

    Keys are condition and seed.
    """
    values: dict[str, dict[tuple[Condition, int], float]] = {method: {}, reference: {}}
    for row in rows:
        if name_of(row) in values:
            values[name_of(row)][condition_of(row), row["spec"].get("seed", 0)] = float(
                row[figure]
            )
    shared = [cell for cell in values[method] if cell in values[reference]]
    return {cell: values[method][cell] - values[reference][cell] for cell in shared}


def winners(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the table of the best method, by mean MPJPE, for each condition.

    "or" names the second best if it is not significantly worse.
    """
    lines: dict[tuple[str, int], list[str]] = {}
    for condition in sorted(
        set(map(condition_of, rows)),
        key=lambda at: (at[0], at[1], not at[2], not at[3]),
    ):
        mine = [row for row in rows if condition_of(row) == condition]
        means = {
            name: np.mean([row[WORSE] for row in mine if name_of(row) == name])
            for name in map(name_of, mine)
        }
        first, *others = sorted(means, key=lambda name: means[name])
        cell = f"`{first}` {number(WORSE, float(means[first]))}"
        pairs = paired(mine, others[0], first, WORSE) if others else {}
        if (
            pairs
            and difference(list(pairs.values()), [""] * len(pairs), list(pairs))[2]
            != "holds"
        ):
            cell += f" or `{others[0]}`"
        lines.setdefault(condition[:2], []).append(cell)
    heads = [
        "motion",
        "cameras",
        *(
            f"{yaw} yaw, {masks}"
            for yaw in ("known", "unknown")
            for masks in ("clean", "damaged")
        ),
    ]
    yield from markdown(
        heads,
        [[motion, str(count), *cells] for (motion, count), cells in lines.items()],
        words=6,
    )


def difference(
    values: Sequence[float], strata: Sequence[object], clusters: Sequence[object]
) -> tuple[str, str, str]:
    """Return a mean, its interval and the verdict on a mean above 0, in words.

    The verdict is "open" if there is no interval.
    """
    mean = mean_interval(values, list(map(str, strata)), list(map(str, clusters)))
    if not np.isfinite(mean.low):
        return f"{mean.value:+.3g}", "-", "open"
    verdict = "open"
    if mean.low > 0.0:
        verdict = "holds"
    elif mean.high < 0.0:
        verdict = "fails"
    return f"{mean.value:+.3g}", f"{mean.low:+.3g} to {mean.high:+.3g}", verdict


def verdicts(rows: Sequence[Row]) -> Iterator[str]:
    lines = []
    for sentence in SENTENCES:
        pairs = paired(rows, sentence.method, sentence.reference, sentence.figure)
        pair = f"`{sentence.method}` less `{sentence.reference}`"
        what = f"{pair}, {head_of(sentence.figure)}"
        cell = "open"
        if pairs:
            strata = [condition[0] for condition, _ in pairs]
            values = [
                MEASURES[sentence.figure].factor * value for value in pairs.values()
            ]
            mean, interval, verdict = difference(
                values, strata, [condition for condition, _ in pairs]
            )
            cell = f"**{verdict}** {mean} ({interval})"
        lines.append([sentence.says, what, str(len(pairs)), cell])
    heads = ["the paper says", "difference, above 0 if true", "n", "verdict"]
    yield from markdown(heads, lines, words=4)


@click.command(cls=Command, help=__doc__)
@click.argument("ledger", type=click.Path(exists=True, path_type=Path))
@click.argument("out", type=click.Path(file_okay=False, path_type=Path))
def main(ledger: Path, out: Path) -> None:
    with Ledger(ledger) as opened:
        rows = list(opened.rows())
        version = opened.version
    if not rows:
        raise InputError(
            f"{ledger}: expected finished cells of docs/studies/related.toml, got none"
        )
    out.mkdir(parents=True, exist_ok=True)
    for name, table in (
        ("methods", methods),
        ("winners", winners),
        ("sentences", verdicts),
    ):
        (out / f"{name}.md").write_text("\n".join(table(rows)) + "\n", encoding="utf-8")
    conditions, seeds = (
        len(set(map(of, rows)))
        for of in (condition_of, lambda row: row["spec"]["seed"])
    )
    click.echo(
        f"{out}: {len(rows):,} tracks, {conditions} conditions, {seeds} seeds, "
        f"{version}"
    )


if __name__ == "__main__":
    main()
