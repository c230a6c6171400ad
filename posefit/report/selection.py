"""The best method of each instance, and what choosing a method by the instance would gain.

The error of a method on an instance is the mean over its seeds; all figures here are means over instances. There are
three ways of choosing:

- the *single best* method has the lowest mean over all instances;
- the *oracle* takes the best method of each instance. It uses the very errors that it is scored by, so there is also
  its error if each seed is scored by the method that was best on the other seeds;
- a *selector* knows the fields of a plan for an instance: its motion, views, damage and the like. It is a regression
  tree of all methods' errors, trained on other instances, its depth chosen on folds of these. A tree of depth 0 is the
  single best method: a selector that learns nothing falls back to it.
"""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.report.contest import Contest
from posefit.report.runs import Runs, damage, views

DEPTHS = (0, 1, 2, 3, 5)  # of the trees that a selector is chosen from
MIN_LEAF = 2  # instances in a leaf of a tree
MIN_INSTANCES, MAX_INSTANCES = 8, 500  # that a selector is trained on
FOLDS, INNER_FOLDS, MAX_LEAVE_ONE_OUT = 10, 5, 20  # up to so many instances each is a fold of its own
MAX_PARTS = 12  # rows of the best methods of parts
FOLD_SEED = 2013
_UNUSED = ("instance", "files", "train")  # fields of a plan that carry no information: numbers and names of files


def selection_of(contest: Contest) -> dict[str, Any] | None:
    """Return who wins where and what choosing gains; None of fewer than two methods or instances.

    `single`, `oracle`, `oracle_apart` (None of one seed) and `selector` (None if there is none, for the reason in
    `why`) are mean errors in degrees; `closed` is the share of the gap between single best and oracle that the
    selector closes, None without a gap. `wins` lists each method's number of instances on which it is the best, and
    how often the selector chose it. `where` has the best method of each part of the instances, and by how much the
    single best method is behind it.
    """
    methods, instances, seeds = contest.rows.shape
    if methods < 2 or instances < 2:
        return None
    runs = contest.of("error")
    errors = runs.mean(axis=2).T
    best = int(errors.mean(axis=0).argmin())
    single, oracle = float(errors[:, best].mean()), float(errors.min(axis=1).mean())
    names, features = features_of(contest.runs, contest.instances)
    # drawn at random: instances come in the order of a plan, so that every k-th of them could have the same view
    drawn = np.sort(np.random.default_rng(FOLD_SEED).permutation(instances)[:MAX_INSTANCES])
    why, selector, picks = "", None, Counter[int]()
    if instances < MIN_INSTANCES:
        why = f"{instances} instances are too few to train a selector: at least {MIN_INSTANCES}"
    elif not names:
        why = "the plan is the same for every instance, so that a selector has no features"
    if not why:
        chosen = selected(features[drawn], errors[drawn])
        # its gain on the drawn instances, relative to the mean over all
        selector = single + float(errors[drawn, chosen].mean() - errors[drawn, best].mean())
        picks.update(chosen.tolist())
    gap = single - oracle
    wins = Counter(errors.argmin(axis=1).tolist())
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
        "wins": [[contest.methods[m], count, picks[m]] for m, count in wins.most_common()],
        "where": _best_by_part(contest, errors, best),
    }


def selected(features: Array, errors: Array) -> Array:
    """Return the method (n,) that a selector takes for each instance, on which it was not trained.

    `features` (n, d) and `errors` (n, methods) are of instances. For each fold of them a tree chooses that was trained
    on the others, and whose depth was chosen on the others.
    """
    chosen = np.zeros(len(errors), dtype=int)
    for train, held_out in _folds(len(errors), len(errors) if len(errors) <= MAX_LEAVE_ONE_OUT else FOLDS):
        depth = _depth(features[train], errors[train])
        chosen[held_out] = _predicted(features[train], errors[train], features[held_out], depth)
    return chosen


def features_of(runs: Runs, instances: Sequence[int]) -> tuple[list[str], Array]:
    """Return the features of instances by name and as numbers (n, d); those equal for all instances are left out.

    Words, such as a motion's name, are a column each, of 0 and 1. Of several views the first counts, by its direction.
    """
    fields = [_fields(runs.places[i]) for i in instances]
    values = {(name, value) for place in fields for name, value in place.items()}
    words = sorted((name, value) for name, value in values if isinstance(value, str))
    numbers = sorted({name for name, value in values if not isinstance(value, str)})
    columns = [(name, [float(place.get(name, 0.0)) for place in fields]) for name in numbers]
    if len(words) < len(instances):
        columns += [(name, [float(place.get(name) == value) for place in fields]) for name, value in words]
    varied = [(name.partition(",")[0], column) for name, column in columns if len(set(column)) > 1]
    table = np.array([column for _, column in varied]).reshape(len(varied), len(fields)).T
    return list(dict.fromkeys(name for name, _ in varied)), table


def _fields(place: Mapping[str, Any]) -> dict[str, float | str]:
    """Return the fields of a plan for one instance, as numbers and words."""
    view = np.deg2rad(place["view_degrees"][0])
    return {
        "view, sine": float(np.sin(view)),
        "view, cosine": float(np.cos(view)),
        "cameras": float(len(place["view_degrees"])),
        "size": float(np.prod(place["size"])),
        **place["corruption"],
        **{
            name: value for name, value in place.items() if name not in _UNUSED and isinstance(value, str | int | float)
        },
    }


def _folds(count: int, folds: int) -> Iterator[tuple[Array, Array]]:
    """Yield the instances to train on, and those held out."""
    order = np.random.default_rng(FOLD_SEED).permutation(count)
    for k in range(min(folds, count)):
        yield np.sort(np.delete(order, np.s_[k::folds])), np.sort(order[k::folds])


def _depth(features: Array, errors: Array) -> int:
    """Return the depth with the lowest error on folds of these instances, the smallest of equal ones."""
    totals = dict.fromkeys(DEPTHS, 0.0)
    for train, held_out in _folds(len(errors), INNER_FOLDS):
        for depth in DEPTHS:
            chosen = _predicted(features[train], errors[train], features[held_out], depth)
            totals[depth] += float(errors[held_out, chosen].sum())
    return min(DEPTHS, key=lambda depth: (round(totals[depth], 9), depth))


def _predicted(features: Array, errors: Array, queries: Array, depth: int) -> Array:
    """Return the method (k,) with the lowest error for each of k instances, as a tree of that depth predicts it."""
    if depth == 0:
        return np.full(len(queries), errors.mean(axis=0).argmin())
    from sklearn.tree import DecisionTreeRegressor

    tree = DecisionTreeRegressor(max_depth=depth, min_samples_leaf=MIN_LEAF, random_state=0).fit(features, errors)
    return np.asarray(tree.predict(queries).argmin(axis=1))


def _oracle_apart(runs: Array) -> float:
    """Return the mean error (methods, instances, seeds) of each run's method that is best on the other seeds."""
    others = runs.sum(axis=2, keepdims=True) - runs
    return float(np.take_along_axis(runs, others.argmin(axis=0)[None], axis=0).mean())


def _best_by_part(contest: Contest, errors: Array, best: int) -> list[dict[str, Any]]:
    """Return the best method of each part of the instances, by damage, view and motion: largest parts first."""
    parts: dict[tuple[str, str], list[int]] = {}
    for k, place in enumerate(contest.places()):
        labels = [("damage", label) for label in damage(place) or ["none"]]
        for part in [*labels, ("view", f"{', '.join(views(place))}°"), ("motion", place["motion"])]:
            parts.setdefault(part, []).append(k)
    kinds = Counter(kind for kind, _ in parts)
    order = ("damage", "view", "motion")
    sorted_parts = sorted(parts.items(), key=lambda part: (order.index(part[0][0]), -len(part[1])))
    rows = []
    for kind, label, members in [(*part, members) for part, members in sorted_parts if kinds[part[0]] > 1][:MAX_PARTS]:
        means = errors[members].mean(axis=0)
        first = int(means.argmin())
        row = {"part": f"{kind}: {label}", "instances": len(members), "method": contest.methods[first]}
        rows.append({**row, "error": float(means[first]), "behind": float(means[best] - means[first])})
    return rows
