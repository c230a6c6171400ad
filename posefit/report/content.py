"""The data of a report's page: what was run, the leader, how certain that is, and every run."""

import shlex
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from posefit.errors import printable
from posefit.reading import counted
from posefit.report.kind import Contest, Runs
from posefit.report.leaderboard import contest_of, leaderboard
from posefit.report.page import COLOUR_COUNT
from posefit.report.summary import leader_sentences, unpaired_sentence
from posefit.sweep.ledger import Ledger

# of failures and warnings, the most frequent ones, that the first screen names
REASONS = 5
MAX_MISSING = 20  # instances that it names if they are not compared


def data_of(ledger: Ledger, runs: Runs) -> dict[str, Any]:
    """Return the data of the page about a ledger's runs; `sections` names the parts that it has."""
    contest = contest_of(runs)
    kind = runs.kind
    date = time.strftime("%d %B %Y", time.localtime(ledger.changed))
    warnings = list(
        dict.fromkeys(text for texts in runs.warnings.values() for text in texts)
    )
    data: dict[str, Any] = {
        "title": kind.title,
        "made": f"{printable(ledger.path.resolve().name)}, {date}",
        "ledger": printable(shlex.quote(ledger.path.name or str(ledger.path))),
        "answer": [
            "Every cell failed."
            if runs.failures
            else "No run has an error: nothing can be compared."
        ],
        "header": _header(runs, contest),
        "methods": [
            {"name": n, "settings": v["settings"]}
            for n, v in zip(runs.methods, runs.variants, strict=True)
        ],
        "instances": [{"name": name} for name in runs.instances],
        "baseline_names": kind.baselines,
        "colours": COLOUR_COUNT,
        "columns": {name: kind.columns[name].as_dict() for name in runs.table_figures},
        "score": vars(kind.score),
        "warnings": warnings,
        "warned": {
            row: [warnings.index(text) for text in texts]
            for row, texts in runs.warnings.items()
        },
        "failures": runs.failures,
    }
    if contest is not None:
        board = leaderboard(contest)
        baselines = kind.baseline_rows(contest)
        data |= {
            "answer": leader_sentences(contest, board, baselines),
            "leaderboard": board,
            "baselines": baselines,
            "taking_part": contest.methods,
        }
    data |= kind.page(runs, contest)
    if runs.failures:
        data["sections"] = [*data["sections"], "failures"]
    return data


def _header(runs: Runs, contest: Contest | None) -> dict[str, Any]:
    dropped = [
        {"instance": runs.instances[i], "missing": [runs.methods[m] for m in methods]}
        for i, methods in (contest.missing if contest else ())
    ]
    failed = (
        f"{counted(len(runs.failures), 'cell')} failed"
        if runs.failures
        else "no cell failed"
    )
    facts = {
        "methods": runs.methods,
        **runs.kind.facts(runs),
        "posefit": runs.values("version"),
    }
    texts = {
        name: fact if isinstance(fact, str) else "; ".join(map(str, fact))
        for name, fact in facts.items()
    }
    runs_words = (
        counted(len(runs), runs.kind.name)
        if len(runs) == 1
        else f"{len(runs):,} {runs.kind.noun}"
    )
    return {
        "version": runs.version,
        "summary": f"{runs_words} by {counted(len(runs.methods), 'method')}; {failed}.",
        "facts": [[name, printable(text)] for name, text in texts.items()],
        "notes": _notes(runs, contest),
        "done": len(runs),
        "failed": len(runs.failures),
        "dropped": dropped,
        "problems": _problems(
            runs, dropped, unpaired_sentence(contest) if contest else ""
        ),
    }


def _problems(
    runs: Runs, dropped: Sequence[Mapping[str, Any]], unpaired: str
) -> list[tuple[str, list[str]]]:
    """Return what failed, what is therefore not compared, and what warned: sentences with the most frequent details."""
    problems = []

    def add(text: str, details: Sequence[str], most: int) -> None:
        more = [f"and {len(details) - most:,} more"] if len(details) > most else []
        problems.append((text, [*details[:most], *more]))

    if runs.failures:
        by = Counter(failure["method"] for failure in runs.failures)
        reasons = Counter(
            reason for failure in runs.failures for reason in failure["reasons"]
        ).most_common()
        text = "; ".join(f"{method} {count}" for method, count in by.items())
        failed = counted(len(runs.failures), "cell")
        add(
            f"{failed} failed, left out of all figures: {text}",
            [f"{n} x {reason}" for reason, n in reasons],
            REASONS,
        )
    if runs.unfinished:
        add(
            f"no cell finished, so not on the leaderboard: {'; '.join(runs.unfinished)}",
            [],
            0,
        )
    if unpaired:
        add(unpaired, [], 0)
    if dropped:
        whys = [
            f"no run of {'; '.join(gap['missing'])}"
            if gap["missing"]
            else "no seed in common"
            for gap in dropped
        ]
        details = [
            f"{gap['instance']}: {why}" for gap, why in zip(dropped, whys, strict=True)
        ]
        add(
            f"left out of the comparison, for every method: {counted(len(dropped), 'instance')}",
            details,
            MAX_MISSING,
        )
    if runs.warnings:
        texts = Counter(
            text for texts in runs.warnings.values() for text in texts
        ).most_common()
        add(
            f"{counted(len(runs.warnings), 'run')} with a warning",
            [f"{n} x {text}" for text, n in texts],
            REASONS,
        )
    return problems


def _notes(runs: Runs, contest: Contest | None) -> list[str]:
    notes = []
    if contest is not None:
        size = contest.blocks.size
        if size < len(runs):
            each = f"{counted(len(contest.instances), 'instance')} with {contest.seed_words}"
            notes.append(
                f"Methods are compared on the {size:,} of {len(runs):,} runs that all of them share: {each}."
            )
        apart = [
            name for m, name in enumerate(runs.methods) if m not in contest.methods
        ]
        if apart:
            notes.append(
                f"Too few runs in common with the others, so not compared: {'; '.join(apart)}. "
                "Their rows of the leaderboard use their own runs."
            )
    budget = "Budgets differ: compare methods of one budget only, as a longer search has lower costs."
    for field, advice in {
        "evaluations": budget,
        "budget": budget,
        "infeasible": "Infeasible proposals are treated differently: compare methods that treat them in the same way.",
        "version": "Commands run rows again if the same versions are installed.",
    }.items():
        notes += [advice] if len(runs.values(field)) > 1 else []
    return notes
