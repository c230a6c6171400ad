"""The shards of a plan: parts of a sweep that machines run independently.

Each shard I/N has a separate ledger in the same folder.
"""

import re
from collections.abc import Iterable, Iterator
from pathlib import Path

from posefit.errors import InputError
from posefit.reading import cut
from posefit.sweep.cell import Cell
from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import MAX_CELLS
from posefit.sweep.schema import FILE

SHARDS = "ledger-*-of-*.sqlite"  # matches the names that `file_of` returns


def file_of(shard: str | None) -> str:
    """Return the name of a ledger's file: of a shard I/N, or of all cells for None.

    Raises InputError if the shard is not I/N.
    """
    if shard is None:
        return FILE
    match = re.fullmatch(r"([0-9]{1,7})/([0-9]{1,7})", shard)
    if not match or not 1 <= int(match[1]) <= int(match[2]) <= MAX_CELLS:
        raise InputError(f"--shard must be I/N such as 2/8, got {cut(shard)}")
    return f"ledger-{int(match[1])}-of-{int(match[2])}.sqlite"


def cells_of(plan: Iterable[Cell], shard: str | None) -> Iterator[Cell]:
    """Return the cells of a plan, or of one shard I/N.

    A cell's key alone decides its shard. So it does not move to another shard when the
    plan grows.
    """
    if shard is None:
        return iter(plan)
    number, count = map(int, shard.split("/"))
    return (cell for cell in plan if int(cell.key, 16) % count == number - 1)


def ledgers_of(out: str | Path, shard: str | None) -> list[Path]:
    """Return the ledgers whose finished cells a run does not repeat, its own first.

    The others are those of shards, for a run without shards.
    """
    ledgers = [Path(out) / file_of(shard)]
    if shard is None:
        ledgers += sorted(Path(out).glob(SHARDS))
    return ledgers


def done_in(ledgers: Iterable[Path]) -> set[str]:
    """Return the keys of the cells that are done in ledgers, as far as these exist."""
    files = [file for file in ledgers if file.exists() and file.stat().st_size]
    if not files:
        return set()
    with Ledger(*files) as ledger:
        return ledger.done()
