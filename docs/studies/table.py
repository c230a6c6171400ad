"""Run a sweep plan and print its rows as a table; other studies share its functions.

    python docs/studies/table.py docs/studies/accuracy.toml --by method --by motion

Each line is a group of cells with the same fields of `--by`. It has medians over the
cells, or means of shares. Rows in `--ledger` are not run again.
"""

import json
import os
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

import click
import numpy as np

from posefit.arrays import Array
from posefit.cli.output import Command, progress, say
from posefit.evaluation.measures import MEASURES
from posefit.silhouette.sharing import cores
from posefit.statistics.means import CONFIDENCE
from posefit.sweep.cell import run_cell
from posefit.sweep.command import swept
from posefit.sweep.engine import Limits
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from posefit.sweep.pool import Pool
from posefit_reproduce.jobs import each

Row = Mapping[str, Any]
K = TypeVar("K", bound=Hashable)
SHARES = ("lost_rate", "swap_rate")
RESAMPLES = 2000  # resamples of a bootstrap
WORKERS = click.option(
    "--workers",
    type=click.IntRange(1),
    metavar="N",
    help="Number of processes; by default one per core.",
)
LEDGER = click.option(
    "--ledger",
    metavar="DIR",
    help="Folder of finished rows. An earlier run there is continued.",
)
bar = partial(progress, unit="run")


def rows(plan: Plan, workers: int | None, ledger: str | None) -> list[dict[str, Any]]:
    """Return the rows of a plan's cells in the plan's order.

    Cells in the folder `ledger` are not run again. Raises ValueError if a cell failed.
    """
    with nullcontext(ledger) if ledger else TemporaryDirectory() as folder:
        tally = swept(plan, folder, Pool(workers or cores(), Limits(), run_cell), say)
        if tally.stopped:
            raise KeyboardInterrupt
        with Ledger(folder) as found:
            for one in found.quarantined():
                raise ValueError(f"{one['key']}: {one['reasons'][-1]}")
            rows = {row["key"]: row for row in found.rows()}
        return [rows[cell.key] for cell in plan]


def earlier(path: str | None, key: Callable[[Row], K]) -> dict[K, Row]:
    """Return the rows of a file under their keys, or nothing if there is no file."""
    if path is None or not Path(path).exists():
        return {}
    return {
        key(row): row
        for row in map(json.loads, Path(path).read_text("utf-8").splitlines())
    }


def kept(
    path: str | None, ended: Iterator[tuple[K, Row]], count: int
) -> Iterator[tuple[K, Row]]:
    """Yield finished rows under their keys, and write each to the file, if any."""
    for key, row in bar(ended, count):
        if path is not None:
            with Path(path).open("a", encoding="utf-8") as file:
                file.write(f"{json.dumps(row)}\n")
        yield key, row


def keyed(kind: Any) -> Callable[[Row], Any]:
    """Return the function that makes a named tuple of a kind from a row's fields."""
    return lambda row: kind(*(row[name] for name in kind._fields))


def measured(
    jobs: Mapping[K, Callable[[], Row]],
    path: str | None,
    key: Callable[[Row], K],
    workers: int | None,
    limits: Limits | None = None,
) -> dict[K, Row]:
    """Return the row of each job under its key.

    Rows in the file are not measured again, and new ones are added to it.
    """
    done = earlier(path, key)
    missing = {name: job for name, job in jobs.items() if name not in done}
    done |= each(missing, workers, partial(kept, path), limits) if missing else {}
    return {name: done[name] for name in jobs}


def head_of(name: str, which: str = "") -> str:
    """Return the head of a figure's column: a word such as median, label, and unit."""
    measure = MEASURES[name]
    return " ".join(word for word in (which, measure.label, measure.unit) if word)


def number(name: str, value: float | None) -> str:
    """Return a value with a figure's number of digits, in its unit."""
    return MEASURES[name].number(value)


def markdown(
    heads: Sequence[str], cells: Sequence[Sequence[str]], words: int = 1
) -> Iterator[str]:
    """Yield the lines of a table. The first columns, `words` of them, are text."""
    yield f"| {' | '.join(heads)} |"
    yield "|" + "---|" * words + "---:|" * (len(heads) - words)
    yield from (f"| {' | '.join(row)} |" for row in cells)


def percent(value: float | None, digits: int = 1) -> str:
    """Return a share in percent, or a dash."""
    return "-" if value is None else f"{100.0 * value:.{digits}f}"


def quantiles(drawn: Array) -> tuple[float, float]:
    """Return the ends of the 95 % interval of drawn values (n,)."""
    low, high = np.quantile(drawn, [0.5 - CONFIDENCE / 2.0, 0.5 + CONFIDENCE / 2.0])
    return float(low), float(high)


def drawn_means(values: Array) -> Array:
    """Return means (2000,) of values (seeds, instances), by a bootstrap of both.

    All draws of seeds have the same instances.
    """
    rng = np.random.default_rng(0)
    columns = rng.integers(values.shape[1], size=(RESAMPLES, values.shape[1]))
    seeds = rng.integers(len(values), size=(RESAMPLES, len(values)))
    return np.array(
        [values[np.ix_(*drawn)].mean() for drawn in zip(seeds, columns, strict=True)]
    )


def interval(values: Array, clusters: Sequence[object]) -> tuple[float, float]:
    """Return the 95 % interval of the median of values (n,).

    A bootstrap draws whole clusters of values.
    """
    rng = np.random.default_rng(0)
    groups = [
        values[[k for k, name in enumerate(clusters) if name == one]]
        for one in dict.fromkeys(clusters)
    ]
    drawn = rng.integers(len(groups), size=(RESAMPLES, len(groups)))
    return quantiles(
        np.array(
            [np.median(np.concatenate([groups[k] for k in rows])) for rows in drawn]
        )
    )


def grouped(
    found: Sequence[Row], labels: Callable[[Row], Sequence[str]], names: Sequence[str]
) -> Iterator[str]:
    """Yield the table of rows, with a line for each group of equal `labels`.

    The order is that of the rows. `names` are the heads of the labels.
    """
    groups: dict[tuple[str, ...], list[Row]] = {}
    for row in found:
        groups.setdefault(tuple(labels(row)), []).append(row)
    heads = [
        *names,
        "tracks",
        head_of("error_degrees", "median"),
        "worst",
        head_of("mpjpe_mm", "median"),
    ]
    heads += [
        "95 % interval, mm",
        *map(head_of, SHARES),
        "mean pose, degrees",
        "closest training pose, mm",
    ]
    yield from markdown(
        heads, [[*key, *_cells(mine)] for key, mine in groups.items()], len(names)
    )


def _cells(mine: Sequence[Row]) -> list[str]:
    errors = np.array([row["error_degrees"]["mean"] for row in mine])
    distances = np.array([row["mpjpe_mm"] for row in mine])
    motions = [row["spec"]["motion"] for row in mine]
    low, high = interval(distances, motions)
    spread = ""
    if len(set(motions)) > 1:
        spread = f"{number('mpjpe_mm', low)} to {number('mpjpe_mm', high)}"
    return [
        str(len(mine)),
        number("error_degrees", float(np.median(errors))),
        number("error_degrees", float(errors.max())),
        number("mpjpe_mm", float(np.median(distances))),
        spread,
        *(percent(float(np.mean([row[name] for row in mine]))) for name in SHARES),
        f"{np.median([row['baselines_degrees']['mean_pose'] for row in mine]):.1f}",
        f"{np.median([row['baselines_mm']['nearest'] for row in mine]):.0f}",
    ]


def field_text(row: Row, field: str) -> str:
    """Return a field of a row's cell as a label; a dash if it has the default."""
    value = row["spec"].get(field)
    if isinstance(value, Mapping) and value:
        return ", ".join(
            f"{name} {one:g}" if isinstance(one, float) else f"{name} {one}"
            for name, one in value.items()
        )
    if isinstance(value, list | tuple):
        return ", ".join(
            Path(one).stem if isinstance(one, str) else f"{one:g}" for one in value
        )
    if isinstance(value, str) and value:
        return Path(value).stem
    return f"{value:g}" if isinstance(value, int | float) else "-"


@click.command(cls=Command, help=__doc__)
@click.argument("plan", type=click.Path(exists=True, dir_okay=False))
@click.option(
    "--by",
    multiple=True,
    metavar="FIELD",
    help="A field by which to group cells. Repeatable.",
)
@click.option(
    "--clips",
    envvar="POSEFIT_CMU",
    metavar="DIR",
    help="Folder of CMU clips, to which the plan's paths are relative.",
)
@LEDGER
@WORKERS
def main(
    plan: str,
    by: tuple[str, ...],
    clips: str | None,
    ledger: str | None,
    workers: int | None,
) -> None:
    path = Path(plan).resolve()
    folder = ledger and str(Path(ledger).resolve())
    if clips:
        os.chdir(clips)
    names = by or ("method", "motion")
    found = rows(Plan.read(path), workers, folder)
    for line in grouped(
        found, lambda row: [field_text(row, name) for name in names], names
    ):
        click.echo(line)


if __name__ == "__main__":
    main()
