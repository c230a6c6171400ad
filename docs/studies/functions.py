"""Features and slices of the suite's functions, and which methods reach which targets.

    python docs/studies/functions.py --picture functions.jpg

It prints two tables. The first has the features of each function, and of bbob's for
comparison. The second has the share of targets that each method reaches after each
budget, in percent, and which method leads. The picture shows a slice through each
function.

The features use only costs in the box [-1, 1]^d. Random points are sampled like a first
population: feasible, and around the start if there is one. The optimum is the lowest
known cost: the suite's, or that of a descent. A descent is a CMA-ES from a random
point, without restarts. A point is near the optimum if it costs at most the *level*.
The level is the median cost of points that are `NEAR` half-sides per coordinate off the
optimum, so that the scale of costs does not matter. Noise is included except in
`conditioning`, and in deciding where a descent has ended.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Any

import click
import cv2
import numpy as np
from scipy.stats import spearmanr

from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.files import check_new
from posefit.fitting.box import draw_population
from posefit.fitting.cma import Strategy, default_population_size
from posefit.motion.instances import HELD_OUT
from posefit.suites.functions import FUNCTIONS, SUITE, suite_function
from posefit.suites.problem import suite
from posefit.suites.running import run_on
from posefit_reproduce.jobs import each
from table import WORKERS, bar, markdown

METHODS = ("cma", "scipy", "pso", "sapso", "annealed")  # scipy: differential evolution
BUDGETS = (10, 100, 1000, 10_000)  # evaluations for each dimension
INSTANCES = 8  # instances of each function
BBOB = (1, 2, 3, 6, 8, 10, 13, 15, 16, 17, 21, 24)
# random points; descents, and their evaluations for each dimension
POINTS = 1000
DESCENTS = 10
LONGEST = 1000
# half-sides a coordinate: near the optimum; a step
NEAR = 0.01
STEP = 0.1
DESCENT = 0.2  # first step of a descent, in half-sides a coordinate
# rounds of `conditioning`, and the range of change of an axis in one
ROUNDS = 8
REACH = 2.0 ** np.arange(-4.0, 4.01, 0.5)
WAY = np.linspace(0.0, 1.0, 101)[:, None]
# a slice: its pixels, its reach in distances to the next basin; slices in a row
TILE = 220
WINDOW = 1.3
ACROSS = 3

Cost = Callable[[Array], Array]
Row = Mapping[str, float]  # a function's features
Key = tuple[int, int]  # function, dimension
Shares = dict[str, list[float]]  # shares or costs by method, after each budget
COMPARED = (
    "conditioning",
    "elsewhere",
    "interaction",
    "ruggedness",
    "rises",
    "distance",
    "noise",
)


def descent(
    cost: Cost, start: Array, step: float, rng: np.random.Generator
) -> tuple[float, Array]:
    """Return the best cost of a CMA-ES without restarts, and its point (d,)."""
    d = len(start)
    search = Strategy(start, np.full(d, step), default_population_size(d))
    least = np.inf
    best = start
    used = 0
    while used < LONGEST * d and not search.ended():
        points = np.clip(search.sample(rng, default_population_size(d)), -1.0, 1.0)
        costs = cost(points)
        search.learn(points, costs)
        used += len(points)
        if costs.min() < least:
            least = float(costs.min())
            best = points[costs.argmin()].copy()
    return least, best


def conditioning(
    cost: Cost, best: Array, level: float, rng: np.random.Generator
) -> float:
    """Return the squared ratio of longest and shortest axis of the optimum's level set.

    For a quadratic function that is the condition number of its Hessian. In every round
    an ellipsoid is fitted to the points at which random directions, stretched by the
    current axes, reach the level.
    """
    d = len(best)
    ratios = []
    axes = NEAR * np.eye(d)
    upper = np.triu_indices(d)
    for _ in range(ROUNDS):
        turned = rng.standard_normal((2 * d * d, d))
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        # on an ellipsoid 1 / distance^2 is a quadratic form of the direction: fit it
        rows = turned[:, upper[0]] * turned[:, upper[1]]
        inverse = np.mean(
            [
                _distance(cost, best, sign * turned @ axes.T, level) ** -2.0
                for sign in (1.0, -1.0)
            ],
            axis=0,
        )
        matrix = np.zeros((d, d))
        matrix[upper] = 0.5 * np.linalg.lstsq(rows, inverse, rcond=None)[0]
        values, vectors = np.linalg.eigh(matrix + matrix.T)
        axes = axes @ vectors / np.sqrt(values.clip(values[-1] / 30.0))
        lengths = np.linalg.svd(axes, compute_uv=False)
        ratios.append(2.0 * np.log(lengths[0] / lengths[-1]))
    # the first half of the rounds only finds the axes
    return float(np.exp(np.mean(ratios[ROUNDS // 2 :])))


def _distance(cost: Cost, best: Array, ways: Array, level: float) -> Array:
    """Return the distance at which each way (n, d) from the optimum meets the level.

    It is 1/16 to 16; a way that does not meet it has the distance to the box.
    """
    costs = cost(
        (best + ways[:, None] * REACH[:, None]).reshape(-1, len(best))
    ).reshape(len(ways), -1)
    # the first distance at the level or above it, and the one before
    over = costs >= level
    k = over.argmax(axis=1).clip(1)
    n = np.arange(len(ways))
    low = costs[n, k - 1]
    high = costs[n, k]
    part = ((level - low) / np.maximum(high - low, 1e-300)).clip(0.0, 1.0)
    met = REACH[k - 1] + part * (REACH[k] - REACH[k - 1])
    return np.asarray(
        np.where(
            over.any(axis=1), met, np.minimum(REACH[-1], 1.0 / np.abs(ways).max(axis=1))
        )
    )


def features(
    cost: Cost, noise_free: Cost, known: Array, points: Array, rng: np.random.Generator
) -> tuple[Row, list[tuple[float, Array]]]:
    """Return the features of a function, and the best cost and point of each basin.

    The optimum's basin is first. `known` (d,) is the optimum or a point near it;
    `points` (n, d) are random.
    """
    d = len(known)
    costs = cost(points)
    ends = [descent(cost, start, DESCENT, rng) for start in points[:DESCENTS]]
    near = descent(noise_free, known, NEAR, rng)
    placed = [
        (float(noise_free(point[None])[0]), point)
        for point in (known, near[1], *(point for _, point in ends))
    ]
    least, best = min(placed, key=lambda end: end[0])
    off = rng.standard_normal((POINTS, d))
    off *= np.sqrt(d) / np.linalg.norm(off, axis=1, keepdims=True)
    level = float(np.median(noise_free(best + NEAR * off)))
    basins = [(least, best)]
    arrived = 0
    for value, point in sorted(placed[2:], key=lambda end: end[0]):
        # the highest cost on the way to each basin
        tops = [
            float(noise_free(place + WAY * (point - place)).max())
            for _, place in basins
        ]
        free = [
            top <= max(value, below) + level - least
            for top, (below, _) in zip(tops, basins, strict=True)
        ]
        arrived += free[0] and value <= level
        if not any(free):
            basins.append((value, point))
    rows = np.arange(POINTS)
    pairs = rng.permuted(np.tile(np.arange(d), (POINTS, 1)), axis=1)[:, :2].T
    moved = np.repeat(points[None], 3, axis=0)  # one coordinate, another, both
    for k, (coordinate, way) in enumerate(
        zip(pairs, 0.25 * rng.choice([-1.0, 1.0], (2, POINTS)), strict=True)
    ):
        moved[k, rows, coordinate] += way
        moved[2, rows, coordinate] += way
    one, other, both = cost(moved.reshape(-1, d)).reshape(3, POINTS) - costs
    again = cost(np.tile(best, (POINTS, 1)))
    way = np.diff(
        cost(
            (points[:200, None] + WAY * (best - points[:200, None])).reshape(-1, d)
        ).reshape(200, -1)
    )
    return {
        "conditioning": conditioning(noise_free, best, level, rng),
        "elsewhere": 1.0 - arrived / DESCENTS,
        "basins": len(basins),
        "interaction": float(
            np.abs(both - one - other).sum() / (np.abs(one) + np.abs(other)).sum()
        ),
        "ruggedness": 1.0
        - float(spearmanr(costs, cost(points + STEP * off)).statistic),
        "rises": float(way.clip(0.0).sum() / np.abs(way).sum()),
        "distance": float(
            spearmanr(costs, np.linalg.norm(points - best, axis=1)).statistic
        ),
        "noise": float((again - again[0]).std() / costs.std()),
    }, basins


def bbob(number: int, dimension: int) -> Row:
    """Return the features of a function of bbob."""
    import ioh

    problem = ioh.get_problem(number, instance=1, dimension=dimension)

    def cost(points: Array) -> Array:
        # its box is [-5, 5]^d
        return np.array([problem(point) for point in 5.0 * points])

    rng = np.random.default_rng([1, number])
    points = rng.uniform(-1.0, 1.0, (POINTS, dimension))
    return features(
        cost, cost, np.array(problem.optimum.x, np.float64) / 5.0, points, rng
    )[0]


def measured(
    number: int, instance: int, dimension: int
) -> tuple[Row, Array, Shares, Array]:
    """Return a problem's features, targets, costs by method and budget, and a slice.

    Each budget is a separate search, because some methods plan ahead. A method that has
    reached the last target is not run again.
    """
    problem = suite(SUITE, number, instance, dimension)
    rng = np.random.default_rng([instance, number])
    points = draw_population(problem.space, rng, POINTS)
    truth = np.array(problem.made.truth)
    row, basins = features(problem, problem.noise_free, truth, points, rng)
    reached: Shares = {name: [] for name in METHODS}
    for method, costs in reached.items():
        problem.reset()
        for budget in BUDGETS:
            if not problem.final_target_hit:
                problem.reset()
                run_on(problem, method, evaluations=budget * dimension)
            costs.append(problem.best_observed_fvalue1)
    return (
        row,
        problem.targets,
        reached,
        sliced(problem.noise_free, basins, rng, f"{number} {problem.function.name}"),
    )


def sliced(
    cost: Cost, basins: list[tuple[float, Array]], rng: np.random.Generator, title: str
) -> Array:
    """Return a picture (TILE, TILE, 3) of a plane through the optimum, in bands.

    The plane also passes through the best points of two other basins.
    """
    least, best = basins[0]
    others = [point - best for _, point in basins[1:3]]
    spans = np.array([*others, *rng.uniform(-1.0, 1.0, (2 - len(others), len(best)))]).T
    plane, _ = np.linalg.qr(spans)
    scale = WINDOW * np.linalg.norm(spans[:, 0])
    across = scale * np.linspace(-1.0, 1.0, TILE)
    grid = np.stack(np.meshgrid(across, across[::-1]), axis=-1).reshape(-1, 2)
    # each band spans a doubling of the cost
    doubled = np.log2((cost(best + grid @ plane.T) - least).clip(0.25)).round()
    shade = (
        np.rint(255.0 * (doubled + 2.0) / 8.0)
        .clip(0, 255)
        .astype(np.uint8)
        .reshape(TILE, TILE)
    )
    image = np.asarray(cv2.applyColorMap(255 - shade, cv2.COLORMAP_VIRIDIS))
    for k, point in enumerate([np.zeros(len(best)), *others]):
        x, y = (
            np.rint(
                (TILE - 1)
                * 0.5
                * (1.0 + np.array([1.0, -1.0]) * (point @ plane) / scale)
            )
            .astype(int)
            .tolist()
        )
        if k:
            cv2.circle(image, (x, y), 5, (255, 255, 255), 1, cv2.LINE_AA)
        else:
            cv2.drawMarker(image, (x, y), (0, 0, 255), cv2.MARKER_CROSS, 11, 2)
    band = np.full((22, TILE, 3), 255, dtype=np.uint8)
    cv2.putText(
        band, title, (4, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA
    )
    return np.pad(
        np.vstack([band, image]), ((2, 2), (2, 2), (0, 0)), constant_values=255
    )


def shares_of(
    targets: Array, reached: Sequence[Mapping[str, Sequence[float]]]
) -> Shares:
    """Return the shares of targets (n, t) by method after each budget."""
    costs = {name: np.array([one[name] for one in reached]) for name in METHODS}
    return {
        name: (values[..., None] <= targets[:, None]).mean(axis=(0, 2)).tolist()
        for name, values in costs.items()
    }


def medians(rows: Sequence[Row]) -> Row:
    """Return the medians of features, and the mean of `elsewhere`."""
    row = {name: float(np.median([one[name] for one in rows])) for name in rows[0]}
    return {**row, "elsewhere": float(np.mean([one["elsewhere"] for one in rows]))}


def nearest(rows: Mapping[Key, Row], others: Mapping[Key, Row]) -> Iterator[Key]:
    """Yield the most similar other function of the same dimension for each function.

    Features are scaled to a standard deviation of 1 over all functions.
    """
    values = np.array(
        [[row[name] for name in COMPARED] for row in [*rows.values(), *others.values()]]
    )
    values[:, 0] = np.log(values[:, 0])
    values = (values - values.mean(axis=0)) / np.maximum(values.std(axis=0), 1e-9)
    for key, own in zip(rows, values, strict=False):
        away = zip(
            others, np.linalg.norm(values[len(rows) :] - own, axis=1), strict=True
        )
        same = ((distance, other) for other, distance in away if other[1] == key[1])
        yield min(same)[1]


def feature_lines(rows: Mapping[Key, Row], others: Mapping[Key, Row]) -> Iterator[str]:
    """Yield the table of functions' features, with the nearest of bbob."""
    cells = [
        [
            f"{number} {suite_function(number).name}",
            *(
                f"{row['conditioning']:,.0f}",
                f"{100.0 * row['elsewhere']:.0f} %",
                f"{row['basins']:.0f}",
                str(other),
            ),
        ]
        for ((number, _), row), (other, _) in zip(
            rows.items(), nearest(rows, others), strict=True
        )
    ]
    yield from markdown(
        ["function", "conditioning", "end elsewhere", "basins", "nearest of bbob"],
        cells,
    )


def share_lines(shares: Mapping[int, Shares]) -> Iterator[str]:
    """Yield the table of reached targets in percent, by method after each budget."""
    cells = []
    for number, table in shares.items():
        wins = [
            max(METHODS, key=lambda name: table[name][k]) for k in range(len(BUDGETS))
        ]
        texts = [
            " ".join(f"{100.0 * share:.0f}" for share in table[name])
            for name in METHODS
        ]
        cells.append(
            [
                f"{number} {suite_function(number).name}",
                ", ".join(dict.fromkeys(wins)),
                *texts,
            ]
        )
    yield from markdown(["function", "leads", *METHODS], cells, 2)


@click.command(cls=Command, help=__doc__)
@click.option("--picture", metavar="FILE", help="New .jpg for the slices.")
@WORKERS
def main(picture: str | None, workers: int | None) -> None:
    if picture is not None:
        check_new(picture)
    sizes = {function.number: function.dimensions[0] for function in FUNCTIONS}
    problems = {
        number: [(number, instance) for instance in HELD_OUT[:INSTANCES]]
        for number in sizes
    }
    jobs: dict[Any, Any] = {
        key: partial(measured, *key, sizes[key[0]])
        for keys in problems.values()
        for key in keys
    }
    others = {
        ("bbob", n, d): partial(bbob, n, d)
        for d in dict.fromkeys(sizes.values())
        for n in BBOB
    }
    results = each(others | jobs, workers or 1, bar)
    rows = {
        (n, d): medians([results[key][0] for key in problems[n]])
        for n, d in sizes.items()
    }
    click.echo(
        "\n".join([*feature_lines(rows, {key[1:]: results[key] for key in others}), ""])
    )
    shares = {
        number: shares_of(
            np.array([results[key][1] for key in keys]),
            [results[key][2] for key in keys],
        )
        for number, keys in problems.items()
    }
    click.echo("\n".join(share_lines(shares)))
    if picture is not None:
        tiles = [results[keys[0]][-1] for keys in problems.values()]
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % ACROSS)
        whole = np.vstack(
            [np.hstack(tiles[k : k + ACROSS]) for k in range(0, len(tiles), ACROSS)]
        )
        cv2.imwrite(picture, whole, [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
