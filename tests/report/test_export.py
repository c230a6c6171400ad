"""IOHprofiler folders, opened by iohinspector, CSV, and tables for LaTeX."""

import csv
import json
import re
from itertools import product
from pathlib import Path

import iohinspector
import numpy as np
import pytest

from posefit.report import export
from posefit.report.export import latex, latex_table, write_csv, write_iohprofiler
from posefit.suites.problem import TARGETS
from posefit.suites.running import SuiteRun


def run(method="sapso", settings=None, function=1, dimension=9, instance=0, seed=0, evaluations=(1, 40, 80), costs=(90.0, 5.0, 2.5)):  # fmt: skip
    trace = np.array(evaluations, float), np.array(costs, float)
    return SuiteRun("posefit-2026.3", method, settings or {}, function, dimension, instance, seed, 900, "repair", 0.0, TARGETS, *trace)  # fmt: skip


def sweep():
    """Return runs of three algorithms on two functions, three instances and two seeds, from random costs."""
    rng = np.random.default_rng(0)
    algorithms = (("sapso", {}), ("nevergrad:NGOpt", {}), ("sapso", {"cooling": 0.9}))
    for algorithm, function, instance, seed in product(algorithms, (1, 7), (2, 0, 1), (1, 0)):
        used = np.cumsum(rng.integers(1, 50, 20))
        yield run(
            *algorithm,
            function,
            9 if function == 1 else 20,
            instance,
            seed,
            used,
            np.sort(rng.uniform(0, 99, 20))[::-1],
        )


def opened(folder):
    manager = iohinspector.DataManager()
    manager.add_folder(str(folder))
    return manager


def test_iohinspector_opens_every_run(tmp_path):
    write_iohprofiler(list(sweep()), tmp_path / "ioh")
    overview = opened(tmp_path / "ioh").overview
    assert len(overview) == 3 * 2 * 3 * 2
    assert set(overview["algorithm_name"]) == {"sapso #1", "sapso #2", "nevergrad:NGOpt"}
    infos = ({"infeasible proposals": "repair"}, {"cooling": 0.9, "infeasible proposals": "repair"})
    assert set(overview["algorithm_info"]) == set(map(json.dumps, infos))
    assert set(zip(overview["function_name"], overview["function_id"], overview["dimension"], strict=True)) == {
        ("single image", 1, 9),
        ("high-dimensional", 7, 20),
    }
    assert sorted(set(overview["instance"])) == [0, 1, 2]
    expected = sorted((float(logged.costs[-1]), int(logged.evaluations[-1])) for logged in sweep())
    assert sorted(zip(overview["best_y"], overview["evals"], strict=True)) == expected


def test_iohinspector_reads_every_cost_to_the_last_bit(tmp_path):
    write_iohprofiler(list(sweep()), tmp_path / "ioh")
    manager = opened(tmp_path / "ioh")
    data = manager.load(monotonic=False)
    last = manager.overview["data_id", "best_y"].to_dict(as_series=False)
    key = dict(zip(last["best_y"], last["data_id"], strict=True))
    for logged in sweep():
        rows = data.filter(data["data_id"] == key[float(logged.costs[-1])])
        first = [(1, np.inf)] if logged.evaluations[0] > 1 else []  # no cost that was not measured
        expected = [*first, *zip(logged.evaluations, logged.costs, strict=True)]
        assert list(zip(rows["evaluations"].to_list(), rows["raw_y"].to_list(), strict=True)) == expected


def test_iohinspectors_expected_running_time_is_ours(tmp_path):
    from iohinspector.metrics.fixed_target import aggregate_running_time

    from posefit.statistics.profiles import expected_running_time, hits

    runs = [run(seed=k, evaluations=(1, 40, 80), costs=(90.0, 20.0, last)) for k, last in enumerate((4.0, 9.0, 16.0))]
    write_iohprofiler(runs, tmp_path / "ioh")
    data = opened(tmp_path / "ioh").load(include_meta_data=True)
    table = aggregate_running_time(data, f_min=5.0, f_max=50.0, scale_f_log=False)
    targets = table["raw_y"].to_numpy()
    ours = expected_running_time(
        [hits((np.array(logged.evaluations), np.array(logged.costs)), targets) for logged in runs], [80] * 3
    )
    between = (targets > 4.0) & ~np.isin(targets, [9.0, 16.0, 20.0])
    assert np.allclose(table["ERT"][between], ours[between])


def test_the_files_are_where_iohprofiler_has_them(tmp_path):
    write_iohprofiler([run(seed=3)], tmp_path / "ioh")
    assert sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*") if path.is_file()) == [
        "ioh/sapso/IOHprofiler_f1_single-image.json",
        "ioh/sapso/data_f1_single-image/IOHprofiler_f1_DIM9.dat",
    ]
    summary = json.loads((tmp_path / "ioh/sapso/IOHprofiler_f1_single-image.json").read_text())
    version = summary.pop("version"), summary.pop("experiment_attributes")
    assert version == (export.FORMAT, [{"posefit": export.__version__}])
    assert summary == {
        "suite": "posefit",
        "function_id": 1,
        "function_name": "single image",
        "maximization": False,
        "algorithm": {"name": "sapso", "info": '{"infeasible proposals": "repair"}'},
        "attributes": ["evaluations", "raw_y"],
        "run_attributes": ["seed"],
        "scenarios": [
            {
                "dimension": 9,
                "path": "data_f1_single-image/IOHprofiler_f1_DIM9.dat",
                "runs": [{"instance": 0, "evals": 80, "best": {"evals": 80, "y": 2.5, "x": []}, "seed": 3}],
            }
        ],
    }


def test_a_row_is_written_wherever_the_cost_falls_and_at_the_end(tmp_path):
    runs = [
        run(evaluations=(1, 2, 3, 4, 5), costs=(9.0, 9.0, 7.0, 7.0, 7.0)),
        run(instance=1, evaluations=(40, 80), costs=(9.0, 9.0)),
        run(instance=2, evaluations=(40,), costs=(120.0,)),
    ]
    write_iohprofiler(runs, tmp_path / "ioh")
    text = next(tmp_path.rglob("*.dat")).read_text()
    rows = ["", "1 9.0\n3 7.0\n5 7.0\n", "1 inf\n40 9.0\n80 9.0\n", "1 inf\n40 120.0\n"]
    assert text.split("evaluations raw_y\n") == rows
    runs = json.loads(next(tmp_path.rglob("*.json")).read_text())["scenarios"][0]["runs"]
    best = [(entry["evals"], entry["best"]["evals"], entry["best"]["y"]) for entry in runs]
    assert best == [(5, 3, 7.0), (80, 40, 9.0), (40, 40, 120.0)]


def test_one_method_and_problem_in_two_dimensions_are_two_scenarios(tmp_path):
    write_iohprofiler([run(), run(dimension=12, costs=(8.0, 3.0, 1.0))], tmp_path / "ioh")
    overview = opened(tmp_path / "ioh").overview
    assert sorted(zip(overview["dimension"], overview["best_y"], strict=True)) == [(9, 2.5), (12, 1.0)]


def test_hostile_names_stay_in_their_folder_and_are_not_run_by_a_reader(tmp_path):
    trap = tmp_path / "trap"
    wicked = f"__import__('pathlib').Path({str(trap)!r}).touch()"
    names = ["../../out", "/etc", "..", "", "CON:", 'a"b\nc', "Ä ß", "a/b", "a?b", "A?B", "x" * 300, wicked]
    write_iohprofiler([run(method=name, settings={wicked: wicked}) for name in names], tmp_path / "ioh")
    assert [path.name for path in tmp_path.iterdir()] == ["ioh"]
    overview = opened(tmp_path / "ioh").overview
    assert sorted(overview["algorithm_name"]) == sorted(names)
    folders = [path.name for path in (tmp_path / "ioh").iterdir()]
    assert len({name.lower() for name in folders}) == len(names)
    assert not trap.exists()


def test_a_run_twice_and_a_folder_that_exists_are_refused_and_nothing_is_written(tmp_path):
    with pytest.raises(ValueError, match="runs must differ, got two of sapso on posefit-2026.3"):
        write_iohprofiler([run(), run()], tmp_path / "ioh")
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(ValueError, match="expected a new name to write to, got one that exists"):
        write_iohprofiler([run()], tmp_path)


def test_csv_is_read_back_with_what_would_break_it(tmp_path):
    rows = [{"method": 'a,"b"\nc', "error": 0.1 + 0.2}, {"method": "Ä", "lost": None, "error": 1}]
    write_csv(rows, tmp_path / "rows.csv")
    with (tmp_path / "rows.csv").open(newline="", encoding="utf-8") as file:
        read = list(csv.DictReader(file))
    assert read == [
        {"method": 'a,"b"\nc', "error": "0.30000000000000004", "lost": ""},
        {"method": "Ä", "error": "1", "lost": ""},
    ]


def test_csv_without_rows_or_over_a_file_is_refused(tmp_path):
    with pytest.raises(ValueError, match="rows must be at least one, got none"):
        write_csv([], tmp_path / "rows.csv")
    assert list(tmp_path.iterdir()) == []
    Path(tmp_path / "rows.csv").write_text("mine")
    with pytest.raises(ValueError, match="rows.csv: expected a new name to write to, got one that exists"):
        write_csv([{"a": 1}], tmp_path / "rows.csv")
    assert (tmp_path / "rows.csv").read_text() == "mine"


def test_a_table_by_hand():
    text = latex_table(["method", "error", "runs"], [["sapso@pca", 1.056, 10], ["a_b & c", None, 3]])
    assert text.splitlines() == [
        r"\begin{tabular}{lrr}",
        r"\hline",
        r"method & error & runs \\",
        r"\hline",
        r"sapso@pca & 1.06 & 10 \\",
        r"a\_b \& c & -- & 3 \\",
        r"\hline",
        r"\end{tabular}",
    ]
    assert r"-- \\" in latex_table(["low"], [[float("nan")]])


def test_every_sign_that_latex_would_read_is_escaped():
    text = latex("\\input{x} $a^2$ #1 50% ~ <|> [2]\n\nend")
    assert text == (
        r"\textbackslash{}input\{x\} \$a\textasciicircum{}2\$ \#1 50\% \textasciitilde{} "
        r"\textless{}\textbar{}\textgreater{} {[}2{]} end"
    )
    # what is left of commands once the escapes themselves are gone
    assert not re.search(r"[\\$^~#%&_]", re.sub(r"\\(text\w+\{\}|[&%$#_{}])", "", text))
