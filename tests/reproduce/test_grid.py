"""Grids of runs by the sweep engine: plans into a ledger, and jobs."""

import os
from collections.abc import Iterator
from functools import partial
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest

from posefit.sweep.ledger import Ledger
from posefit.sweep.plan import Plan
from posefit_reproduce import grid
from posefit_reproduce.grid import each, earlier, kept, rows

PLAN = {
    "defaults": {"motion": "walk", "frames": 2, "evaluations": 80},
    "product": {"methods": ["sapso@pca", "random@pca"], "seeds": [1, 0]},
}


def said(_: str) -> None:
    """Say nothing."""


def test_rows_come_in_the_order_of_the_plan_and_are_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    plan = Plan.of(PLAN)
    ledger = tmp_path / "ledger"
    found = rows(plan, 2, str(ledger), said)
    assert [row["key"] for row in found] == [cell.key for cell in plan]
    assert [(row["spec"]["method"], row["spec"]["seed"]) for row in found] == [
        ("sapso@pca", 1), ("random@pca", 1), ("sapso@pca", 0), ("random@pca", 0),
    ]  # fmt: skip
    assert len(Ledger(ledger)) == 4
    # nothing is run again, so no row has another time
    monkeypatch.setattr(grid, "run_cell", None)
    assert rows(plan, 2, str(ledger), said) == found


def test_a_cell_that_fails_is_told_in_a_line(tmp_path: Path) -> None:
    # two of 40 particles in a budget of 80; the file is gone when the cell comes to be run
    clip = tmp_path / "clip.bvh"
    pytest.importorskip("pybvh")
    from posefit.motion import built_in
    from posefit.motion.bvh import write_bvh

    write_bvh(clip, built_in.motion("walk", frames=4))
    plan = Plan.of({"cells": [{"method": "random@pca", "motion": str(clip), "frames": 2, "evaluations": 80}]})
    clip.unlink()
    with pytest.raises(ValueError, match=r"random@pca on .*clip.bvh, instance 0, seed 0: .*clip.bvh"):
        rows(plan, 1, None, said)


def test_a_number_of_workers_below_one_is_a_mistake() -> None:
    for run in (partial(rows, Plan.of(PLAN), 0, None, said), partial(each, {"one": os.getpid}, 0)):
        with pytest.raises(ValueError, match="workers must be at least 1, got 0"):
            run()


def test_jobs_come_back_under_their_keys_from_other_processes() -> None:
    steps: list[int] = []

    def watched(found: Iterator[Any], count: int) -> Iterator[Any]:
        for one in found:
            steps.append(count)
            yield one

    found = each({k: partial(divmod, k, 3) for k in (5, 4, 9)}, 2, watched)
    assert list(found.items()) == [(5, (1, 2)), (4, (1, 1)), (9, (3, 0))]
    assert steps == [3, 3, 3]
    assert each({"who": os.getpid}, 1)["who"] != os.getpid()


def test_rows_are_written_as_they_come_and_read_again(tmp_path: Path) -> None:
    path = tmp_path / "rows.jsonl"
    found = {name: {"name": name, "cost": cost} for name, cost in (("one", 1.5), ("other", 2.5))}
    assert earlier(str(path), ("name", "cost"), itemgetter("name")) == {}
    coming = kept(str(path), None, iter(found.items()), 2)
    assert next(coming) == ("one", found["one"])
    assert len(path.read_text().splitlines()) == 1
    assert list(coming) == [("other", found["other"])]
    assert earlier(str(path), ("name", "cost"), itemgetter("name")) == found
    assert earlier(None, ("name", "cost"), itemgetter("name")) == {}


@pytest.mark.parametrize("line", ["[]", "3", "null", "", '{"name": "one"}', '{"name": [1], "cost": 2.0}', "name"])
def test_a_line_that_is_no_row_is_told_by_its_number(tmp_path: Path, line: str) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_text(f'{{"name": "one", "cost": 1.5}}\n{line}\n')
    with pytest.raises(ValueError, match=r"rows.jsonl: line 2 must be a row with name, cost, got another text"):
        earlier(str(path), ("name", "cost"), itemgetter("name"))
    with pytest.raises(ValueError, match="expected a file for rows, got"):
        earlier(str(tmp_path / "nowhere" / "rows.jsonl"), ("name", "cost"), itemgetter("name"))


def test_a_job_that_fails_says_which_and_why() -> None:
    with pytest.raises(ValueError, match=r"\('a', 0\): ZeroDivisionError"):
        each({("a", k): partial(divmod, 1, k) for k in (0, 1)}, 1)
