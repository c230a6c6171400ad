"""How long a plan will take, from a few small cells of each kind that are really run."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Generic, TypeVar

from posefit.sweep.cell import Cell
from posefit.sweep.engines.engine import Engine, Keyed

FRAMES = (1, 4)  # of the cells that are tried
EVALUATIONS = 400  # of a frame of them, at most
SECONDS = 120.0  # that one of them may take at most, whatever a cell may
PATIENCE = 0.2  # seconds

Kind = tuple[object, ...]
C = TypeVar("C", bound=Keyed)


@dataclass(frozen=True)
class Gauge(Generic[C]):
    """How the time that cells of one sort take is told from a few smaller ones."""

    kind: Callable[[C], Kind]  # what the time of an evaluation depends on
    work: Callable[[C], int]  # evaluations, of all frames
    tried: Callable[[C], Sequence[C]]  # the two cells that are run instead of one, the smaller first


@dataclass
class Amount:
    """Cells of one kind, told by numbers: there may be a million of them."""

    largest: Any  # the first of those with the most work: a smaller one may be too short to tell what evaluations take
    count: int = 0
    work: int = 0  # evaluations of all frames


@dataclass
class Amounts:
    """The cells of a plan that are to run, by kind."""

    gauge: Gauge[Any]
    kinds: dict[Kind, Amount] = field(default_factory=dict)

    def add(self, cell: Keyed) -> None:
        """Take note of a cell."""
        one, work = self.kinds.setdefault(self.gauge.kind(cell), Amount(cell)), self.gauge.work(cell)
        one.count += 1
        one.work += work
        if work > self.gauge.work(one.largest):
            one.largest = cell

    def __len__(self) -> int:
        return sum(one.count for one in self.kinds.values())


@dataclass(frozen=True)
class Estimate:
    """About how many seconds cells take, and of those kinds that could not be tried a cell and the reason."""

    seconds: float
    untried: Mapping[str, str]


def estimate_of(amounts: Amounts, engine: Engine, workers: int) -> Estimate:
    """Return about how long cells take on so many workers.

    For each kind of cell a short and a shorter one are run, each after one that compiles what is not compiled yet: they
    differ by what evaluations take. A kind that fails, as it would in the sweep, counts for nothing and is named.
    """
    total, untried, gauge = 0.0, {}, amounts.gauge
    warmed = {kind: _run(gauge.tried(one.largest), engine) for kind, one in amounts.kinds.items()}
    for kind, one in amounts.kinds.items():
        taken = warmed[kind] if isinstance(warmed[kind], str) else _run(gauge.tried(one.largest), engine)
        if isinstance(taken, str):
            untried[str(one.largest)] = taken
            continue
        (short, first), (long, second) = ((gauge.work(cell), seconds) for cell, seconds in taken)
        each = max(second - first, 0.0) / (long - short) if long > short else 0.0  # seconds of an evaluation
        total += one.count * max(first - each * short, 0.0) + each * one.work
    return Estimate(total / workers, untried)


def _kind(cell: Cell) -> Kind:
    """Return what the time of a frame depends on."""
    return cell.method, str(cell.settings), cell.tracks, cell.size, len(cell.view_degrees), bool(cell.corruption)


def _tried(cell: Cell) -> list[Cell]:
    evaluations = min(cell.evaluations, EVALUATIONS)
    return [replace(cell, frames=min(frames, cell.frames), evaluations=evaluations) for frames in FRAMES]


TRACKS = Gauge(_kind, lambda cell: cell.frames * cell.evaluations, _tried)


def _run(cells: Sequence[Keyed], engine: Engine) -> list[tuple[Keyed, float]] | str:
    """Return the cells with the seconds that each took, or why one failed."""
    taken = []
    for cell in cells:
        engine.submit(cell)
        while not (ended := engine.wait(PATIENCE)):
            pass
        if ended[0].result is None:
            return ended[0].reason or "what ran it was lost"
        taken.append((cell, float(ended[0].result.row["seconds"])))
    return taken
