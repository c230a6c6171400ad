"""Comparisons from Python: rows that are reused are those of the same code, and nothing else is."""

import functools
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit import comparison
from posefit.motion.bvh import write_bvh
from posefit.motion.clips import load_motion
from posefit.registry import registry
from posefit.sweep.engine import Outcome
from tests.cases import each
from tests.sweep.fake import Instant

TINY: dict[str, Any] = {"seeds": 1, "frames": 1, "evaluations": 40, "size": [48, 36]}
PLACE = 0.0  # what one of the factories reads


class Here(Instant):
    """An engine that runs a cell in this process, as soon as it is asked."""

    def __init__(
        self, _workers: int, _limits: Any, run: Any, prepare: Callable[[], None]
    ) -> None:
        super().__init__()
        self._run = run
        prepare()

    def submit(self, cell: Any, tenant: str = "") -> None:
        self.ended.append(Outcome(cell, self._run(cell)))


@pytest.fixture(autouse=True)
def _in_this_process(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(comparison, "Pool", Here)
    monkeypatch.setattr("posefit.registry._own", {})
    yield
    registry.cache_clear()


class Still:
    """An optimiser that proposes one place."""

    def __init__(self, space: Any, rng: Any, *, place: float = 0.0) -> None:
        self.proposals = np.full((40, space.dimensions), place)

    def ask(self) -> Any:
        return self.proposals

    def tell(self, proposals: Any, costs: Any) -> None:
        pass


def closed(place: float) -> Any:
    class Fixed(Still):
        def __init__(self, space: Any, rng: Any) -> None:
            super().__init__(space, rng, place=place)

    return Fixed


def partly(place: float) -> Any:
    return functools.partial(Still, place=place)


def derived(place: float) -> Any:
    class Base(Still):
        where = place

    class Fixed(Base):
        def __init__(self, space: Any, rng: Any) -> None:
            super().__init__(space, rng, place=self.where)

    return Fixed


def helped(place: float) -> Any:
    global PLACE
    PLACE = place

    def fixed(space: Any, rng: Any) -> Still:
        return Still(space, rng, place=PLACE)

    return fixed


def typed_in(place: float) -> Any:
    names = {"Still": Still}
    exec(
        f"def fixed(space, rng):\n    return Still(space, rng, place={place})",
        names,
    )
    return names["fixed"]


def an_object(place: float) -> Any:
    class Maker:
        def __call__(self, space: Any, rng: Any) -> Still:
            return Still(space, rng, place=place)

    return Maker()


@each("changed", [closed, partly, derived, helped, typed_in, an_object])
def test_a_factory_runs_again_since_no_key_holds_all_that_it_depends_on(
    changed: Callable[[float], Any], tmp_path: Path
) -> None:
    def errors(place: float, folder: str) -> list[float]:
        out = tmp_path / folder
        compared = posefit.compare([changed(place)], out=out, **TINY)
        assert compared.tally.ran == 1
        return [row["error_degrees"]["mean"] for row in compared.rows()]

    first, second = (
        errors(place, folder) for place, folder in ((0.0, "a"), (0.9, "b"))
    )
    assert first != second
    assert errors(0.9, "a") == first + second


def test_registered_methods_are_not_run_again(tmp_path: Path, capsys: Any) -> None:
    for ran in (1, 0):
        compared = posefit.compare(["random@pca"], out=tmp_path / "kept", **TINY)
        assert compared.tally.ran == ran


def test_a_file_that_changes_between_comparisons_is_read_again(tmp_path: Path) -> None:
    motion = tmp_path / "mine.bvh"
    for name in ("walk", "squat"):
        write_bvh(motion, load_motion(name, 30.0))
        compared = posefit.compare(
            ["random@pca"], [str(motion)], out=tmp_path / "kept", **TINY
        )
        assert compared.tally.ran == 1


def test_a_comparison_is_pickled_with_its_rows(tmp_path: Path) -> None:
    for out in (None, tmp_path / "kept"):
        compared = posefit.compare(["random@pca"], out=out, **TINY)
        content = pickle.dumps(compared)
        rows = compared.rows()
        folder = compared.folder
        del compared
        assert folder.exists() == (out is not None)
        assert pickle.loads(content).rows() == rows
