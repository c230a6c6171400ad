"""The other data of a million rows, which as objects would fill the memory."""

from array import array
from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.statistics.profiles import Trace


class Stored(Protocol):
    """Values that are made when they are read. Any sequence fits this protocol."""

    def __getitem__(self, k: int, /) -> Any: ...

    def __len__(self) -> int: ...


class Store(Stored, Protocol):
    """Values in the order in which they are added. Any list fits this protocol."""

    def append(self, value: Any, /) -> None:
        """Add a value."""
        ...


class Packed:
    """Arrays of float32 of any lengths, one after the other in one array."""

    def __init__(self) -> None:
        self._values = array("f")
        self._ends = array("q", [0])

    def append(self, value: Array) -> None:
        """Add an array (n,)."""
        self._values.frombytes(np.asarray(value, np.float32).tobytes())
        self._ends.append(len(self._values))

    def __getitem__(self, k: int) -> Array:
        values = np.frombuffer(self._values, np.float32)
        return np.asarray(values[self._ends[k] : self._ends[k + 1]])

    def __len__(self) -> int:
        return len(self._ends) - 1


class Traces:
    """Traces: numbers of evaluations, which many have in common, and the best costs."""

    def __init__(self) -> None:
        self._distinct: list[Array] = []  # evaluations, each once
        self._indices: dict[bytes, int] = {}  # their indices in the list
        self._used = array("q")  # the index of each trace's evaluations
        self._costs = Packed()

    def append(self, trace: Trace) -> None:
        """Add the evaluations (n,) at which the cost fell, and the costs (n,)."""
        used, costs = trace
        name = used.tobytes()
        if name not in self._indices:
            self._indices[name] = len(self._distinct)
            self._distinct.append(used)
        self._used.append(self._indices[name])
        self._costs.append(costs)

    def __getitem__(self, k: int) -> Trace:
        return self._distinct[self._used[k]], self._costs[k]

    def __len__(self) -> int:
        return len(self._used)


class Ordered(Sequence[Any]):
    """Some values of a store in another order, which are not copied."""

    def __init__(self, store: Stored, order: NDArray[np.int64]) -> None:
        """Choose values.

        Args:
            store: The values.
            order: The indices (n,) of those chosen.
        """
        self._store = store
        self._order = order

    def __getitem__(self, k: Any) -> Any:
        return self._store[int(self._order[k])]

    def __len__(self) -> int:
        return len(self._order)
