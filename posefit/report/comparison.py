"""`posefit.compare`: a small sweep from Python, and its results as a table or a report."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from secrets import token_hex
from shutil import rmtree
from tempfile import mkdtemp
from typing import TYPE_CHECKING, Any
from weakref import finalize

from posefit.errors import InputError
from posefit.progress import interactive
from posefit.registry import register
from posefit.report.write import leaderboard_lines, write_report
from posefit.sweep.cell import run_cell
from posefit.sweep.command import swept
from posefit.sweep.drive import Tally
from posefit.sweep.engine import Limits
from posefit.sweep.ledger import FILE, Ledger
from posefit.sweep.plan import Plan
from posefit.sweep.pool import Pool, cores

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of a small sweep, in the ledger of a folder.

    A comparison without `out` has a temporary folder, which lasts as long as this object. Pickled it holds the ledger,
    and has another temporary folder where it is read.
    """

    folder: Path
    tally: Tally
    _is_temporary: bool = field(default=False, repr=False)

    def __post_init__(self) -> None:
        if self._is_temporary:
            finalize(self, rmtree, self.folder.parent, ignore_errors=True)

    def rows(self) -> list[dict[str, Any]]:
        """Return every finished row, as `Ledger.rows` yields them."""
        with Ledger(self.folder) as ledger:
            return list(ledger.rows())

    def to_pandas(self) -> "pd.DataFrame":
        """Return a table of one row a cell. Raises ImportError where pandas is not installed."""
        with Ledger(self.folder) as ledger:
            return ledger.frame()

    def report(self, path: str | Path) -> dict[str, Any]:
        """Write the report, one page, and return what it says as a mapping."""
        return write_report(str(self.folder), str(path))

    def __str__(self) -> str:
        return "\n".join(leaderboard_lines(write_report(str(self.folder), None)))

    def __reduce__(self) -> tuple[Any, ...]:
        if not self._is_temporary:
            return Comparison, (self.folder, self.tally)
        return _unpickled, (self.tally, (self.folder / FILE).read_bytes())


def _unpickled(tally: Tally, ledger: bytes) -> Comparison:
    """Return a comparison whose temporary folder holds a ledger."""
    folder = _temporary_folder()
    folder.mkdir()
    (folder / FILE).write_bytes(ledger)
    return Comparison(folder, tally, True)


def _temporary_folder() -> Path:
    """Return a folder that is not there yet, in a new temporary one."""
    return Path(mkdtemp(prefix="posefit-")) / "results"


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
    of a plan: `views`, `corruptions`, `instances` and `grid`, and the defaults `frames`, `evaluations` and so on.

    With `out` the ledger is kept in that folder, and a comparison with the same goes on there: rows of registered
    methods are not run again. Those of a factory always are, since what it does may follow from a closure, a helper or
    a file, which no key can hold.

    Raises InputError for every mistake.
    """
    factories: dict[str, tuple[Callable[..., Any], str]] = {}
    # of this call alone, so that no earlier row counts as one of the same factory
    call = token_hex(4)
    entries = [_named(entry, call, factories) for entry in methods]
    register(factories)
    crossed = {"methods": entries, "motions": list(motions), "seeds": seeds}
    crossed |= {
        name: lists.pop(name)
        for name in ("views", "corruptions", "instances")
        if name in lists
    }
    grid = {"grid": lists.pop("grid")} if "grid" in lists else {}
    plan = Plan.of({"product": crossed, "defaults": lists, **grid})
    folder = _temporary_folder() if out is None else Path(out)
    say = interactive().log
    if factories and folder.exists():
        names = ", ".join(factories)
        say(
            f"cells of {names} run again, whatever {folder} holds: "
            "only rows of registered methods are reused"
        )
    pool = Pool(
        cores() if workers is None else workers,
        Limits(),
        run_cell,
        partial(register, factories),
    )
    try:
        tally = swept(plan, folder, pool, say)
    except BaseException:
        if out is None:
            rmtree(folder.parent, ignore_errors=True)
        raise
    return Comparison(folder, tally, out is None)


def _named(
    entry: Any, call: str, factories: dict[str, tuple[Callable[..., Any], str]]
) -> Any:
    """Return an entry of methods by names, and add its factory, if it is one, to others, with a word for this call."""
    if isinstance(entry, Mapping):
        return {**entry, "method": _named(entry.get("method"), call, factories)}
    if not callable(entry):
        return entry
    name = getattr(entry, "__name__", type(entry).__name__)
    if name in factories and factories[name][0] is not entry:
        raise InputError(f"factories must have names of their own, got {name} twice")
    factories[name] = entry, call
    return name
