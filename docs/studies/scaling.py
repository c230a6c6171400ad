"""The cost of a pose by picture size, number of views, dimensions and population.

Each is the benchmark's problem with one number changed, on one thread. Figures are
microseconds per pose in the fastest run.
"""

from functools import partial

import click
import numpy as np

from posefit.fitting.box import draw_population
from posefit_reproduce.bench.kernel import bench_cost, fastest

POSES = 400
WIDTHS = (80, 160, 320, 640, 1280)
VIEWS = (1, 2, 4, 8)
COMPONENTS = (3, 6, 12, 24, 48)
POPULATIONS = (1, 4, 10, 40, 400)


@click.command()
def main() -> None:
    """Print the four curves."""
    usual = bench_cost()
    curves = {
        "width, pixels": {width: bench_cost(width=width) for width in WIDTHS},
        "views": {views: bench_cost(views=views) for views in VIEWS},
        "dimensions": {m + 3: bench_cost(components=m) for m in COMPONENTS},
        "population": dict.fromkeys(POPULATIONS, usual),
    }
    for name, costs_of in curves.items():
        counts = {x: x if name == "population" else POSES for x in costs_of}
        jobs = {
            str(x): partial(
                own,
                draw_population(own.space, np.random.default_rng(0), counts[x]),
            )
            for x, own in costs_of.items()
        }
        took = fastest(jobs)
        costs = {x: 1e6 * took[str(x)] / counts[x] for x in costs_of}
        click.echo(
            f"| {name} | "
            + " | ".join(f"{x}: {cost:.3g}" for x, cost in costs.items())
            + " |"
        )


if __name__ == "__main__":
    main()
