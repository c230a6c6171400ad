"""`posefit.compare`: a small sweep from Python, with a table or a report of it."""

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
from posefit.report.write import write_report
from posefit.silhouette.sharing import cores
from posefit.sweep.cell import run_cell
from posefit.sweep.command import swept
from posefit.sweep.drive import Tally
from posefit.sweep.engine import Limits
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from posefit.sweep.pool import Pool
from posefit.sweep.schema import FILE

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Comparison:
    """The results of `posefit.compare`, and all others in the same folder.

    Rows of a factory from earlier calls have another `version`. Without `out`, the
    ledger is in a temporary folder that is removed with this object. The pickle of such
    an object contains the ledger; unpickling writes it to a new temporary folder.

    Attributes:
        folder: The folder of the ledger.
        tally: How many cells are done, failed and quarantined.

    Example:
        >>> import posefit
        >>> result = posefit.compare(["random@pca"], seeds=1, frames=2, evaluations=40)
        >>> [row["spec"]["method"] for row in result.rows()]
        ['random@pca']
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
        """Return a table with one row per cell.

        Raises:
            ImportError: pandas is not installed.
        """
        with Ledger(self.folder) as ledger:
            return ledger.frame()

    def report(self, path: str | Path) -> dict[str, Any]:
        """Write the report as one page, and return its data.

        Args:
            path: The page, a file that ends in .html.

        Returns:
            The data that `posefit report --json` prints.

        Raises:
            ValueError: The page cannot be written.
        """
        return write_report(str(self.folder), str(path)).data

    def __str__(self) -> str:
        return "\n".join(write_report(str(self.folder), None).lines)

    def __reduce__(self) -> tuple[Any, ...]:
        if not self._is_temporary:
            return Comparison, (self.folder, self.tally)
        return _unpickled, (self.tally, (self.folder / FILE).read_bytes())


def _unpickled(tally: Tally, ledger: bytes) -> Comparison:
    """Return a comparison with a ledger, given as bytes, in a new temporary folder."""
    folder = _temporary_folder()
    folder.mkdir()
    (folder / FILE).write_bytes(ledger)
    return Comparison(folder, tally, True)


def _temporary_folder() -> Path:
    """Return the path of a folder, not made yet, in a new temporary folder."""
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
    """Compare methods: track each motion with each method and each seed.

    Args:
        methods: Each is the name of a registered method; or an optimiser's factory,
            which gets its `__name__` as its name and searches the prior `pca`; or a
            mapping with a `method`, its `name` in reports, and its `settings`.
        motions: Names or files of motions.
        seeds: The seeds, or how many.
        out: The folder of the ledger. If it has one, finished cells of registered
            methods do not run again. Cells of a factory always do, because its result
            may depend on a closure, a helper or a file, which is not part of a key. By
            default the folder is temporary.
        workers: Number of processes, by default one per processor.
        lists: Other fields of a plan: `views`, `corruptions`, `instances` and `grid`,
            and defaults such as `frames` and `evaluations`.

    Returns:
        The results.

    Raises:
        InputError: An argument is wrong.

    Example:
        >>> import posefit
        >>> result = posefit.compare(["random@pca"], seeds=1, frames=2, evaluations=40)
        >>> result.tally.done
        1
    """
    factories: dict[str, tuple[Callable[..., Any], str]] = {}
    # random, so that keys differ from those of earlier calls with these factories
    call = token_hex(4)
    entries = [_named(entry, call, factories) for entry in methods]
    register(factories)
    crossed = {"methods": entries, "motions": list(motions), "seeds": seeds}
    for name in ("views", "corruptions", "instances"):
        if name in lists:
            crossed[name] = lists.pop(name)
    grid = {}
    if "grid" in lists:
        grid["grid"] = lists.pop("grid")
    plan = Plan.of({"product": crossed, "defaults": lists, **grid})
    pool = Pool(
        cores() if workers is None else workers,
        Limits(),
        run_cell,
        partial(register, factories),
    )
    folder = _temporary_folder() if out is None else Path(out)
    say = interactive().log
    if factories and folder.exists():
        names = ", ".join(factories)
        say(
            f"cells of {names} run again, and their earlier rows in {folder} are kept "
            "with another version: only rows of registered methods are reused"
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
    """Return an entry of methods with a name instead of a factory.

    Adds the factory, with `call` in place of a digest of its source, to `factories`.
    """
    if isinstance(entry, Mapping):
        return {**entry, "method": _named(entry.get("method"), call, factories)}
    if not callable(entry):
        return entry
    name = getattr(entry, "__name__", type(entry).__name__)
    if name in factories and factories[name][0] is not entry:
        raise InputError(f"factories must have different names, got {name} twice")
    factories[name] = entry, call
    return name
