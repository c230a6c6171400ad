"""How long single searches take is told from two shorter ones of their kind."""

from collections.abc import Sequence
from dataclasses import replace

from posefit.registry import registry
from posefit.settings import population
from posefit.sweep.estimate import Gauge, Kind
from posefit.sweep.single.search import SearchCell

EVALUATIONS = 200  # of the shorter of two searches that are tried, where a population is no larger
LONGER = 4  # times as many has the other


def _kind(cell: SearchCell) -> Kind:
    """Return what the time of an evaluation depends on."""
    return cell.method, str(cell.settings), cell.function, cell.dimension, cell.infeasible


def _tried(cell: SearchCell) -> Sequence[SearchCell]:
    size = population(registry().optimiser(cell.method), cell.settings, cell.evaluations)
    short = max(EVALUATIONS, size)
    return [replace(cell, evaluations=min(one, cell.evaluations)) for one in (short, LONGER * short)]


SEARCHES = Gauge(_kind, lambda cell: cell.evaluations, _tried)
