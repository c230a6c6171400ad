"""The leaderboard of a suite: a page about bundles whose every claim was verified, beside posefit's own methods."""

import time
from collections.abc import Callable, Iterable, Sequence
from importlib.resources import as_file, files
from pathlib import Path
from typing import Any

from posefit.errors import InputError
from posefit.fitting.check import one_of, whole
from posefit.page.document import plain
from posefit.reading import counted
from posefit.report.content import search_data
from posefit.report.runs import runs_of_searches
from posefit.report.write import check_page, write_page
from posefit.suites.functions import SUITES
from posefit.suites.verification import Bundle, verified

OWN = "methods.zip"  # of `docs/studies/make_bundles.py`
PRINTED = ("header", "answer", "leaderboard", "baselines", "times")


def write_board(paths: Sequence[str], out: str, suite: str, repeat: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Write the leaderboard of bundles, files or folders of them, to a page, and return what the command prints.

    Bundles that are refused are listed with the reason; with `repeat` so many searches of each are run again: see
    `posefit.suites.verification.verified`. An earlier report of that name is replaced, nothing else is. Raises
    ValueError where the page cannot be written, and where there is nothing to show.
    """
    check_page(out)
    one_of("suite", suite, SUITES)
    whole("repeat", repeat, 0)
    bundles: dict[str, Bundle] = {}
    with as_file(files("posefit.suites") / OWN) as path:
        own = verified(path)
    if own.suite == suite:
        bundles["posefit itself"] = own
    refused, notes = [], []
    for path in _listed(paths):
        name = path.stem
        try:
            bundle = verified(path, repeat, lambda text: say(f"repeats {text}"))
            if bundle.suite != suite:
                raise InputError(f"{path}: suite must be {suite}, got {bundle.suite}")
            if twice := [other for other, known in bundles.items() if known.digest == bundle.digest]:
                raise InputError(f"{path}: expected each bundle once, got {twice[0]} again")
        except (InputError, OSError) as error:
            refused.append(str(error))
            say(f"refused: {error}")
            continue
        if name in bundles:
            name = f"{name} {bundle.digest[:8]}"
        bundles[name] = bundle
        notes += [f"Seeds of {name} are not checked: {reason}." for reason in bundle.unrepeatable]
    if not bundles:
        raise InputError(f"{suite}: expected a bundle that is not refused, got none")
    runs = runs_of_searches([(name, run) for name, bundle in bundles.items() for run in bundle.runs])
    data = search_data(runs, f"Leaderboard of {suite}", time.strftime("%d %B %Y"))
    for method in data["methods"]:
        method["settings"] = "; ".join(filter(None, [method["settings"], method["bundle"]]))
    points = sum(bundle.evaluated for bundle in bundles.values())
    searches = f"{len(runs):,} searches by {counted(len(runs.methods), 'method')}"
    header = data["header"]
    header["summary"] = f"{searches}; {points:,} points were evaluated again, and each has the cost that was claimed."
    header["facts"].append(["bundles", "; ".join(f"{name} {bundle.digest[:12]}" for name, bundle in bundles.items())])
    header["refused"] = refused
    header["notes"] += [*notes, _repeated(bundles.values(), repeat)]
    write_page(data, out)
    return {"out": out, **dict(plain({name: data[name] for name in PRINTED if name in data}))}


def _repeated(bundles: Iterable[Bundle], repeat: int) -> str:
    """Return what is known of seeds and of the evaluations between improvements, in words."""
    count = sum(bundle.repeated for bundle in bundles)
    known = f"Searches repeated from their seeds, which the bundles' digests chose: {count}." if repeat else ""
    return f"Points prove costs, but neither seeds nor how many evaluations were used. {known}".rstrip()


def _listed(paths: Iterable[str]) -> list[Path]:
    """Return the files that are named, and those that end in .zip of the folders that are."""
    listed = [sorted(path.glob("*.zip")) if path.is_dir() else [path] for path in map(Path, paths)]
    return [path for several in listed for path in several]
