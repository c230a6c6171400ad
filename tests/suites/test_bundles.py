"""Bundles of runs: honest ones are verified, tampered ones are refused with the reason; the board ranks what is left."""

import io
import json
import re
import zipfile
from collections.abc import Callable
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.errors import InputError
from posefit.suites.bundles import digest_of, read_contents, write_bundle
from posefit.suites.functions import FUNCTIONS, HELD_OUT, SUITE
from posefit.suites.running import SuiteRun, run_of, run_on
from posefit.suites.verification import verified
from posefit.sweep.ledger import Ledger
from posefit.sweep.table import search_runs
from tests.cases import each
from tests.commands import error_of, run
from tests.report.browser import data_in
from tests.report.searched import searched
from tests.suites.test_command import swept

FIRST = HELD_OUT[0]
BUDGET = 80
RUNS = 16
REPEATS = 8  # of each kind of tampering, half of them with a digest that fits


@pytest.fixture(scope="module")
def runs() -> list[SuiteRun]:
    """Return the runs of two methods on two functions, two instances each, with two seeds."""
    methods = {"random": {}, "pso": {"population_size": 10}}
    return [
        run_on(posefit.suite(SUITE, function, instance), method, methods[method], evaluations=BUDGET, seed=seed)
        for method, function, instance, seed in product(methods, (1, 2), (FIRST, FIRST + 1), (0, 1))
    ]


@pytest.fixture(scope="module")
def honest(runs: list[SuiteRun], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("honest") / "honest.zip"
    write_bundle(runs, path)
    return path


Contents = dict[str, Any]  # the manifest, and arrays by their names


def contents_of(path: Path) -> Contents:
    manifest, arrays = read_contents(path)
    return {"manifest": manifest, **{name: array.copy() for name, array in arrays.items()}}


def packed(contents: Contents, path: Path, reseal: bool, renamed: dict[str, str] | None = None) -> Path:
    """Write contents as a bundle, with the digest that fits them or the one that they had."""
    manifest, arrays = contents["manifest"], {k: v for k, v in contents.items() if k != "manifest"}
    if reseal:
        manifest = {k: v for k, v in manifest.items() if k != "digest"}
        manifest["digest"] = digest_of(manifest, arrays)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        members = {"manifest.json": json.dumps(manifest).encode()}
        for name, array in arrays.items():
            buffer = io.BytesIO()
            np.save(buffer, array)
            members[f"{name}.npy"] = buffer.getvalue()
        for name, content in members.items():
            if (new := (renamed or {}).get(name, name)) != "":
                archive.writestr(new, content)
    return path


def of_run(contents: Contents, k: int) -> tuple[slice, slice]:
    """Return the places of a run's improvements, and of their coordinates."""
    entries = contents["manifest"]["runs"]
    steps = [0, *np.cumsum([one["improvements"] for one in entries]).tolist()]
    numbers = [0, *np.cumsum([one["improvements"] * one["dimension"] for one in entries]).tolist()]
    return slice(steps[k], steps[k + 1]), slice(numbers[k], numbers[k + 1])


def any_run(contents: Contents, rng: np.random.Generator, least: int = 2) -> int:
    """Return a run with so many improvements."""
    entries = contents["manifest"]["runs"]
    return int(rng.choice([k for k, one in enumerate(entries) if one["improvements"] >= least]))


def no_number(contents: Contents, rng: np.random.Generator) -> None:
    contents[rng.choice(["points", "costs"])][0] = np.nan


def fewer_in_all(contents: Contents, rng: np.random.Generator) -> None:
    k = any_run(contents, rng)
    contents["manifest"]["runs"][k]["evaluations"] = int(contents["evaluations"][of_run(contents, k)[0].stop - 2])


def rising_costs(contents: Contents, rng: np.random.Generator) -> None:
    k = any_run(contents, rng)
    d, (steps, numbers) = contents["manifest"]["runs"][k]["dimension"], of_run(contents, k)
    contents["costs"][steps] = contents["costs"][steps][::-1]
    contents["points"][numbers] = contents["points"][numbers].reshape(-1, d)[::-1].ravel()


def no_dimension(contents: Contents, rng: np.random.Generator) -> None:
    k = any_run(contents, rng)
    entry, place = contents["manifest"]["runs"][k], of_run(contents, k)[1]
    longer = np.pad(contents["points"][place].reshape(-1, entry["dimension"]), ((0, 0), (0, 2))).ravel()
    contents["points"] = np.concatenate([contents["points"][: place.start], longer, contents["points"][place.stop :]])
    entry["dimension"] += 2


def no_suite(contents: Contents, rng: np.random.Generator) -> None:
    contents["manifest"]["suite"] = "posefit-1999.1"


def twice(contents: Contents, rng: np.random.Generator) -> None:
    k = any_run(contents, rng)
    steps, numbers = of_run(contents, k)
    contents["manifest"]["runs"].append(contents["manifest"]["runs"][k])
    for name, place in (("costs", steps), ("evaluations", steps), ("points", numbers)):
        contents[name] = np.concatenate([contents[name], contents[name][place]])


def method_twice(contents: Contents, rng: np.random.Generator) -> None:
    contents["manifest"]["methods"].append(contents["manifest"]["methods"][0])


def rounded_points(contents: Contents, rng: np.random.Generator) -> None:
    contents["points"] = contents["points"].astype(np.float32)


def swapped_seeds(contents: Contents, rng: np.random.Generator) -> None:
    entries = contents["manifest"]["runs"]
    k = any_run(contents, rng, 1)
    same = ("method", "function", "instance")
    (other,) = [n for n, one in enumerate(entries) if n != k and all(one[name] == entries[k][name] for name in same)]
    entries[k]["seed"], entries[other]["seed"] = entries[other]["seed"], entries[k]["seed"]


def sooner(contents: Contents, rng: np.random.Generator) -> None:
    """Claim that an improvement came one evaluation before it did."""
    steps = np.diff(contents["evaluations"], prepend=0)
    contents["evaluations"][rng.choice(np.flatnonzero(steps > 1))] -= 1


def less_used(contents: Contents, rng: np.random.Generator) -> None:
    """Claim that a run ended before its budget was used."""
    entries = contents["manifest"]["runs"]
    ends = [int(contents["evaluations"][of_run(contents, k)[0].stop - 1]) for k in range(len(entries))]
    k = rng.choice([k for k, end in enumerate(ends) if end < entries[k]["evaluations"]])
    entries[k]["evaluations"] = ends[k]


def exchanged_methods(contents: Contents, rng: np.random.Generator) -> None:
    first, second = contents["manifest"]["methods"]
    for name in ("method", "settings"):
        first[name], second[name] = second[name], first[name]


Tamper = Callable[[Contents, np.random.Generator], None]


def entry(name: str, change: Callable[[dict[str, Any]], int]) -> Tamper:
    """Return a change of a field of some run in the manifest."""

    def tamper(contents: Contents, rng: np.random.Generator) -> None:
        chosen = contents["manifest"]["runs"][any_run(contents, rng)]
        chosen[name] = change(chosen)

    return tamper


def array(name: str, change: Callable[[Any], Any]) -> Tamper:
    """Return a change of some run's part of an array."""

    def tamper(contents: Contents, rng: np.random.Generator) -> None:
        part = contents[name][of_run(contents, any_run(contents, rng))[name == "points"]]
        part[:] = change(part)

    return tamper


TRACE = "the trace of the search from its seed must be the claimed one"
COST = r"cost after \d+ evaluations must be that of its point"
# how a bundle is tampered with, and why it is refused where its digest fits
TAMPERED: list[tuple[Tamper, str]] = [
    (array("costs", lambda costs: [*costs[:-1], costs[-1] - 1e-9]), COST),
    (array("costs", lambda costs: [costs[0] + 1e-9, *costs[1:]]), COST),
    (array("points", lambda points: 0.9 * points), COST),
    (array("points", lambda points: np.roll(points, 9)), COST),  # each point in the next one's place
    (array("points", lambda points: [1.0 + 1e-9, *points[1:]]), "points must lie in the box"),
    (array("points", np.ones_like), "points must be feasible"),
    (array("evaluations", lambda used: [used[0], used[0], *used[2:]]), "evaluations must rise"),
    (array("evaluations", lambda used: [0, *used[1:]]), "evaluations must rise from 1"),
    (no_number, "must hold finite numbers"),
    (entry("budget", lambda run: run["budget"] // 2), "evaluations must be at most 40, the budget, got 80"),
    (entry("evaluations", lambda run: run["budget"] + 1), "evaluations must be at most 80, the budget, got 81"),
    (fewer_in_all, "evaluations must be .* or more in all"),
    (rising_costs, "costs must fall"),
    (entry("instance", lambda run: run["instance"] + 100), f"{COST}|points must be feasible"),
    (entry("instance", lambda run: run["instance"] - FIRST), "instance must be held out"),
    (entry("instance", lambda _: HELD_OUT[-1] + 1), "instance must be at most"),
    (entry("function", lambda _: 3), f"{COST}|points must be feasible"),
    (entry("function", lambda _: 999), "function must be one of"),
    (no_dimension, "dimension of function . must be one of"),
    (entry("dimension", lambda _: 16), r"points.npy must hold \d+ numbers"),
    (no_suite, "suite must be one of"),
    (twice, "each run must come once, got it twice"),
    (method_twice, "methods must be listed once each"),
    (entry("improvements", lambda run: run["improvements"] - 1), r"costs.npy must hold \d+ numbers"),
    (rounded_points, "points.npy must have shape .n,. and type <f8"),
    (swapped_seeds, TRACE),
    (entry("seed", lambda run: run["seed"] + 100), TRACE),
    (sooner, TRACE),
    (less_used, TRACE),
    (exchanged_methods, TRACE),
]


@each(("tamper", "reason"), TAMPERED)
def test_a_tampered_bundle_is_refused_with_the_reason(
    honest: Path, tmp_path: Path, tamper: Tamper, reason: str
) -> None:
    for k in range(REPEATS):
        contents = contents_of(honest)
        tamper(contents, np.random.default_rng(k))
        fits = k % 2 == 0
        path = packed(contents, tmp_path / f"{k}.zip", fits)
        repeats = reason == TRACE and fits
        if repeats:
            assert len(verified(path).runs) == RUNS  # for points prove no seed
        early = tamper in (no_number, rounded_points)  # before a digest is compared
        came = reason if fits or early else "digest must be that of the contents"
        with pytest.raises(InputError, match=f"^{re.escape(str(path))}: .*({came})"):
            verified(path, RUNS if repeats else 0)


@each("fits", [True, False])
@each(
    ("renamed", "reason"),
    [
        ({"costs.npy": "cost.npy"}, "a bundle must hold manifest.json.*got one called 'cost.npy'"),
        ({"points.npy": ""}, "a bundle must hold manifest.json.*got no points.npy"),
        ({"manifest.json": "MANIFEST.json"}, "a bundle must hold manifest.json.*got one called 'MANIFEST.json'"),
        ({"costs.npy": "evaluations.npy", "evaluations.npy": "costs.npy"}, "must have shape .n,. and type"),
        ({"costs.npy": "points.npy", "points.npy": "costs.npy"}, "digest must be that|must hold"),
        ({"costs.npy": "points.npy"}, "two files of one name"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_bundle_of_renamed_or_missing_files_is_refused(
    honest: Path, tmp_path: Path, renamed: dict[str, str], reason: str, fits: bool
) -> None:
    path = packed(contents_of(honest), tmp_path / "renamed.zip", fits, renamed)
    with pytest.raises(InputError, match=reason):
        verified(path)


@each("text", [b"", b"PK", b"no archive at all", b'{"runs": []}'])
def test_what_is_no_bundle_is_refused(tmp_path: Path, text: bytes) -> None:
    (tmp_path / "a.zip").write_bytes(text)
    with pytest.raises(InputError, match="a.zip: expected a bundle of runs"):
        verified(tmp_path / "a.zip")


@each(
    ("where", "value", "reason"),
    [
        ("runs", {"evaluations": 10**400}, "evaluations must be a whole number"),
        ("runs", {"budget": 2**60}, "budget must be at most"),
        ("runs", {"seed": -1}, "seed must be 0 or more"),
        ("runs", {"seed": 0.5}, "seed must be a whole number"),
        ("runs", {"method": 2}, "method of a run must be 0 to 1"),
        ("runs", {"more": 1}, "must have the fields"),
        ("methods", {"method": 7}, "a method and its version must be texts"),
        ("methods", {"settings": [1]}, "settings must be values by their names"),
        ("methods", {"infeasible": "hide"}, "infeasible must be one of"),
        ("methods", {"version": "\ud800"}, "must hold finite numbers and texts"),
    ],
)
def test_a_manifest_of_strange_values_is_refused(
    honest: Path, tmp_path: Path, where: str, value: dict[str, Any], reason: str
) -> None:
    contents = contents_of(honest)
    contents["manifest"][where][0] |= value
    strange = value.get("version")
    if strange:  # no digest is of it
        contents["manifest"]["digest"] = ""
    with pytest.raises(InputError, match=reason):
        verified(packed(contents, tmp_path / "strange.zip", reseal=not strange))


def test_an_honest_bundle_is_verified_and_its_searches_are_repeated(honest: Path, runs: list[SuiteRun]) -> None:
    bundle = verified(honest, RUNS)
    assert (bundle.repeated, bundle.unrepeatable) == (RUNS, ())
    assert bundle.evaluated == sum(len(one.points) for one in runs if one.points is not None)
    before = {(one.method, one.function, one.instance, one.seed): one for one in runs}
    for one in bundle.runs:
        mine = before[one.method, one.function, one.instance, one.seed]
        assert np.array_equal(one.evaluations, mine.evaluations)
        assert np.array_equal(one.costs, mine.costs)
        assert np.array_equal(one.points, mine.points)
        assert np.array_equal(one.targets, mine.targets)
        assert (one.budget, one.version, one.settings) == (mine.budget, mine.version, mine.settings)
    assert verified(honest, 3).repeated == 3


def test_the_same_runs_make_the_same_bundle_in_any_order(honest: Path, runs: list[SuiteRun], tmp_path: Path) -> None:
    write_bundle(runs[::-1], tmp_path / "again.zip")
    assert (tmp_path / "again.zip").read_bytes() == honest.read_bytes()


@each("way", ["repair", "reject", "penalise"])
def test_any_loop_may_submit_and_every_improvement_is_evaluated_again(tmp_path: Path, way: Any) -> None:
    problem = posefit.suite(SUITE, 1, FIRST, budget=200, infeasible=way)
    rng = np.random.default_rng(5)
    asked = rng.uniform(-1.2, 1.2, (100, 9)) * rng.uniform(0.2, 1.0, (100, 1))
    costs = problem(asked)
    falls = [k for k in range(100) if costs[k] < min([np.inf, *costs[:k]])]
    run = run_of(problem, "my own", {"width": 1.2}, seed=7, source="my_own 3fa29b1c")
    assert problem.points.shape == (len(falls), 9)
    assert np.array_equal(run.evaluations, [*(k + 1.0 for k in falls), 100.0][: len(run.evaluations)])
    assert np.array_equal(posefit.suite(SUITE, 1, FIRST, infeasible=way)(problem.points), costs[falls])
    expected = asked[falls] if way == "penalise" else problem.repaired(asked[falls])
    assert np.array_equal(problem.points, expected)
    assert np.array_equal(problem.best, problem.repaired(asked[falls[-1:]])[0])
    write_bundle([run], tmp_path / "mine.zip")
    bundle = verified(tmp_path / "mine.zip", 1)
    assert (bundle.evaluated, bundle.repeated) == (len(falls), 0)
    assert bundle.unrepeatable[0].startswith("my own: optimiser must be one of ")
    assert bundle.runs[0].version.endswith(", my_own 3fa29b1c")


def test_a_run_without_a_budget_or_beyond_it_is_no_run() -> None:
    problem = posefit.suite(SUITE, 1, FIRST)
    problem(np.zeros((3, 9)))
    for budget, reason in ((None, "budget must be known"), (2, "evaluations must be at most 2, the budget, got 3")):
        with pytest.raises(InputError, match=reason):
            run_of(problem, "my own", budget=budget)


def test_what_cannot_be_verified_is_not_written(runs: list[SuiteRun], tmp_path: Path) -> None:
    training = run_on(posefit.suite(SUITE, 1, 3), "random", evaluations=40)
    without = list(search_runs(Ledger(searched(tmp_path / "old", {"cma": 3}, [(1, 9, FIRST)]))))
    for wrong, reason in (
        ([], "runs must be of one suite, got none"),
        ([training], "expected instances that are held out"),
        ([runs[0], runs[0]], "expected each run once, got it twice"),
        (without, "expected the points of its improvements, got none"),
    ):
        with pytest.raises(InputError, match=reason):
            write_bundle(wrong, tmp_path / "new.zip")
        assert not (tmp_path / "new.zip").exists()


def test_a_sweep_is_submitted_verified_and_ranked(tmp_path: Path) -> None:
    plan = f'suite = "{SUITE}"\nmethods = ["random"]\nfunctions = [1, 2]\ninstances = 2\nbudgets = [5]'
    results, path = swept(tmp_path / "results", plan), tmp_path / "bundles" / "sweep.zip"
    path.parent.mkdir()
    done = run("suite", "submit", results, "--out", path)
    assert (done.exit_code, done.stdout) == (0, ""), done.stderr
    assert "4 runs; digest " in done.stderr
    (path.parent / "broken.zip").write_bytes(path.read_bytes()[:-30])
    done = run("suite", "verify", path, "--repeat", 2)
    assert done.exit_code == 0
    assert re.search(r"sweep.zip: verified, 4 runs, \d+ points evaluated, 2 repeats in [\d.]+ s; digest ", done.stdout)
    done = run("suite", "verify", path, path.parent / "broken.zip")
    assert done.exit_code == 1
    assert [line.partition(": ")[0] for line in done.stdout.splitlines()] == [str(path), "refused"]
    assert "got one that exists" in error_of("suite", "submit", results, "--out", path)


def test_the_board_ranks_who_has_a_run_on_every_problem_and_names_the_others(tmp_path: Path) -> None:
    (tmp_path / "bundles").mkdir()
    own = verified(own_bundle())
    problems = sorted({(one.function, one.instance, one.dimension): one.budget for one in own.runs}.items())
    made = []
    for (function, instance, dimension), budget in problems:
        problem = posefit.suite(own.suite, function, instance, dimension, budget=budget)
        problem(problem.made.truth)
        made.append(run_of(problem, "<b>truth</b>"))
    write_bundle(made, tmp_path / "bundles" / "truth.zip")
    write_bundle(made, tmp_path / "bundles" / "truth_again.zip")
    write_bundle(made[1:], tmp_path / "bundles" / "gap.zip")
    broken = contents_of(tmp_path / "bundles" / "truth.zip")
    broken["costs"][0] -= 1e-9
    packed(broken, tmp_path / "bundles" / "wrong.zip", reseal=True)
    out = tmp_path / "board.html"
    done = run("suite", "board", tmp_path / "bundles", "--out", out, "--json")
    assert done.exit_code == 0, done.stderr
    printed = json.loads(done.stdout)
    own_methods = {one.method for one in own.runs}
    assert {row["name"] for row in printed["leaderboard"]} == {"<b>truth</b>", *own_methods}
    assert printed["leaderboard"][0]["name"] == "<b>truth</b>"
    assert all(row["taking_part"] and row["runs"] == len(problems) for row in printed["leaderboard"])
    reasons = printed["header"]["unranked"]
    assert len(reasons) == 3
    assert "expected each bundle once, got truth again" in reasons[0]
    assert re.search(f"^wrong.zip: <b>truth</b> on f1 .*: {COST}", reasons[1])
    assert reasons[2].startswith("gap: <b>truth</b> must have run within ")
    assert 0 not in {row["function"] for row in printed["times"]}
    data = data_in(out.read_text("utf-8"))
    shares = {row["name"]: row["reached"] / 100.0 for row in data["leaderboard"]}
    names = [data["methods"][m]["name"] for m in data["taking_part"]]
    ends = {name: one["values"][-1] for name, one in zip(names, data["charts"][0]["series"], strict=True)}
    assert ends == pytest.approx(shares, rel=1e-3)
    assert "<b>" not in out.read_text("utf-8").partition('id="data">')[2].partition("</script>")[0]


def own_bundle() -> Path:
    return Path(posefit.__file__).parent / "suites" / "methods.zip"


def test_the_runs_of_posefits_own_methods_are_of_the_latest_suite_and_small() -> None:
    bundle = verified(own_bundle())
    assert bundle.suite == SUITE
    assert len(bundle.runs) == 6 * 15 * len(FUNCTIONS)
    assert own_bundle().stat().st_size < 300_000


def test_a_ledger_gives_back_the_points_of_its_rows_unless_they_are_damaged(tmp_path: Path) -> None:
    plan = f'suite = "{SUITE}"\nmethods = ["random"]\nfunctions = [1]\ninstances = 1\nbudgets = [5]'
    results = swept(tmp_path / "results", plan)
    (one,) = search_runs(Ledger(results))
    again = run_on(posefit.suite(SUITE, 1, FIRST), "random", evaluations=45)
    assert np.array_equal(one.points, again.points)
    (path,) = (results / "rows").glob("*.joints")
    data = bytearray(path.read_bytes())
    data[3] ^= 1
    path.write_bytes(data)
    (one,) = search_runs(Ledger(results))
    assert one.points is None
