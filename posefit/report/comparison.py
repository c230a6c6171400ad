"""`posefit.compare`: a small sweep from Python, and its results as a table or a report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from hashlib import sha256
from inspect import getsource
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from posefit.errors import InputError
from posefit.progress import interactive
from posefit.registry import register
from posefit.report.write import leaderboard_lines, write_report
from posefit.sweep.cell import run_cell
from posefit.sweep.command import swept
from posefit.sweep.drive import Tally
from posefit.sweep.engine import Limits
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from posefit.sweep.pool import Pool, cores

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of a small sweep. Without a folder of its own, its ledger lasts as long as this object."""

    ledger: Ledger = field(repr=False)
    tally: Tally
    _temporary: TemporaryDirectory[str] | None = field(repr=False)

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table of one row a cell. Raises ImportError where pandas is not installed."""
        return self.ledger.frame()

    def report(self, path: str | Path) -> dict[str, Any]:
        """Write the report, one page, and return what it says as a mapping."""
        return write_report(str(self.ledger.path), str(path))

    def __str__(self) -> str:
        return "\n".join(leaderboard_lines(write_report(str(self.ledger.path), None)))


def compare(
    methods: Sequence[str | Callable[..., Any] | Mapping[str, Any]],
    motions: Sequence[str | Mapping[str, Any]] = ("walk",),
    seeds: int | Sequence[int] = 5,
    *,
    out: str | Path | None = None,
    workers: int | None = None,
    **lists: Any,
) -> Comparison:
    """Return how methods compare on motions, each pair run with so many seeds in `workers` processes.

    A method is named as it is registered, or an optimiser's factory, which is named by its `__name__` and searches the
    prior `pca`; or a table of a `method`, the `name` that reports call it, and `settings`. `lists` are the other fields
    of a plan: `views`, `corruptions`, `instances` and `grid`, and the defaults `frames`, `evaluations` and so on. With
    `out` the ledger is kept in that folder, and a comparison with the same goes on there. Raises InputError for every
    mistake.
    """
    factories: dict[str, tuple[Callable[..., Any], str]] = {}
    entries = [_named(entry, factories) for entry in methods]
    register(factories)
    crossed = {"methods": entries, "motions": list(motions), "seeds": seeds}
    crossed |= {
        name: lists.pop(name)
        for name in ("views", "corruptions", "instances")
        if name in lists
    }
    grid = {"grid": lists.pop("grid")} if "grid" in lists else {}
    plan = Plan.of({"product": crossed, "defaults": lists, **grid})
    temporary = TemporaryDirectory(prefix="posefit-") if out is None else None
    folder = Path(temporary.name) / "results" if temporary else Path(str(out))
    pool = Pool(
        cores() if workers is None else workers,
        Limits(),
        run_cell,
        partial(register, factories),
    )
    tally = swept(plan, folder, pool, interactive().log)
    return Comparison(Ledger(folder), tally, temporary)


def _named(entry: Any, factories: dict[str, tuple[Callable[..., Any], str]]) -> Any:
    """Return an entry of methods by names, and add its factory, if it is one, to others."""
    if isinstance(entry, Mapping):
        return {**entry, "method": _named(entry.get("method"), factories)}
    if not callable(entry):
        return entry
    name = getattr(entry, "__name__", type(entry).__name__)
    try:
        digest = sha256(getsource(entry).encode()).hexdigest()[:8]
    except (OSError, TypeError):  # typed in, or built
        digest = ""
    if name in factories and factories[name][0] is not entry:
        raise InputError(f"factories must have names of their own, got {name} twice")
    factories[name] = entry, digest
    return name
