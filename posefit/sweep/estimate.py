"""How long a plan will take, from a few small cells of each kind that are really run."""

from collections.abc import Sequence
from dataclasses import replace

from posefit.sweep.cell import Cell
from posefit.sweep.engines.engine import Engine

FRAMES = (1, 4)  # of the cells that are tried
EVALUATIONS = 400  # of a frame of them, at most
PATIENCE = 0.2  # seconds


def estimated_seconds(cells: Sequence[Cell], engine: Engine, workers: int) -> float:
    """Return about how many seconds cells take on so many workers.

    For each kind of cell a short and a shorter one are run, each after one that compiles what is not compiled yet: they
    differ by what frames take. Raises ValueError where one fails.
    """
    kinds = {_kind(cell): cell for cell in cells}
    tried = {kind: _tried(cell) for kind, cell in kinds.items()}
    for one in tried.values():
        _run(one, engine)
    taken = {kind: _run(one, engine) for kind, one in tried.items()}
    total = 0.0
    for cell in cells:
        (short, first), (long, second) = taken[_kind(cell)]
        frame = max(second - first, 0.0) / max(long.frames - short.frames, 1)
        total += max(first - frame, 0.0) + frame * cell.frames * cell.evaluations / long.evaluations
    return total / workers


def _kind(cell: Cell) -> tuple[object, ...]:
    """Return what the time of a frame depends on."""
    return cell.method, str(cell.settings), cell.size, len(cell.view_degrees), bool(cell.corruption)


def _tried(cell: Cell) -> list[Cell]:
    evaluations = min(cell.evaluations, EVALUATIONS)
    return [replace(cell, frames=min(frames, cell.frames), evaluations=evaluations) for frames in FRAMES]


def _run(cells: Sequence[Cell], engine: Engine) -> list[tuple[Cell, float]]:
    taken = []
    for cell in cells:
        engine.submit(cell)
        while not (ended := engine.wait(PATIENCE)):
            pass
        if ended[0].result is None:
            raise ValueError(f"{cell}: {ended[0].reason}")
        taken.append((cell, float(ended[0].result.row["seconds"])))
    return taken
