"""The command of a row runs it again."""

import json
import os
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from posefit.registry import register, registry
from posefit.sweep.cell import run_cell
from posefit.sweep.check import cell_of, search_of
from posefit.sweep.plan import Plan
from posefit.sweep.repeat import differences, repeat_command
from tests.cases import each
from tests.commands import error_of, run
from tests.report.browser import ledger, result
from tests.sweep.fake import cells, rows_in

SMALL: dict[str, Any] = {"frames": 2, "size": [80, 60], "evaluations": 80}
SPECS: list[dict[str, Any]] = [
    {
        "method": "sapso@pca",
        "motion": "walk",
        "settings": {"sapso": {"cooling": 0.9}},
        "instance": 3,
        "seed": 4,
    },
    {
        "method": "random@full",
        "motion": "run",
        "settings": {"full.limits": "training"},
        "view_degrees": [0, 90.5],
    },
    {
        "method": "cma@pca",
        "motion": "walk-a",
        "corruption": {"holes": 0.3, "dropped": 0.1},
        "train": ["walk", "run"],
    },
    {
        "method": "sapso@pca",
        "motion": "walk",
        "settings": {"tracker.root_range_degrees": "40,10,10"},
        "seed": 1,
    },
]
SEARCH: dict[str, Any] = {
    **{
        "method": "pso",
        "suite": "posefit-2026.3",
        "function": 7,
        "dimension": 24,
        "instance": 3,
        "seed": 5,
    },
    **{"budget": 30, "infeasible": "reject", "settings": {"population_size": 20}},
}


def plan_in(text: str) -> dict[str, Any]:
    """Return the tables that a command gives to posefit."""
    first, *lines, last = text.split("\n")
    assert (first, last) == ("posefit sweep - --out rerun <<'END'", "END")
    return tomllib.loads("\n".join(lines))


def test_the_command_is_a_plan_of_the_cell() -> None:
    for cell in (search_of(SEARCH), *(cell_of(SMALL | spec) for spec in SPECS)):
        assert [
            planned.key for planned in Plan.of(plan_in(repeat_command(cell.spec)))
        ] == [cell.key]


@each("step", [None, 0.5, 2])
def test_a_search_is_repeated_with_its_settings_whatever_their_type(
    step: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("posefit.registry._own", {})

    def stepping(space: Any, rng: Any, *, step: float | None = 0.1) -> Any:
        """Never runs."""

    register({"stepping": (stepping, "1")})
    method = {"method": "stepping", "settings": {"step": step}}
    searches = {
        "suite": SEARCH["suite"],
        "methods": [method],
        "functions": [1],
        "dimensions": [9],
        "instances": [3],
        "seeds": 1,
        "budgets": [30],
    }
    (cell,) = Plan.of(searches)
    assert cell.settings == {"step": step}
    (planned,) = Plan.of(plan_in(repeat_command(cell.spec)))
    assert planned.key == cell.key
    registry.cache_clear()


def test_the_command_runs_the_row_again(tmp_path: Path) -> None:
    bash = shutil.which("bash")
    posefit = Path(sys.executable).with_name("posefit")
    if bash is None or not posefit.exists():
        pytest.skip("needs a shell and the command posefit beside Python")
    cell = cell_of(SMALL | SPECS[0])
    environment = {
        **os.environ,
        "PATH": os.pathsep.join([str(posefit.parent), os.environ["PATH"]]),
    }
    words = [bash, "-c", repeat_command(cell.spec)]
    subprocess.run(
        words, cwd=tmp_path, env=environment, check=True, capture_output=True
    )
    (row,) = rows_in(tmp_path / "rerun")
    expected = run_cell(cell)
    for name in ("seconds", "seconds_per_frame", "cpu_seconds_per_frame"):
        row.pop(name), expected.pop(name)
    assert row == expected


def test_nothing_in_a_name_ends_the_plan_or_reaches_the_shell() -> None:
    for name in (
        'a"b',
        "END",
        "a\nEND\nrm -rf /",
        "$(id) `id` 'x' \\",
        "\x7f\x85\u2028</script>",
        "é漢",
    ):
        more: dict[str, Any] = {
            "settings": {f"sapso.{name}": name},
            "corruption": {name: 0.5},
        }
        command = repeat_command(
            replace(cells(1)[0], motion=name, train=(name,), **more).spec
        )
        (cell,) = plan_in(command)["cells"]
        assert cell.items() >= {"motion": name, "train": [name], **more}.items()
        assert "END" not in command.split("\n")[1:-1]


def test_a_row_is_run_again_by_the_first_digits_of_its_key(tmp_path: Path) -> None:
    made = [run_cell(cell_of(SMALL | spec)) for spec in SPECS[:2]]
    path = ledger(tmp_path / "results", made)
    key = made[0]["key"]
    done = run("rerun", path, key[:8], "--out", tmp_path / "again")
    assert (done.exit_code, done.stdout) == (
        0,
        "every figure but the times is the same\n",
    )
    (row,) = rows_in(tmp_path / "again")
    assert row["key"] == key


@pytest.mark.parametrize("spec", [SEARCH, SMALL | SPECS[0]])
def test_a_row_is_not_compared_with_itself(
    spec: dict[str, Any], tmp_path: Path
) -> None:
    cell = search_of(spec) if "suite" in spec else cell_of(spec)
    assert cell is not None
    path = ledger(tmp_path / "results", [run_cell(cell)])
    message = error_of("rerun", path, cell.key[:8], "--out", path)
    assert "--out must be a new folder or a ledger without this cell" in message


def test_differences_of_a_row_that_is_run_again_are_printed(tmp_path: Path) -> None:
    made = run_cell(cell_of(SMALL | SPECS[0]))
    iou = made["iou"]
    made["iou"] = 0.25
    path = ledger(tmp_path / "results", [made])
    done = run("rerun", path, made["key"][:8], "--json")
    assert done.exit_code == 1
    assert json.loads(done.stdout) == {
        "same": False,
        "differences": [f"iou: 0.25 before, {iou} now"],
    }
    assert [entry.name for entry in tmp_path.iterdir()] == ["results"]


@each(
    ("earlier", "now", "line"),
    [
        ({"80": 0.9}, None, "coverage.80: 0.9 before, None now"),
        (None, {"80": 0.9}, "coverage.80: None before, 0.9 now"),
    ],
)
def test_a_figure_that_only_one_of_two_rows_has_differs(earlier, now, line) -> None:
    row = result(cells(1)[0], 1.0)
    rows = [{**row, "coverage": coverage} for coverage in (earlier, now)]
    assert line in differences(*rows)


def test_a_key_that_no_row_or_several_have_is_reported_in_one_line(
    tmp_path: Path,
) -> None:
    made = []
    for seed in range(1000):
        cell = cell_of(SMALL | SPECS[0] | {"seed": seed})
        if cell.key.startswith("0") and len(made) < 2:
            made.append(run_cell(cell))
    path = ledger(tmp_path / "results", made)
    assert "whose key begins with 'xyz', got none" in error_of("rerun", path, "xyz")
    assert "must be the first digits of a row's key, got none" in error_of(
        "rerun", path, ""
    )
    assert "got 2: give more digits" in error_of("rerun", path, "0")
