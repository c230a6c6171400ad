"""What the agents' rows come to: normalised scores with intervals, and learning curves."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from agents.design import TASKS
from posefit.arrays import Array

Row = Mapping[str, Any]

RESAMPLES, LEVEL, SALT = 2000, 0.95, 67
LEAST_GAP = 0.1  # of a cost, between random search and what is best known: an instance without one says nothing


def agent_tables(rows: Sequence[Row]) -> dict[str, Any]:
    """Return for each environment its agents' scores: 0 is random search on the instance, 1 what is best known.

    What is best known is the lowest cost in any row. A score is the mean over seeds and instances; its interval is a
    bootstrap of seeds and instances, each drawn anew. `steps` are those of training that were taken, `taken` of a row.
    """
    return {"tables": {task: _table([row for row in rows if row["task"] == task]) for task in _tasks(rows)}}


def _tasks(rows: Sequence[Row]) -> list[str]:
    return [task for task in TASKS if any(row["task"] == task for row in rows)]


def _table(rows: Sequence[Row]) -> list[dict[str, Any]]:
    costs = {name: np.array([row["costs"] for row in rows if row["agent"] == name]) for name in _agents(rows)}
    chance = costs["random search"].mean(axis=0)
    best = np.concatenate(list(costs.values())).min(axis=0)
    told = []
    for name, found in costs.items():
        scores = normalised(found, chance, best)
        low, high = score_interval(scores)
        mine = [row for row in rows if row["agent"] == name]
        told.append(
            {
                "agent": name,
                "steps": mine[0]["taken"],
                "seeds": len(found),
                "cost": float(found.mean()),
                "median_cost": float(np.median(found)),
                "score": float(scores.mean()),
                "low": low,
                "high": high,
                "minutes": float(np.mean([row["minutes"] for row in mine])),
                "curve": _curve([row["curve"] for row in mine], chance, best),
            }
        )
    return sorted(told, key=lambda one: one["score"])


def _agents(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(row["agent"] for row in rows))


def normalised(costs: Array, chance: Array, best: Array) -> Array:
    """Return scores (seeds, instances) of costs: 0 is `chance` (instances,), 1 is `best`.

    Instances where both are nearly equal are left out. Raises ValueError where all are.
    """
    apart = chance - best >= LEAST_GAP
    if not apart.any():
        raise ValueError(f"best known must lie below random search, got none of {len(best)} instances that do")
    return ((chance - costs) / np.where(apart, chance - best, 1.0))[:, apart]


def score_interval(scores: Array) -> tuple[float, float]:
    """Return the ends of the 95 % interval of the mean of scores (seeds, instances), by a bootstrap of both."""
    rng = np.random.default_rng(SALT)
    seeds, instances = scores.shape
    one = rng.integers(seeds, size=(RESAMPLES, seeds))
    other = rng.integers(instances, size=(RESAMPLES, instances))
    means = [scores[np.ix_(rows, columns)].mean() for rows, columns in zip(one, other, strict=True)]
    low, high = np.quantile(means, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0])
    return float(low), float(high)


def _curve(curves: Sequence[Any], chance: Array, best: Array) -> list[dict[str, float]]:
    """Return the score at each look of all seeds, with its interval."""
    told = []
    for looks in zip(*curves, strict=False):
        costs = np.array([costs for _, costs in looks])
        few = costs.shape[1]
        scores = normalised(costs, chance[:few], best[:few])
        low, high = score_interval(scores)
        steps = float(np.mean([steps for steps, _ in looks]))
        told.append({"steps": steps, "score": float(scores.mean()), "low": low, "high": high})
    return told


def agents_lines(told: Mapping[str, Any]) -> Iterator[str]:
    """Yield the tables as they are printed."""
    for task, table in told["tables"].items():
        yield f"{TASKS[task].name}, {TASKS[task].evaluations} evaluations, {told['instances']} held-out instances"
        yield ""
        yield "| agent | trained steps | seeds | score | 95 % interval | mean cost | median cost | minutes |"
        yield "|---|---:|---:|---:|---:|---:|---:|---:|"
        for one in table:
            interval = f"{one['low']:.3f} to {one['high']:.3f}"
            cells = [one["agent"], str(one["steps"]), str(one["seeds"]), f"{one['score']:.3f}", interval]
            cells += [f"{one['cost']:.2f}", f"{one['median_cost']:.2f}", f"{one['minutes']:.1f}"]
            yield f"| {' | '.join(cells)} |"
        yield ""
        for one in table:
            if one["curve"]:
                looks = ", ".join(
                    f"{look['steps']:.0f}: {look['score']:.2f} ({look['low']:.2f} to {look['high']:.2f})"
                    for look in one["curve"]
                )
                yield f"{one['agent']} learns: {looks}"
        yield ""
