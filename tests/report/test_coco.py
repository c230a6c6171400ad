"""COCO's files: each method's runs, with the evaluations at which it reached each target."""

from pathlib import Path

import numpy as np
import pytest

from posefit.report.coco import write_coco
from posefit.report.reading import runs_of
from posefit.suites.problem import TARGETS
from posefit.sweep.ledger import Ledger
from tests.commands import error_of, run
from tests.report.browser import ledger, result
from tests.report.contests import FIRST
from tests.report.searched import cell, problems, search_result


@pytest.fixture
def results(tmp_path: Path) -> Path:
    """Return a ledger of two methods on functions 1 and 7 in two dimensions."""
    rows = []
    for method, targets in {"cma": 20, "random": 8}.items():
        for problem in [*problems([1], [9, 20], 15), *problems([7], [20], 15)]:
            row = search_result(cell(method, *problem), targets + problem[2] % 3)
            # below the targets: at one, the last bit of a logarithm would decide
            row["trace"]["cost"] = [0.99 * cost for cost in row["trace"]["cost"]]
            row["cost"] = row["trace"]["cost"][-1]
            rows.append(row)
    return ledger(tmp_path / "results", rows)


def test_files_hold_every_improvement_of_every_run(
    results: Path, tmp_path: Path
) -> None:
    with Ledger(results) as opened:
        runs = runs_of(opened)
        write_coco(runs, tmp_path / "coco")
    folders = {path.name for path in (tmp_path / "coco").iterdir()}
    assert folders == set(runs.methods) == {"cma", "random"}
    names = sorted(path.name for path in (tmp_path / "coco" / "cma").iterdir())
    assert names == [
        "f1.info",
        "f1_DIM20.dat",
        "f1_DIM20.tdat",
        "f1_DIM9.dat",
        "f1_DIM9.tdat",
        "f7.info",
        "f7_DIM20.dat",
        "f7_DIM20.tdat",
    ]
    text = (tmp_path / "coco" / "cma" / "f1_DIM9.dat").read_text()
    assert text.count("%") == 15
    first = text.split("%")[1].splitlines()[1:]
    own = next(
        each
        for each in runs.data["runs"]
        if (each.method, each.function, each.dimension, each.instance)
        == ("cma", 1, 9, 10_000)
    )
    rows = np.array([line.split() for line in first], dtype=float)
    assert np.array_equal(rows[:, 0], own.evaluations)
    assert np.allclose(rows[:, 2], own.costs - own.truth_cost, rtol=1e-9)
    index = (tmp_path / "coco" / "cma" / "f1.info").read_text()
    assert "suite = 'posefit-2026.3', funcId = 1, DIM = 9, " in index
    assert "f1_DIM9.dat, 10000:900|" in index


@pytest.mark.filterwarnings("ignore")  # of cocopp's own
def test_cocopp_finds_the_evaluations_to_every_target(
    results: Path, tmp_path: Path
) -> None:
    cocopp = pytest.importorskip("cocopp", reason="it is in no extra")
    from posefit_bridges.coco import add_to_cocopp

    add_to_cocopp()
    add_to_cocopp()  # twice does no harm
    out = run("report", results, "--coco", tmp_path / "coco")
    assert out.exit_code == 0, out.stderr
    with Ledger(results) as opened:
        runs = runs_of(opened).data["runs"]
    testbed = cocopp.testbedsettings.PosefitTestbed(lambda values: values)
    assert np.allclose(testbed.pprldmany_target_values, TARGETS, rtol=1e-12)
    for method in ("cma", "random"):
        for data in cocopp.load(str(tmp_path / "coco" / method)):
            own = [
                each
                for each in runs
                if (each.method, each.function, each.dimension)
                == (method, data.funcId, data.dim)
            ]
            own.sort(key=lambda each: each.instance)
            assert data.instancenumbers == [each.instance for each in own]
            for target in testbed.pprldmany_target_values:
                hits = []
                for each in own:
                    reached = each.costs - each.truth_cost <= target
                    hits.append([*each.evaluations[reached], np.nan][0])
                assert np.array_equal(data.detEvals([target])[0], hits, equal_nan=True)


def test_files_of_tracks_and_over_others_are_refused_in_one_line(
    results: Path, tmp_path: Path
) -> None:
    (tmp_path / "mine").mkdir()
    assert "mine: expected a new name to write to, got one that exists" in error_of(
        "report", results, "--coco", tmp_path / "mine"
    )
    tracks = ledger(tmp_path / "tracks", [result(FIRST, 1.0)])
    assert (
        "--coco must be given with a sweep of single searches, got one of tracks"
        in error_of("report", tracks, "--coco", tmp_path / "coco")
    )
    assert not (tmp_path / "coco").exists()
