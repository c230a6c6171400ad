"""The data of a report's page: the facts, the leader and its certainty, all runs."""

import shlex
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Any

from posefit.errors import printable
from posefit.reading import counted
from posefit.report.columns import MIN_P
from posefit.report.contest import Contest, Runs
from posefit.report.leaderboard import Standings
from posefit.report.page import COLOUR_COUNT
from posefit.report.summary import leader_sentences, unpaired_sentence
from posefit.statistics.paired import POWER, SIGNIFICANCE
from posefit.sweep.ledger import Ledger

# The most that the first screen names: of the most frequent failures and warnings, and
# of the instances that are not compared.
MAX_DETAILS = 5
MAX_MISSING = 20
MAX_BLOCKS = 1_000_000  # tables only say that more are needed

Problem = tuple[str, list[str]]  # a sentence about the runs, and details


def data_of(ledger: Ledger, runs: Runs, standings: Standings | None) -> dict[str, Any]:
    """Return the data of the page about a ledger's runs.

    Args:
        ledger: The ledger, open.
        runs: Its runs.
        standings: Their standings, None if no run has an error.

    Returns:
        The data by name. `sections` lists the sections of the page.
    """
    contest = standings.contest if standings else None
    kind = runs.kind
    date = time.strftime("%d %B %Y", time.localtime(ledger.changed))
    warnings, warned = _warnings(runs)
    methods = []
    for name, settings in zip(runs.methods, runs.settings, strict=True):
        methods.append({"name": name, "settings": settings})
    answer = "No run has an error: nothing can be compared."
    if not len(runs):
        answer = "Every cell failed."
    data: dict[str, Any] = {
        "title": kind.title,
        "made": f"{printable(ledger.path.resolve().name)}, {date}",
        "ledger": printable(shlex.quote(ledger.path.name or str(ledger.path))),
        "answer": [answer],
        "header": _header(runs, contest),
        "methods": methods,
        "instances": [{"name": name} for name in runs.instances],
        "constants": {
            "colours": COLOUR_COUNT,
            "significance": SIGNIFICANCE,
            "power": POWER,
            "least_p": MIN_P,
            "max_blocks": MAX_BLOCKS,
        },
        "columns": {name: kind.columns[name].as_dict() for name in runs.table_figures},
        "score": kind.score.as_dict(),
        "warnings": warnings,
        "warned": warned,
        "failures": [vars(failure) for failure in runs.failures],
    }
    if standings is not None:
        data |= {
            "answer": leader_sentences(standings),
            "leaderboard": [row.as_dict() for row in standings.board],
            "baselines": [baseline.as_dict() for baseline in standings.baselines],
            "taking_part": standings.contest.methods,
        }
    data |= kind.page(runs, contest)
    if runs.failures:
        data["sections"] = [*data["sections"], "failures"]
    return data


def _warnings(runs: Runs) -> tuple[list[str], dict[int, list[int]]]:
    """Return the texts of all warnings, and the texts of each row by their indices.

    Each text is there once, because many runs have the same.
    """
    index_of: dict[str, int] = {}
    warned = {}
    for row, texts in runs.warnings.items():
        warned[row] = [index_of.setdefault(text, len(index_of)) for text in texts]
    return list(index_of), warned


def _header(runs: Runs, contest: Contest | None) -> dict[str, Any]:
    """Return the first screen's data: the facts, and everything that limits them."""
    failed = "no cell failed"
    if runs.failures:
        failed = f"{counted(len(runs.failures), 'cell')} failed"
    facts = {
        "methods": runs.methods,
        **runs.kind.facts(runs),
        "posefit": runs.values("version"),
    }
    lines = []
    for name, fact in facts.items():
        text = fact
        if not isinstance(fact, str):
            text = "; ".join(map(str, fact))
        lines.append([name, printable(text)])
    runs_words = f"{len(runs):,} {runs.kind.noun}"
    if len(runs) == 1:
        runs_words = counted(1, runs.kind.name)
    return {
        "version": runs.version,
        "summary": f"{runs_words} by {counted(len(runs.methods), 'method')}; {failed}.",
        "facts": lines,
        "notes": _notes(runs, contest),
        "done": len(runs),
        "failed": len(runs.failures),
        "problems": list(_problems(runs, contest)),
    }


def _problems(runs: Runs, contest: Contest | None) -> Iterator[Problem]:
    """Yield the problems: failures, runs that are not compared, and warnings."""
    if runs.failures:
        reasons: Counter[str] = Counter()
        for failure in runs.failures:
            reasons.update(failure.reasons)
        failed = counted(len(runs.failures), "cell")
        names = "; ".join(f"{name} {count}" for name, count in runs.failed.items())
        yield _problem(
            f"{failed} failed, left out of all figures: {names}", _frequent(reasons)
        )
    unfinished = [name for name in runs.failed if name not in runs.methods]
    if unfinished:
        names = "; ".join(unfinished)
        yield _problem(f"no cell finished, so not on the leaderboard: {names}")
    builds = {variant["version"].partition(", ")[0] for variant in runs.variants}
    if len(builds) > 1:
        names = "; ".join(sorted(builds))
        yield _problem(f"methods ran with different versions: {names}")
    if contest is not None:
        yield from _left_out(runs, contest)
    if runs.warnings:
        warnings: Counter[str] = Counter()
        for texts in runs.warnings.values():
            warnings.update(texts)
        runs_words = counted(len(runs.warnings), "run")
        yield _problem(f"{runs_words} with a warning", _frequent(warnings))


def _left_out(runs: Runs, contest: Contest) -> Iterator[Problem]:
    """Yield the problems about methods, runs and instances that are not compared."""
    others = []
    for m, name in enumerate(runs.methods):
        if m not in contest.methods:
            others.append(name)
    if others:
        yield _problem(
            "too few runs in common with the others, so not compared; the "
            f"leaderboard has the means of all their runs: {'; '.join(others)}"
        )
    if unpaired := unpaired_sentence(contest):
        yield _problem(unpaired)
    details = []
    for i, methods in contest.missing:
        why = "no seed in common"
        if methods:
            why = f"no run of {'; '.join(runs.methods[m] for m in methods)}"
        details.append(f"{runs.instances[i]}: {why}")
    if details:
        instances = counted(len(details), "instance")
        text = f"left out of the comparison, for every method: {instances}"
        yield _problem(text, details, MAX_MISSING)


def _problem(
    text: str, details: Sequence[str] = (), most: int = MAX_DETAILS
) -> Problem:
    """Return a problem with at most `most` of its details."""
    named = list(details[:most])
    if len(details) > most:
        named.append(f"and {len(details) - most:,} more")
    return text, named


def _frequent(counts: Counter[str]) -> list[str]:
    """Return texts with their numbers, the most frequent first."""
    return [f"{count} x {text}" for text, count in counts.most_common()]


def _notes(runs: Runs, contest: Contest | None) -> list[str]:
    """Return sentences about how to read the comparison."""
    notes = []
    if contest is not None:
        size = contest.blocks.size
        if size < len(runs):
            instances = counted(len(contest.instances), "instance")
            notes.append(
                f"Methods are compared on the {size:,} of {len(runs):,} runs that all "
                f"of them share: {instances} with {contest.seed_words}."
            )
    budget = (
        "Budgets differ: compare methods of one budget only, as a longer search has "
        "lower costs."
    )
    infeasible = (
        "Infeasible proposals are treated differently: compare methods that treat them "
        "in the same way."
    )
    version = "Commands run rows again if the same versions are installed."
    advice_of_field = {
        "evaluations": budget,
        "budget": budget,
        "infeasible": infeasible,
        "version": version,
    }
    for field, advice in advice_of_field.items():
        if len(runs.values(field)) > 1:
            notes.append(advice)
    return notes
