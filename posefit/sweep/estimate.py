"""How long a plan will take, from a few small cells of each kind that are really run."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

from posefit.sweep.cell import Cell
from posefit.sweep.engines.engine import Engine

FRAMES = (1, 4)  # of the cells that are tried
EVALUATIONS = 400  # of a frame of them, at most
SECONDS = 120.0  # that one of them may take at most, whatever a cell may
PATIENCE = 0.2  # seconds

Kind = tuple[object, ...]


@dataclass
class Amount:
    """Cells of one kind, told by numbers: there may be a million of them."""

    first: Cell
    count: int = 0
    work: int = 0  # evaluations of all frames


@dataclass
class Amounts:
    """The cells of a plan that are to run, by kind."""

    kinds: dict[Kind, Amount] = field(default_factory=dict)

    def add(self, cell: Cell) -> None:
        """Take note of a cell."""
        one = self.kinds.setdefault(_kind(cell), Amount(cell))
        one.count += 1
        one.work += cell.frames * cell.evaluations

    def __len__(self) -> int:
        return sum(one.count for one in self.kinds.values())


@dataclass(frozen=True)
class Estimate:
    """About how many seconds cells take, and of those kinds that could not be tried the first cell and the reason."""

    seconds: float
    untried: Mapping[str, str]


def estimate_of(amounts: Amounts, engine: Engine, workers: int) -> Estimate:
    """Return about how long cells take on so many workers.

    For each kind of cell a short and a shorter one are run, each after one that compiles what is not compiled yet: they
    differ by what frames take. A kind that fails, as it would in the sweep, counts for nothing and is named.
    """
    total, untried = 0.0, {}
    warmed = {kind: _run(_tried(one.first), engine) for kind, one in amounts.kinds.items()}
    for kind, one in amounts.kinds.items():
        taken = warmed[kind] if isinstance(warmed[kind], str) else _run(_tried(one.first), engine)
        if isinstance(taken, str):
            untried[str(one.first)] = taken
            continue
        (short, first), (long, second) = taken
        frame = max(second - first, 0.0) / max(long.frames - short.frames, 1)
        total += one.count * max(first - frame, 0.0) + frame * one.work / long.evaluations
    return Estimate(total / workers, untried)


def _kind(cell: Cell) -> Kind:
    """Return what the time of a frame depends on."""
    return cell.method, str(cell.settings), cell.tracks, cell.size, len(cell.view_degrees), bool(cell.corruption)


def _tried(cell: Cell) -> list[Cell]:
    evaluations = min(cell.evaluations, EVALUATIONS)
    return [replace(cell, frames=min(frames, cell.frames), evaluations=evaluations) for frames in FRAMES]


def _run(cells: Sequence[Cell], engine: Engine) -> list[tuple[Cell, float]] | str:
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
