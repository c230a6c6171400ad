"""What a report needs to know about a kind of runs: tracks, or single searches."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.report.columns import Column, Score

if TYPE_CHECKING:
    from posefit.report.contest import Contest
    from posefit.report.leaderboard import Baseline, Standings
    from posefit.report.runs import Runs

Place = Mapping[str, Any]  # the fields of a plan that define an instance
Row = Mapping[str, Any]  # of a ledger
Indices = Array | NDArray[np.int64]  # of rows


class Kind(Protocol):
    """A kind of runs: `posefit.report.tracks.Tracks` or `.searches.Searches`.

    Attributes:
        name: The kind's name, in the singular.
        noun: Its runs, in the plural.
        title: The title of the page.
        columns: Its figures by name.
        score: The figure that orders the methods.
    """

    name: str
    noun: str
    title: str
    columns: Mapping[str, Column]
    score: Score

    def computed(self, row: Row, /) -> dict[str, float]:
        """Return the figures that a row of a ledger does not have itself."""
        ...

    def read(
        self, row: Row, shared: dict[bytes, Any], /
    ) -> tuple[Array, dict[str, Any]]:
        """Return the figures of a row, and its other data by name.

        `shared` holds arrays that many rows have in common, to save memory.
        """
        ...

    def rank(self, place: Place) -> tuple[Any, ...]:
        """Return the key by which instances are sorted."""
        ...

    def place_name(self, place: Place) -> str:
        """Return an instance's name."""
        ...

    def facts(self, runs: "Runs") -> dict[str, Any]:
        """Return the facts about the runs by their titles."""
        ...

    def tested_errors(self, contest: "Contest") -> Array:
        """Return the errors (methods, blocks, 1) for tests. Lower is better."""
        ...

    def figures(self, runs: "Runs", rows: Indices) -> dict[str, float | None]:
        """Return each figure of some rows, given by their indices, together."""
        ...

    def interval(self, contest: "Contest", place: int) -> tuple[float, float]:
        """Return the ends of the 95 % interval of a method's score, nan if unknown.

        The method is given by its place among those that take part.
        """
        ...

    def baselines(self, contest: "Contest") -> "list[Baseline]":
        """Return the baselines, on the same runs as the methods."""
        ...

    def place_words(self, contest: "Contest") -> str:
        """Return the instances of a contest in words."""
        ...

    def baseline_sentences(self, standings: "Standings") -> Sequence[str]:
        """Return sentences that compare the best baseline with the first method."""
        ...

    def page(self, runs: "Runs", standings: "Standings | None", /) -> dict[str, Any]:
        """Return the data that only pages of this kind have, with their `sections`."""
        ...
