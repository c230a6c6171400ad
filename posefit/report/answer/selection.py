"""Who wins where, and what it would be worth to choose a method by its instance.

Errors of an instance are a method's mean over its seeds; all figures here are means over instances, as a choice is made
once for each. Three ways of choosing are told apart:

- the *single best* method has the lowest mean over all instances;
- the *oracle* takes the best method of each instance. It looks at the very errors that it is scored by, so it is also
  told what it is where each seed is scored by the method that was best on the other seeds;
- a *selector* knows what a plan says of an instance: its motion, views, damage and the like. It is a regression tree of
  all methods' errors, trained on other instances alone; how deep it is has been chosen on these too, by folds of their
  own. A tree of depth 0 is the single best method: that is what a selector falls back to that has learnt nothing.
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.report.contest import Contest
from posefit.report.runs import Runs

DEPTHS = (0, 1, 2, 3, 5)  # of trees that a selector is chosen from
LEAF = 2  # instances that a leaf of a tree has at least
LEAST, MOST = 8, 500  # instances, below which there is no selector, and of which it is trained at most
FOLDS, INNER_FOLDS, EACH = 10, 5, 20  # up to so many instances each is a fold of its own
PARTS = 12  # rows of who wins where
FOLD_SEED = 2013
_NOT_KNOWN = ("instance", "files", "train")  # of a plan's fields: numbers and names of files say nothing


def selection_of(contest: Contest) -> dict[str, Any] | None:
    """Return who wins where and what choosing is worth; None of fewer than two methods or instances.

    `single`, `oracle`, `oracle_apart` (None of one seed) and `selector` (None where there is none, `why` says so) are
    mean errors in degrees; `closed` is the share of the gap between single best and oracle that the selector closes,
    None where there is no gap. `wins` has of each method on how many instances it is the best, and `where` of each part
    of the instances who is, and by how much the single best method is behind.
    """
    methods, instances, seeds = contest.rows.shape
    if methods < 2 or instances < 2:
        return None
    runs = contest.of("error")
    errors = runs.mean(axis=2).T
    best = int(errors.mean(axis=0).argmin())
    single, oracle = float(errors[:, best].mean()), float(errors.min(axis=1).mean())
    names, features = features_of(contest.runs, contest.instances)
    drawn = _drawn(instances)
    why, selector, picks = _why_not(instances, names), None, Counter[int]()
    if not why:
        chosen = selected(features[drawn], errors[drawn])
        # of some of the instances: what it gains on them, held against all
        selector = single + float(errors[drawn, chosen].mean() - errors[drawn, best].mean())
        picks.update(chosen.tolist())
    gap = single - oracle
    won = Counter(errors.argmin(axis=1).tolist())
    return {
        "instances": instances,
        "trained": len(drawn),
        "best": contest.methods[best],
        "single": single,
        "oracle": oracle,
        "oracle_apart": _oracle_apart(runs) if seeds > 1 else None,
        "selector": selector,
        "closed": (single - selector) / gap if selector is not None and gap > 0.0 else None,
        "why": why,
        "features": names,
        "wins": [[contest.methods[m], count, picks[m]] for m, count in won.most_common()],
        "where": _where(contest, errors, best),
    }


def _drawn(count: int) -> Array:
    """Return the instances that a selector is trained of, rising: all, or `MOST` that are drawn.

    Every so many-th would not do: instances come in the order of a plan, whose lists repeat, so that all of them could
    have one view or one damage.
    """
    return np.sort(np.random.default_rng(FOLD_SEED).permutation(count)[:MOST])


def selected(features: Array, errors: Array) -> Array:
    """Return the method (n,) that a selector takes for each instance, which it has never seen.

    `features` (n, d) and `errors` (n, methods) are of instances; each fold of them is chosen for by a tree that was
    trained on the others, whose depth was chosen on the others alone.
    """
    chosen = np.zeros(len(errors), dtype=int)
    for held in _folds(len(errors), len(errors) if len(errors) <= EACH else FOLDS):
        known = np.setdiff1d(np.arange(len(errors)), held)
        depth = _depth(features[known], errors[known])
        chosen[held] = _taken(features[known], errors[known], features[held], depth)
    return chosen


def features_of(runs: Runs, instances: Sequence[int]) -> tuple[list[str], Array]:
    """Return what a plan says of instances, by name and as numbers (n, d): what is the same for all is left out.

    Words, such as a motion's name, are a column each, of 0 and 1; of several views the first counts, by its direction.
    """
    told = [_told(runs.places[i]) for i in instances]
    values = {(name, value) for one in told for name, value in one.items() if isinstance(value, str)}
    words = sorted(values) if len(values) < len(instances) else []
    numbers = sorted({name for one in told for name, value in one.items() if not isinstance(value, str)})
    table = [
        [*(float(one.get(name, 0.0)) for name in numbers), *(float(one.get(name) == value) for name, value in words)]
        for one in told
    ]
    found = np.array(table, dtype=float).reshape(len(told), -1)
    varied = np.flatnonzero(np.ptp(found, axis=0) > 0.0) if len(found) else np.empty(0, dtype=int)
    names = [*numbers, *(name for name, _ in words)]
    return list(dict.fromkeys(names[k].partition(",")[0] for k in varied)), found[:, varied]


def _told(place: Mapping[str, Any]) -> dict[str, float | str]:
    """Return what a plan says of one instance, as numbers and words."""
    view = np.deg2rad(place["view_degrees"][0])
    found: dict[str, float | str] = {
        "view, sine": float(np.sin(view)),
        "view, cosine": float(np.cos(view)),
        "cameras": float(len(place["view_degrees"])),
    }
    found |= {str(kind): float(share) for kind, share in place["corruption"].items()}
    for name, value in place.items():
        if name in _NOT_KNOWN or name in ("view_degrees", "corruption"):
            continue
        if isinstance(value, bool | int | float):
            found[name] = float(value)
        elif isinstance(value, str):
            found[name] = value
        elif name == "size":
            found[name] = float(np.prod(value))
    return found


def _why_not(instances: int, names: Sequence[str]) -> str:
    """Return why there is no selector, nothing where there may be one."""
    if instances < LEAST:
        return f"{instances} instances are too few to train a selector: at least {LEAST}"
    return "" if names else "the plan says the same of every instance, so that a selector has nothing to go by"


def _folds(count: int, folds: int) -> list[Array]:
    order = np.random.default_rng(FOLD_SEED).permutation(count)
    return [np.sort(order[k::folds]) for k in range(min(folds, count))]


def _depth(features: Array, errors: Array) -> int:
    """Return the depth with the lowest error on folds of these instances, the least deep of equal ones."""
    totals = dict.fromkeys(DEPTHS, 0.0)
    for held in _folds(len(errors), INNER_FOLDS):
        known = np.setdiff1d(np.arange(len(errors)), held)
        for depth in DEPTHS:
            taken = _taken(features[known], errors[known], features[held], depth)
            totals[depth] += float(errors[held, taken].sum())
    return min(DEPTHS, key=lambda depth: (round(totals[depth], 9), depth))


def _taken(features: Array, errors: Array, asked: Array, depth: int) -> Array:
    """Return the method (k,) with the lowest error for each of k instances, as a tree of that depth has it."""
    if depth == 0:
        return np.full(len(asked), errors.mean(axis=0).argmin())
    from sklearn.tree import DecisionTreeRegressor

    tree = DecisionTreeRegressor(max_depth=depth, min_samples_leaf=LEAF, random_state=0).fit(features, errors)
    return np.asarray(tree.predict(asked).argmin(axis=1))


def _oracle_apart(runs: Array) -> float:
    """Return the mean error (methods, instances, seeds) of each run's method that is best on the other seeds."""
    others = runs.sum(axis=2, keepdims=True) - runs
    chosen = others.argmin(axis=0)
    return float(np.take_along_axis(runs, chosen[None], axis=0).mean())


def _where(contest: Contest, errors: Array, best: int) -> list[dict[str, Any]]:
    """Return of each part of the instances that a plan tells apart who is the best there: the largest parts first."""
    parts: dict[tuple[str, str], list[int]] = {}
    for k, i in enumerate(contest.instances):
        place = contest.runs.places[i]
        views = ", ".join(f"{view:g}" for view in place["view_degrees"])
        parts.setdefault(("motion", str(place["motion"])), []).append(k)
        parts.setdefault(("view", f"{views}°"), []).append(k)
        for label in [f"{kind} {share:g}" for kind, share in sorted(place["corruption"].items())] or ["none"]:
            parts.setdefault(("damage", label), []).append(k)
    kinds = Counter(kind for kind, _ in parts)
    found: list[dict[str, Any]] = []
    for (kind, label), held in parts.items():
        if kinds[kind] > 1:
            means = errors[held].mean(axis=0)
            first = int(means.argmin())
            row = {"part": f"{kind}: {label}", "instances": len(held), "method": contest.methods[first]}
            found.append({**row, "error": float(means[first]), "behind": float(means[best] - means[first])})
    order = {kind: rank for rank, kind in enumerate(("damage", "view", "motion"))}
    found.sort(key=lambda one: (order[one["part"].partition(":")[0]], -one["instances"]))
    return found[:PARTS]
