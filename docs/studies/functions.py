"""What are the functions of the suite? Their features, beside bbob's; slices; which methods reach which targets.

Features ask a function for costs alone, in the box [-1, 1]^d. Points are drawn as a first population is: feasible, and
around the start where there is one. The optimum is the lowest cost of what is known and of where the descents end; they
are CMA-ES from a drawn point, without a restart. What is near costs at most the *level*, the median of points `NEAR`
half-sides a coordinate off the optimum, so that no scale of costs matters. Noise is in all features but in
conditioning, and in what decides where a descent has ended.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

import click
import cv2
import numpy as np
from scipy.stats import rankdata

from posefit.arrays import Array
from posefit.files import check_new
from posefit.fitting.box import draw_population
from posefit.fitting.cma import Strategy, default_population_size
from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE, suite_function
from posefit.suites.problem import suite
from posefit.suites.running import run_on
from posefit_reproduce.jobs import each
from table import WORKERS, bar, markdown

METHODS = ("random", "cma", "scipy", "pso", "sapso", "annealed")  # scipy: differential evolution
BUDGETS = (10, 100, 1000, 10_000)  # evaluations for each dimension
BBOB = (1, 2, 3, 6, 8, 10, 13, 15, 16, 17, 21, 24)
POINTS, DESCENTS, LONGEST = 1000, 10, 1000  # random points; descents, and their evaluations for each dimension
NEAR, STEP, FINE = 0.01, 0.1, 0.001  # half-sides a coordinate: near the optimum; a step; one that may change nothing
DESCENT = 0.2  # half-sides a coordinate, of a descent's first step
ROUNDS, REACH = 8, 2.0 ** np.arange(-4.0, 4.01, 0.5)  # of `conditioning`, and how much an axis may change in one
WAY = np.linspace(0.0, 1.0, 101)[:, None]
TILE, WINDOW, ACROSS = 220, 1.3, 3  # pixels of a slice; how far it goes, in distances to the next basin; in a row

Cost = Callable[[Array], Array]
Shares = dict[str, list[float]]  # of targets, by method, after each budget
Key = tuple[str, int, int, int]  # suite, function, dimension, instance
HEADS = {  # of the features, with how they are written
    "dimension": ("d", "{:.0f}"),
    "infeasible": ("infeasible", "{:.0%}"),
    "conditioning": ("conditioning", "{:,.0f}"),
    "elsewhere": ("end elsewhere", "{:.0%}"),
    "basins": ("basins", "{:.0f}"),
    "interaction": ("interaction", "{:.2f}"),
    "ruggedness": ("ruggedness", "{:.2f}"),
    "rises": ("rises", "{:.1%}"),
    "flat": ("flat", "{:.0%}"),
    "distance": ("distance", "{:.2f}"),
    "noise": ("noise", "{:.2f}"),
    "effort": ("to arrive", "{:,.0f} d"),
}
COMPARED = ("conditioning", "elsewhere", "interaction", "ruggedness", "rises", "distance", "noise")


def descent(cost: Cost, start: Array, step: float, rng: np.random.Generator) -> tuple[float, Array, int]:
    """Return the best cost of a CMA-ES without restarts, its point (d,), and the evaluations."""
    d = len(start)
    search, least, best, used = Strategy(start, np.full(d, step), default_population_size(d)), np.inf, start, 0
    while used < LONGEST * d and not search.ended():
        points = np.clip(search.sample(rng, default_population_size(d)), -1.0, 1.0)
        costs = cost(points)
        search.learn(points, costs)
        used += len(points)
        if costs.min() < least:
            least, best = float(costs.min()), points[costs.argmin()].copy()
    return least, best, used


def conditioning(cost: Cost, best: Array, level: float, rng: np.random.Generator) -> float:
    """Return the squared ratio of the longest axis to the shortest of the set around an optimum that costs the level.

    Of a quadratic function that is the condition number of its Hessian. In every round an ellipsoid is fitted to where
    random directions, stretched by the axes so far, meet the level.
    """
    d, ratios = len(best), []
    axes = NEAR * np.eye(d)
    upper = np.triu_indices(d)
    for _ in range(ROUNDS):
        turned = rng.standard_normal((2 * d * d, d))
        turned /= np.linalg.norm(turned, axis=1, keepdims=True)
        rows = turned[:, upper[0]] * turned[:, upper[1]]
        inverse = np.mean(
            [_distance(cost, best, sign * turned @ axes.T, level) ** -2.0 for sign in (1.0, -1.0)], axis=0
        )
        matrix = np.zeros((d, d))
        matrix[upper] = 0.5 * np.linalg.lstsq(rows, inverse, rcond=None)[0]
        values, vectors = np.linalg.eigh(matrix + matrix.T)
        axes = axes @ vectors / np.sqrt(values.clip(values[-1] / 30.0))
        lengths = np.linalg.svd(axes, compute_uv=False)
        ratios.append(2.0 * np.log(lengths[0] / lengths[-1]))
    return float(np.exp(np.mean(ratios[ROUNDS // 2 :])))


def _distance(cost: Cost, best: Array, ways: Array, level: float) -> Array:
    """Return where each way (n, d) from the optimum meets the level first, from 1/16 to 16, or the box's size."""
    costs = cost((best + ways[:, None] * REACH[:, None]).reshape(-1, len(best))).reshape(len(ways), -1)
    over = costs >= level
    k, n = over.argmax(axis=1).clip(1), np.arange(len(ways))
    low, high = costs[n, k - 1], costs[n, k]
    part = ((level - low) / np.maximum(high - low, 1e-300)).clip(0.0, 1.0)
    met = REACH[k - 1] + part * (REACH[k] - REACH[k - 1])
    return np.where(over.any(axis=1), met, np.minimum(REACH[-1], 1.0 / np.abs(ways).max(axis=1)))


def correlation(first: Array, second: Array) -> float:
    """Return the correlation of ranks."""
    return float(np.corrcoef(rankdata(first), rankdata(second))[0, 1])


def features(
    cost: Cost, noise_free: Cost, known: Array, points: Array, rng: np.random.Generator
) -> tuple[dict[str, float], list[tuple[float, Array]]]:
    """Return the features of a function, and the best cost and point of each basin, the optimum's first.

    `known` (d,) is the optimum, or a point near it; `points` (n, d) are drawn at random.
    """
    d = len(known)
    costs = cost(points)
    ends = [descent(cost, start, DESCENT, rng) for start in points[:DESCENTS]]
    near = descent(noise_free, known, NEAR, rng)
    placed = [(float(noise_free(point[None])[0]), point) for point in (known, near[1], *(end[1] for end in ends))]
    least, best = min(placed, key=lambda end: end[0])
    off = rng.standard_normal((POINTS, d))
    off *= np.sqrt(d) / np.linalg.norm(off, axis=1, keepdims=True)
    level = float(np.median(noise_free(best + NEAR * off)))
    basins = [(least, best)]
    arrived = 0
    for value, point in sorted(placed[2:], key=lambda end: end[0]):
        tops = [float(noise_free(place + WAY * (point - place)).max()) for _, place in basins]  # on the way to each
        free = [top <= max(value, below) + level - least for top, (below, _) in zip(tops, basins, strict=True)]
        arrived += free[0] and value <= level
        if not any(free):
            basins.append((value, point))
    rows, pairs = np.arange(POINTS), rng.permuted(np.tile(np.arange(d), (POINTS, 1)), axis=1)[:, :2].T
    moved = np.repeat(points[None], 3, axis=0)  # one coordinate, another one, both
    for k, (coordinate, way) in enumerate(zip(pairs, 0.25 * rng.choice([-1.0, 1.0], (2, POINTS)), strict=True)):
        moved[k, rows, coordinate] += way
        moved[2, rows, coordinate] += way
    one, other, both = cost(moved.reshape(-1, d)).reshape(3, POINTS) - costs
    again = cost(np.tile(best, (POINTS, 1)))
    way = np.diff(cost((points[:200, None] + WAY * (best - points[:200, None])).reshape(-1, d)).reshape(200, -1))
    return {
        "dimension": d,
        "conditioning": conditioning(noise_free, best, level, rng),
        "elsewhere": 1.0 - arrived / DESCENTS,
        "basins": len(basins),
        "interaction": float(np.abs(both - one - other).sum() / (np.abs(one) + np.abs(other)).sum()),
        "ruggedness": 1.0 - correlation(costs, cost(points + STEP * off)),
        "rises": float(way.clip(0.0).sum() / np.abs(way).sum()),
        "flat": float((cost(points + FINE * off) == costs).mean()),
        "distance": correlation(costs, np.linalg.norm(points - best, axis=1)),
        "evaluations": float(np.mean([used for *_, used in ends])) / d,
        "noise": float((again - again[0]).std() / costs.std()),
    }, basins


def bbob(number: int, dimension: int, instance: int) -> dict[str, float]:
    """Return the features of a function of bbob."""
    import ioh

    problem = ioh.get_problem(number, instance=instance, dimension=dimension)

    def cost(points: Array) -> Array:
        return np.array([problem(point) for point in 5.0 * points])  # its box is [-5, 5]^d

    rng = np.random.default_rng([instance, number])
    points = rng.uniform(-1.0, 1.0, (POINTS, dimension))
    row, _ = features(cost, cost, np.array(problem.optimum.x) / 5.0, points, rng)
    return {**row, "infeasible": 0.0}


def measured(
    number: int, dimension: int, instance: int
) -> tuple[dict[str, float], Array, dict[str, list[float]], Array]:
    """Return a problem's features, its targets, the costs by method after each of the budgets, and a slice.

    Each budget is a search of its own, as some methods plan ahead; what has reached the last target is not repeated.
    """
    problem, rng = suite(SUITE, number, instance, dimension), np.random.default_rng([instance, number])
    points, truth = draw_population(problem.space, rng, POINTS), np.array(problem.made.truth)
    row, basins = features(problem.evaluate, problem.noise_free, truth, points, rng)
    row["infeasible"] = float(1.0 - problem.space.feasible(rng.uniform(-1.0, 1.0, (POINTS, dimension))).mean())
    reached: dict[str, list[float]] = {name: [] for name in METHODS}
    for method, costs in reached.items():
        problem.reset()
        for budget in BUDGETS:
            if not problem.final_target_hit:
                problem.reset()
                run_on(problem, method, evaluations=budget * dimension)
            costs.append(problem.best_observed_fvalue1)
    return row, problem.targets, reached, sliced(problem.noise_free, basins, rng, f"{number} {problem.function.name}")


def sliced(cost: Cost, basins: list[tuple[float, Array]], rng: np.random.Generator, title: str) -> Array:
    """Return a picture (TILE, TILE, 3) of the plane through the optimum and the best of two other basins, in bands."""
    (least, best), others = basins[0], [point - basins[0][1] for _, point in basins[1:3]]
    spans = np.array([*others, *rng.uniform(-1.0, 1.0, (2 - len(others), len(best)))]).T
    plane, _ = np.linalg.qr(spans)
    scale = WINDOW * np.linalg.norm(spans[:, 0])
    across = scale * np.linspace(-1.0, 1.0, TILE)
    grid = np.stack(np.meshgrid(across, across[::-1]), axis=-1).reshape(-1, 2)
    doubled = np.log2((cost(best + grid @ plane.T) - least).clip(0.25)).round()  # bands from one doubling to the next
    shade = np.rint(255.0 * (doubled + 2.0) / 8.0).clip(0, 255).astype(np.uint8).reshape(TILE, TILE)
    image = np.asarray(cv2.applyColorMap(255 - shade, cv2.COLORMAP_VIRIDIS))
    for k, point in enumerate([np.zeros(len(best)), *others]):
        x, y = np.rint((TILE - 1) * 0.5 * (1.0 + np.array([1.0, -1.0]) * (point @ plane) / scale)).astype(int).tolist()
        if k:
            cv2.circle(image, (x, y), 5, (255, 255, 255), 1, cv2.LINE_AA)
        else:
            cv2.drawMarker(image, (x, y), (0, 0, 255), cv2.MARKER_CROSS, 11, 2)
    band = np.full((22, TILE, 3), 255, dtype=np.uint8)
    cv2.putText(band, title, (4, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.45, (0, 0, 0), 1, cv2.LINE_AA)
    return np.pad(np.vstack([band, image]), ((2, 2), (2, 2), (0, 0)), constant_values=255)


def shares_of(targets: Array, reached: Sequence[Mapping[str, Sequence[float]]]) -> Shares:
    """Return the shares of targets (n, t) by method after each budget, and those of the best of all methods."""
    costs = {name: np.array([one[name] for one in reached]) for name in METHODS}
    costs["best of all"] = np.min(list(costs.values()), axis=0)
    return {name: (values[..., None] <= targets[:, None]).mean(axis=(0, 2)).tolist() for name, values in costs.items()}


def medians(rows: Sequence[Mapping[str, float]]) -> dict[str, float]:
    """Return the medians of features, the mean share of descents, and the evaluations for each dimension it takes."""
    row = {name: float(np.median([one[name] for one in rows])) for name in rows[0]}
    row["elsewhere"] = float(np.mean([one["elsewhere"] for one in rows]))
    arrived = 1.0 - row["elsewhere"]
    return {**row, "effort": row["evaluations"] / arrived if arrived else np.inf}


def compared(rows: Sequence[Mapping[str, float]]) -> Array:
    """Return the features (n, f) that functions are compared by, each with a deviation of 1."""
    values = np.array([[row[name] for name in COMPARED] for row in rows])
    values[:, 0] = np.log(values[:, 0])
    return np.asarray((values - values.mean(axis=0)) / np.maximum(values.std(axis=0), 1e-9))


def nearest(keys: Sequence[Key], rows: Sequence[Mapping[str, float]], suites: Sequence[str]) -> dict[Key, Key]:
    """Return of each function, or instance, the nearest other of some suites in as many dimensions, if any."""
    values, neighbours = compared(rows), {}
    for key, value in zip(keys, values, strict=True):
        others = [n for n, one in enumerate(keys) if one != key and one[0] in suites and one[2] == key[2]]
        if others:
            neighbours[key] = keys[min(others, key=lambda n: float(np.linalg.norm(values[n] - value)))]
    return neighbours


def feature_lines(rows: Mapping[Key, Mapping[str, float]]) -> Iterator[str]:
    """Yield the table of functions' features."""
    near = nearest(list(rows), list(rows.values()), ["bbob"])
    cells = []
    for key, row in rows.items():
        name = f"{key[1]} {suite_function(key[1]).name}" if key[0] == SUITE else f"bbob {key[1]}"
        texts = [form.format(row[feature]).replace("%", " %") for feature, (_, form) in HEADS.items()]
        cells.append([name, *texts, str(near[key][1]) if key[0] == SUITE and key in near else ""])
    yield from markdown(["function", *(head for head, _ in HEADS.values()), "nearest of bbob"], cells)


def share_lines(shares: Mapping[int, Shares]) -> Iterator[str]:
    """Yield the table of targets reached, of each function in percent by method after each budget."""
    cells = []
    for number, table in shares.items():
        wins = [max(METHODS, key=lambda name: table[name][k]) for k in range(len(BUDGETS))]
        texts = [" ".join(f"{100.0 * share:.0f}" for share in table[name]) for name in (*METHODS, "best of all")]
        cells.append([f"{number} {suite_function(number).name}", ", ".join(dict.fromkeys(wins)), *texts])
    yield from markdown(["function", "leads", *METHODS, "best of all"], cells, 2)


@click.command(help=__doc__)
@click.option("--function", "functions", type=int, multiple=True, help="Its number; repeatable, by default each.")
@click.option("--dimension", type=int, help="Of all functions; by default the lowest of each.")
@click.option("--instances", type=click.IntRange(1), default=8, show_default=True, help="Of each, held out ones.")
@click.option("--picture", metavar="FILE", help="New .jpg of slices.")
@WORKERS
def main(
    functions: tuple[int, ...], dimension: int | None, instances: int, picture: str | None, workers: int | None
) -> None:
    if picture is not None:
        check_new(picture)
    chosen = [suite_function(number) for number in functions] or FUNCTIONS
    sizes = {
        one.number: dimension or one.dimensions[0]
        for one in chosen
        if (dimension or one.dimensions[0]) in one.dimensions
    }
    if not sizes:
        raise click.UsageError(f"dimension must be one that a chosen function has, got {dimension}")
    problems = [(SUITE, number, d, instance) for number, d in sizes.items() for instance in HELD_OUT[:instances]]
    others = [("bbob", number, d, 1) for d in dict.fromkeys(sizes.values()) for number in BBOB if find_spec("ioh")]
    jobs: dict[Key, Any] = {key: partial(measured, *key[1:]) for key in problems}
    results = each(jobs | {key: partial(bbob, *key[1:]) for key in others}, workers or 1, bar)
    own_features = {key: results[key][0] for key in problems}
    rows = {(SUITE, n, d, 0): medians([own_features[key] for key in problems if key[1] == n]) for n, d in sizes.items()}
    click.echo("\n".join(feature_lines(rows | {key: medians([results[key]]) for key in others})))
    near = nearest(problems, list(own_features.values()), [SUITE])
    own = {number: sum(key[1] == number == other[1] for key, other in near.items()) for number in sizes}
    texts = [f"{count} of function {number}" for number, count in own.items()]
    click.echo(f"\nInstances nearest to one of their own function, of {instances} each: {', '.join(texts)}")
    shares = {}
    for number in sizes:
        mine = [results[key] for key in problems if key[1] == number]
        shares[number] = shares_of(np.array([one[1] for one in mine]), [one[2] for one in mine])
    click.echo("\n".join(share_lines(shares)))
    if picture is not None:
        tiles = [results[SUITE, number, d, HELD_OUT[0]][-1] for number, d in sizes.items()]
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % ACROSS)
        whole = np.vstack([np.hstack(tiles[k : k + ACROSS]) for k in range(0, len(tiles), ACROSS)])
        cv2.imwrite(picture, whole, [cv2.IMWRITE_JPEG_QUALITY, 85])


if __name__ == "__main__":
    main()
