"""`posefit.compare`: a small sweep from Python, and its results as a table or a report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from posefit.progress import interactive
from posefit.report.write import leaderboard_lines, write_report
from posefit.sweep import command
from posefit.sweep.driver import Tally
from posefit.sweep.engines.engine import Limits
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of a small sweep. Without a folder of its own, its ledger lasts as long as this object."""

    ledger: Ledger = field(repr=False)
    tally: Tally
    _kept: TemporaryDirectory[str] | None = field(repr=False)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table of one row a cell. Raises ImportError where pandas is not installed."""
        return self.ledger.frame()

    def report(self, path: str | Path) -> dict[str, Any]:
        """Write the report, one page, and return what it says as a mapping."""
        return write_report(str(self.ledger.path), str(path), warn=interactive().log)

    def __str__(self) -> str:
        return "\n".join(leaderboard_lines(write_report(str(self.ledger.path), None, warn=interactive().log)))


def compare(
    methods: Sequence[str | Mapping[str, Any]],
    motions: Sequence[str | Mapping[str, Any]] = ("walk",),
    seeds: int | Sequence[int] = 5,
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    **lists: Any,
) -> Comparison:
    """Return how methods compare on motions, each pair run with so many seeds in `workers` processes.

    A method is named as it is registered. `lists` are the other fields of a plan's product and defaults: `views`,
    `corruptions`, `instances`, `frames`, `evaluations` and so on. With `out` the ledger is kept in that folder, and a
    comparison with the same goes on there. Raises InputError for every mistake.
    """
    crossed = {"methods": list(methods), "motions": list(motions), "seeds": seeds}
    crossed |= {name: lists.pop(name) for name in ("views", "corruptions", "instances") if name in lists}
    cells = Plan.of({"product": crossed, "defaults": lists})
    kept = TemporaryDirectory(prefix="posefit-") if out is None else None
    folder = Path(kept.name) / "results" if kept else Path(str(out))
    engine = command.engine(Limits(), workers=workers)()
    try:
        tally = command.swept(cells, folder, engine, interactive().log)
    finally:
        engine.close()
    return Comparison(Ledger(folder), tally, kept)
