"""What `posefit report` says of a ledger, as data: what was run, who won, how sure that is, and every run."""

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS, PARENTS, SIDES
from posefit.registry import claimed_orders
from posefit.report import curves
from posefit.report.answer.claimed import claim_results
from posefit.report.answer.lead import lead_sentence, not_told_apart, three_tracks
from posefit.report.answer.selection import selection_of
from posefit.report.answer.unpaired import unpaired_sentence
from posefit.report.colours import METHODS
from posefit.report.columns import COLUMNS
from posefit.report.contest import (
    Contest,
    baseline_rows,
    contest_of,
    dropped,
    leaderboard,
    paired_tests,
    resamples,
)
from posefit.report.gallery import gallery
from posefit.report.runs import Runs, shown_of
from posefit.sweep.ledger import Ledger
from posefit.tracking.measures import BASELINES

SCORE = {  # what the first figure shows of methods
    "name": "error",
    "said": "Errors in degrees",
    "axis": "error in degrees",
    "unit": "°",
    "digits": 2,
    "better": "less",
}
REASONS = 5  # of failures, the most frequent ones, that are named at the top


def data_of(ledger: Ledger, runs: Runs, say: Callable[[str], None]) -> dict[str, Any]:
    """Return everything that the page shows of a ledger's runs."""
    contest = contest_of(runs)
    compared = _compared(contest) if contest is not None else {}
    pictures = gallery(ledger, runs, say, first=[row for _, row in compared.get("tracks", [])])
    return {
        "header": _header(runs, contest, pictures),
        "methods": [{"name": name, **about} for name, about in zip(runs.methods, runs.variants, strict=True)],
        "instances": _instances(runs),
        "joints": JOINTS,
        "parents": PARENTS,
        "sides": SIDES,
        "colours": len(METHODS),
        "columns": {name: COLUMNS[name].about() for name in shown_of(runs)},
        "trivial": BASELINES,
        "score": SCORE,
        **compared,
        "rows": _rows(runs),
        **_warned(runs),
        "live": None,
        "seeds": [_exact(seed) for seed in runs.seeds],
        "heads": runs.heads,
        "gallery": pictures,
        "failures": runs.failures,
    }


def _header(runs: Runs, contest: Contest | None, pictures: dict[str, Any]) -> dict[str, Any]:
    def all_of(name: str) -> list[str]:
        return sorted({str(place[name]) for place in runs.places})

    return {
        "version": runs.version,
        "versions": sorted({str(one["version"]) for one in runs.variants}),
        "done": len(runs),
        "failed": len(runs.failures),
        "failed_by": Counter(one["method"] for one in runs.failures),
        "reasons": Counter(reason for one in runs.failures for reason in one["reasons"]).most_common(REASONS),
        "unfinished": runs.unfinished,
        "dropped": [] if contest is None else dropped(contest),
        "motions": all_of("motion"),
        "views": sorted({", ".join(f"{view:g}" for view in place["view_degrees"]) for place in runs.places}),
        "corruptions": sorted(
            {
                ", ".join(f"{kind} {share:g}" for kind, share in sorted(place["corruption"].items())) or "none"
                for place in runs.places
            }
        ),
        "frames": all_of("frames"),
        "translations": all_of("translation"),
        "budgets": sorted({int(one["evaluations"]) for one in runs.variants}),
        "seeds": [_exact(seed) for seed in runs.seeds[:50]],
        "seed_count": len(runs.seeds),
        "hours": float(
            np.nansum(runs.figures["ms"] * np.array([place["frames"] for place in runs.places])[runs.instance]) / 3.6e6
        ),
        "shared": None if contest is None else int(contest.rows.size),
        "unpaired": "" if contest is None else _unpaired(contest),
        "shared_instances": None if contest is None else contest.rows.shape[1],
        "shared_seeds": None if contest is None else contest.rows.shape[2],
        "apart": [] if contest is None else [m for m in range(len(runs.methods)) if m not in contest.methods],
        "resamples": None if contest is None else resamples(contest.rows.size),
        "drawn": None if contest is None else _some(contest).rows.shape[1:],
        "pictures": len(pictures["tracks"]),
    }


def _unpaired(contest: Contest) -> str:
    spare = contest.blocks.size - contest.rows.size
    return unpaired_sentence(contest.left_out, spare, contest.rows.shape[2], tested=True)


def _compared(contest: Contest) -> dict[str, Any]:
    some = _some(contest)
    evaluations = curves.grid(some)
    board, bases = leaderboard(contest), baseline_rows(contest)
    tests = paired_tests(contest) if contest.testable else None
    return {
        "answer": lead_sentence(contest, board, bases, tests),
        "alike": not_told_apart(tests, board[0]["method"]),
        "tracks": three_tracks(contest, board[0]["method"]),
        "leaderboard": board,
        "baselines": bases,
        "pairs": tests,
        "claims": claim_results(contest, claimed_orders()),
        "selection": selection_of(contest),
        "taking_part": contest.methods,
        "evaluations": evaluations,
        "convergence": [curves.shown(one) for one in curves.convergence(some, evaluations)],
        "reached": curves.reached(some, evaluations) if len(evaluations) else [],
        "joint_errors": [curves.shown(one) for one in curves.joint_errors(some)],
        "certainty": curves.certainty(contest),
    }


def _some(contest: Contest) -> Contest:
    """Return the contest that curves are drawn of: all of it, but in a sweep of very many runs."""
    return contest.fewer(max(curves.POINTS, len(JOINTS)))


def _instances(runs: Runs) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = [
        {"name": name, "number": _exact(place["instance"])}
        for name, place in zip(runs.instances, runs.places, strict=True)
    ]
    for name in BASELINES:
        for one, value in zip(found, _by_instance(runs, f"baseline_{name}"), strict=True):
            one[name] = value
    return found


def _exact(number: int) -> int | str:
    """Return a number that a browser does not round: a text, where its floats would."""
    return number if abs(number) < 2**53 else str(number)


def _by_instance(runs: Runs, figure: str) -> Array:
    """Return the mean of a figure on each instance (instances,), nan where no row has it."""
    values = runs.figures[figure]
    known = np.isfinite(values)
    count = len(runs.instances)
    total = np.bincount(runs.instance[known], values[known], minlength=count)
    met = np.bincount(runs.instance[known], minlength=count)
    return np.where(met > 0, total / np.maximum(met, 1), np.nan)


def _warned(runs: Runs) -> dict[str, Any]:
    """Return the warnings that rows have, each once, and of each row that has any which."""
    texts = list(dict.fromkeys(text for found in runs.warnings.values() for text in found))
    place = {text: k for k, text in enumerate(texts)}
    return {"warnings": texts, "warned": {row: [place[one] for one in found] for row, found in runs.warnings.items()}}


def _rows(runs: Runs) -> dict[str, Any]:
    """Return the columns of all rows, short enough for a page of a hundred thousand of them."""
    columns: dict[str, Any] = {name: getattr(runs, name) for name in ("method", "instance", "head", "seed")}
    for name in shown_of(runs):
        columns[name] = np.round(runs.figures[name], COLUMNS[name].kept)
    return {**columns, "key": [key[:8] for key in runs.keys]}
