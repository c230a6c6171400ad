"""A plan is checked as a whole, before anything runs; a mistake in it is one line."""

import io
import re
import sys
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import posefit
from posefit import Frame
from posefit.evaluation.errors import anytime_trace
from posefit.motion import built_in
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.registry import Offer, Plugin, Registry
from posefit.suites.functions import SUITE
from posefit.sweep import check
from posefit.sweep import plan as plan_module
from posefit.sweep.cell import TrackCell, cell_scene, digest_of, run_cell
from posefit.sweep.check import cell_of
from posefit.sweep.plan import Plan
from posefit.tracking import method
from posefit.version import posefit_build, source_digest
from tests.cases import each
from tests.effort import effort
from tests.testing.planted import Holds

SMALL = {
    "method": "random@pca",
    "motion": "walk",
    "frames": 2,
    "size": [80, 60],
    "evaluations": 80,
}
PRODUCT: dict[str, Any] = {"methods": ["sapso@pca"], "motions": ["walk"]}
COLD = {"method": "sapso@pca", "name": "cold", "settings": {"sapso.cooling": 0.8}}


def planned(**tables: Any) -> Plan:
    return Plan.of({"product": PRODUCT, **tables})


def test_methods_change_soonest_so_that_a_sweep_under_way_compares_them() -> None:
    plan = planned(
        product={
            "methods": ["random@pca", "pso@pca"],
            "motions": ["walk", "run"],
            "seeds": 2,
        }
    )
    assert [(cell.method, cell.motion, cell.seed) for cell in plan] == [
        (method, motion, seed)
        for motion in ("walk", "run")
        for seed in (0, 1)
        for method in ("random@pca", "pso@pca")
    ]


def test_the_shared_settings_go_to_the_methods_that_use_them() -> None:
    shared = {"sapso": {"cooling": 0.9}, "tracker.floor": 0.1}
    own = {"method": "sapso@pca", "settings": {"sapso": {"cooling": 0.8}}}
    plan = planned(
        defaults={"settings": shared},
        product={**PRODUCT, "methods": ["sapso@pca", "cma@pca", own]},
    )
    assert [dict(cell.settings) for cell in plan] == [
        {"sapso.cooling": 0.9, "tracker.floor": 0.1},
        {"tracker.floor": 0.1},
        {"sapso.cooling": 0.8, "tracker.floor": 0.1},
    ]


def test_each_optimiser_is_paired_with_each_prior() -> None:
    few = {"prior": "pca", "settings": {"components": 4}}
    cold = {"optimiser": "sapso", "settings": {"sapso.cooling": 0.8}}
    product = {
        "optimisers": ["cma", cold],
        "priors": ["full", few],
        "motions": ["walk"],
    }
    made = [(cell.method, dict(cell.settings)) for cell in planned(product=product)]
    assert made == [
        ("cma@full", {}),
        ("cma@pca", {"pca.components": 4}),
        ("sapso@full", {"sapso.cooling": 0.8}),
        ("sapso@pca", {"pca.components": 4, "sapso.cooling": 0.8}),
    ]
    grid = {"pca.components": [4, 5]}
    product = {"optimisers": ["cma"], "priors": ["pca"], "motions": ["walk"]}
    assert len(planned(product=product, grid=grid)) == 2


def test_a_grid_crosses_the_settings_of_the_methods_that_have_them_and_a_variant_has_a_name() -> (
    None
):
    product = {**PRODUCT, "methods": [COLD, "cma@pca", "random@full"]}
    plan = planned(
        grid={"sapso.inertia": [0.7, 0.9], "pca.components": [4, 5]}, product=product
    )
    sets = [(i, c) for i in (0.7, 0.9) for c in (4, 5)]
    assert [(cell.name, cell.method, dict(cell.settings)) for cell in plan] == [
        *(
            (
                "cold",
                "sapso@pca",
                {"pca.components": c, "sapso.cooling": 0.8, "sapso.inertia": i},
            )
            for i, c in sets
        ),
        *(("", "cma@pca", {"pca.components": c}) for c in (4, 5)),
        ("", "random@full", {}),
    ]
    suite = {
        "suite": SUITE,
        "methods": ["cma", "sapso"],
        "functions": [1],
        "instances": 1,
    }
    searches = [
        (cell.method, cell.settings)
        for cell in Plan.of({**suite, "grid": {"sapso.inertia": [0.7, 0.9]}})
    ]
    assert searches == [
        ("cma", {}),
        ("sapso", {"inertia": 0.7}),
        ("sapso", {"inertia": 0.9}),
    ]


@each(
    ("tables", "message"),
    [
        ({"product": None}, "a plan must contain at least one cell, got none"),
        ({"product": {**PRODUCT, "seeds": []}}, "product.seeds must contain at least one, got none: an empty product"),
        ({"product": {**PRODUCT, "seeds": "3"}}, "product.seeds must be a list, got '3'"),
        ({"product": {**PRODUCT, "colours": [1]}}, "a key of product must be one of methods, motions, .*, got 'colours'"),
        ({"product": {"motions": ["walk"]}}, "a cell must have a method, got none"),
        ({"product": {**PRODUCT, "motions": [{"motion": "walk", "seed": 1}], "seeds": [1]}}, "seed in one list, got it in"),
        ({"product": {**PRODUCT, "seeds": 10**12}}, "product.seeds must be at most 1,000,000, got 1,000,000,000,000"),
        ({"product": {**PRODUCT, "seeds": 2000, "instances": 2000}}, "product must have at most 1,000,000 cells, got 4,"),
        ({"sweep": {}}, "a key of a plan must be one of defaults, product, grid, cells, got 'sweep'"),
        ({"defaults": {"sed": 1}}, "a key of defaults must be one of method, .*, got 'sed'"),
        ({"defaults": [1]}, "defaults must be a table, got"),
        ({"cells": 3}, "cells must be a list of tables, got 3"),
        ({"cells": [{"method": "sapso@pca", "motion": "walk"}]}, "must differ, got sapso@pca on walk, .* seed 0 twice"),
        ({"product": {**PRODUCT, "priors": ["pca"]}}, "product must contain methods, or both optimisers and priors, got methods, motions, priors"),
        ({"product": {"optimisers": ["cma"]}}, "both optimisers and priors, got optimisers"),
        ({"product": {"optimisers": ["cma"], "priors": [{"name": "pca"}]}}, "a key of an entry of priors must be one of prior, settings, got 'name'"),
        ({"product": {"optimisers": ["cma"], "priors": [3]}}, "an entry of priors must be a name"),
        ({"product": {**PRODUCT, "methods": ["sapzo@pca"]}}, "did you mean 'sapso'"),
        ({"product": {**PRODUCT, "methods": ["vsnm"]}}, "method must be OPTIMISER@PRIOR, .*, got 'vsnm'; did you mean 'vsmm'"),
        ({"product": {**PRODUCT, "views": [[]]}}, "view_degrees must be 1 to 100 angles, got 0"),
        ({"product": {**PRODUCT, "corruptions": [{"hole": 1}]}}, "got 'hole'; did you mean 'holes'"),
        ({"product": {**PRODUCT, "corruptions": [{"holes": 2}]}}, "corruption holes must lie in 0 to 1, got 2"),
        ({"product": {**PRODUCT, "corruptions": [0.5]}}, "corruption must be a table of strengths .*, got 0.5"),
        ({"product": {**PRODUCT, "instances": [-1]}}, "instance must be 0 or more, got -1"),
        ({"defaults": {"frames": True}}, "frames must be a whole number of at least 1, got True"),
        ({"defaults": {"evaluations": 30}}, "evaluations must be at least 40, one population, got 30"),
        ({"defaults": {"train": "walk-a"}}, "train must be a list of motions, got 'walk-a'"),
        ({"defaults": {"train": ["a" * 300]}}, "train must be an .amc file"),
        ({"defaults": {"train": ["walk"]}}, "train must not contain the motion itself, got walk"),
        ({"defaults": {"settings": {"sapso.coling": 1}}}, "got 'coling'; did you mean 'cooling'"),
        ({"defaults": {"settings": {"sapso.cooling": "cold"}}}, "sapso.cooling must be float, got 'cold'"),
        ({"defaults": {"settings": {"cma.sigma": 1}}}, "settings must be settings of the plan's methods, got 'cma.sigma', which none"),
        ({"product": {**PRODUCT, "methods": [{"method": "sapso@pca", "settings": {"cma.sigma": 1}}]}}, "got 'cma.sigma'"),
        ({"grid": {"inertia": [0.7]}}, r'grid must contain settings .* such as "sapso.inertia" = \[0.7, 0.9\], got inertia ='),
        ({"grid": [1]}, r"grid must contain settings .*, got \[1\]"),
        ({"grid": {"cma.sigma": [1]}}, "grid must contain settings of pca, sapso, tracker, the plan's methods, got 'cma.sigma'"),
        ({"grid": {"pca.components": [1]}, "product": None, "cells": [SMALL]}, "grid must come with the methods"),
        (
            {"grid": {"sapso.cooling": [1]}, "product": {**PRODUCT, "methods": [COLD]}},
            "grid must contain settings that no entry of methods sets itself, got sapso.cooling, which one sets",
        ),
        ({"product": {**PRODUCT, "methods": [{**COLD, "name": 3}]}}, "name must be a text of at most 80 characters, got 3"),
    ],
)  # fmt: skip
def test_mistakes_are_named(tables: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        planned(**tables)


@each(
    ("tables", "message"),
    [
        ({"functions": [{"instance": 1}], "instances": [2]}, "a product must set instance in one list, got it in two"),
        ({"functions": [{}], "dimensions": [9]}, "a cell must have a function, got none"),
        ({"dimensions": [{}]}, "a cell must have a dimension, got none"),
        ({"functions": [1, 7], "dimensions": [9]}, "functions must exist in one of the plan's dimensions, got 7, which"),
        ({"functions": ["1"]}, "function must be a whole number of at least 1, got '1'"),
        ({"methods": [{"name": "a"}]}, "method must be a name, got None"),
        ({"methods": [{"method": "pso", "settings": {"cma.population_size": 20}}]}, r"settings of pso must be named pso.SETTING, got 'cma.population_size'"),
        ({"methods": [{"method": "pso", "settings": {"pso.population_size": 20, "population_size": 9}}]}, "settings must name pso.population_size once, got it twice"),
    ],
)  # fmt: skip
def test_mistakes_in_plans_of_searches_are_named(
    tables: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        Plan.of({"suite": SUITE, "methods": ["pso"], "instances": 1, **tables})


def test_a_file_that_is_no_plan_is_named(tmp_path: Path) -> None:
    path = tmp_path / "plan.toml"
    for place, content, message in (
        (
            Path("nowhere.toml"),
            None,
            r"nowhere.toml: expected a plan \(.toml\) or default, got no file of that name",
        ),
        (tmp_path, None, "expected a plan .* got a folder"),
        (path, b"[product\n", r"plan.toml: .*line 1"),
        (path, b"\xff", "expected a plan in TOML"),
    ):
        if content is not None:
            place.write_bytes(content)
        with pytest.raises(ValueError, match=message):
            Plan.read(place)


def test_a_cells_version_has_digests_of_posefit_and_of_its_methods_plugins_and_no_others() -> (
    None
):
    sapso, cma = (
        cell_of({"method": name, "motion": "walk"}).version.split(", ")
        for name in ("sapso@pca", "cma@full")
    )
    assert sapso[0] == cma[0] == posefit_build()
    assert [part.partition(" ")[0] for part in sapso[1:]] == [
        "posefit_priors",
        "posefit_swarm",
    ]
    # cma is a part of posefit
    assert [part.partition(" ")[0] for part in cma[1:]] == ["posefit_priors"]
    assert all(
        re.fullmatch(r"\w+ [0-9a-f]{8}", part) for part in (*sapso[1:], *cma[1:])
    )


def test_a_digest_changes_with_every_file_that_results_depend_on(
    tmp_path: Path, monkeypatch: Any
) -> None:
    package = tmp_path / "package"
    elsewhere = tmp_path / "elsewhere"
    for folder in ("report", "data", ".git", "__pycache__"):
        (package / folder).mkdir(parents=True)
    elsewhere.mkdir()
    # a link to a folder of weights, and one that leads back
    (package / "linked").symlink_to(elsewhere)
    (package / "data" / "loop").symlink_to(package)
    # without __init__.py, as a namespace; __path__ is what Python sets
    monkeypatch.setitem(
        sys.modules, "package", SimpleNamespace(__path__=[str(package)], __file__=None)
    )

    def digest() -> str:
        return str(source_digest.__wrapped__("package", ("report",)))

    assert digest() == ""
    data = [f"data/weights{suffix}" for suffix in (".npy", ".npz", ".pt", ".onnx", ".so", ".csv", ".pkl", ".txt", "")]  # fmt: skip
    for name in ("__init__.py", "search.py", *data, "linked/weights.bin"):
        for content in ("1", "2"):
            before = digest()
            (package / name).write_text(content)
            assert digest() != before, (name, content)
    before = digest()
    (package / "data" / "weights.npy").rename(package / "data" / "others.npy")
    assert digest() != before
    before = digest()
    for name in ("report/page.py", ".git/index", ".hidden", "__pycache__/a.pyc"):
        (package / name).write_text("1")
        assert digest() == before, name


def test_a_plugin_of_one_file_has_the_digest_of_it(
    tmp_path: Path, monkeypatch: Any
) -> None:
    module = tmp_path / "alone.py"
    monkeypatch.setitem(sys.modules, "alone", SimpleNamespace(__file__=str(module)))
    digests = set()
    for content in ("1", "2"):
        module.write_text(content)
        (tmp_path / "strange.py").write_text(content)
        digests.add(source_digest.__wrapped__("alone"))
    assert len(digests) == 2


def test_instances_differ_and_a_number_is_the_same_for_every_method_and_seed() -> None:
    def observed(**spec: Any) -> tuple[bytes, bytes]:
        scene = cell_scene(cell_of({**SMALL, "frames": 4, **spec}))
        return scene.truth.poses.tobytes(), scene.observations[2].silhouettes[
            0
        ].mask.tobytes()

    assert observed(instance=0)[0] == built_in.motion("walk", frames=4).poses.tobytes()
    assert observed(instance=1) == observed(instance=1, method="cma@full", seed=5)
    assert observed(instance=1)[0] != observed(instance=2)[0] != observed(instance=0)[0]
    damaged = {"holes": 0.5}
    assert observed(corruption=damaged, seed=1) == observed(corruption=damaged, seed=2)
    assert observed(corruption=damaged)[1] != observed()[1]


def test_a_share_of_the_frames_is_dropped() -> None:
    cell = cell_of({**SMALL, "frames": 60, "corruption": {"dropped": 0.5}})
    usable = [observation.usable for observation in cell_scene(cell).observations]
    assert usable[0]
    assert 15 <= usable.count(False) <= 45  # of 60


def test_a_file_that_changed_after_it_was_planned_is_not_followed(
    tmp_path: Path,
) -> None:
    motion = built_in.motion("walk-b", frames=12)
    asf = tmp_path / "one.asf"
    amc = tmp_path / "one.amc"
    write_asf(asf, motion.skeleton)
    write_amc(amc, motion)
    spec = {**SMALL, "motion": str(amc), "frames": 1, "fps": 120}
    cell = cell_of(spec)
    assert cell.files == {str(path): digest_of(path) for path in (amc, asf)}
    assert run_cell(cell)["status"] == "done"
    with pytest.raises(ValueError, match=r"frames must be at most \d+, the length of"):
        cell_of({**spec, "frames": 500})
    amc.write_text(amc.read_text() + "\n")
    with pytest.raises(ValueError, match="one.amc must be the file that was planned, "):
        run_cell(cell)


def test_a_trace_is_the_mean_best_cost_of_the_frames_after_each_number_of_evaluations() -> (
    None
):
    def frame(costs: list[float], step: int) -> Frame:
        trace = np.column_stack([step * np.arange(1, len(costs) + 1), costs])
        return Frame(
            np.zeros(66), np.zeros(3), 1.0, np.zeros((1, 3)), step * len(costs), trace
        )

    # by hand: after 20 evaluations the frames have 6 and 9, after 30: 4 and 9, after 40: 4 and 1
    frames = [frame([8.0, 6.0, 4.0], 10), frame([9.0, 1.0], 20), frame([], 1)]
    assert anytime_trace(frames) == {
        "evaluations": [20, 30, 40],
        "cost": [7.5, 6.5, 2.5],
    }
    assert anytime_trace([frame([], 1)]) == {"evaluations": [], "cost": []}
    long = anytime_trace([frame(list(range(500, 0, -1)), 1)])
    assert len(long["cost"]) <= 64
    assert (long["evaluations"][-1], long["cost"][-1]) == (500, 1.0)


def test_a_worker_of_another_version_does_not_run_a_cell() -> None:
    installed = f"posefit {posefit.__version__} "
    for version, message in (
        ("posefit 0.0.9 a1", f"a worker must have posefit 0.0.9 a1, got {installed}"),
        (
            f"{posefit_build()}, posefit_swarm 00000000",
            "must have posefit_swarm 00000000, got posefit_swarm ",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            run_cell(TrackCell("random@pca", "walk", ("walk-a",), version=version))


def test_a_tracker_is_a_method_by_its_name_and_its_package_is_part_of_the_version(
    monkeypatch: Any,
) -> None:
    offer = Offer("tracker", "hold+still", Holds, "posefit-hold", "2.5")
    installed = Registry(
        (Plugin("hold", "posefit-hold", "2.5", "loaded", offers=(offer,)),)
    )
    for module in (check, method):
        monkeypatch.setattr(module, "registry", lambda: installed)
    cell = cell_of(
        {"method": "hold+still", "motion": "walk", "frames": 2, "size": [80, 60]}
    )
    assert (
        cell.version
        == f"{posefit_build()}, posefit-hold 2.5 {source_digest(Holds.__module__)}"
    )
    row = run_cell(cell)
    # it does not search
    assert (row["prior_floor_degrees"], row["trace"]) == (
        None,
        {"evaluations": [], "cost": []},
    )


PLAIN = '[[cells]]\nmethod = "random@pca"\nmotion = "walk"\n'


def test_a_plan_may_have_a_byte_order_mark_and_numbers_of_any_size_are_checked(
    tmp_path: Path,
) -> None:
    path = tmp_path / "plan.toml"
    path.write_bytes(b"\xef\xbb\xbf" + PLAIN.encode())
    assert len(Plan.read(path)) == 1
    for line, message in (
        (f"view_degrees = {10**400}", "view_degrees must be a finite number, got 1000"),
        (
            "view_degrees = 999999999999999999999",
            "view_degrees must lie in -360 to 360 degrees, got 9999",
        ),
        ("frames = 100001", "frames must lie in 1 to 100000, got 100001"),
        (
            f"seed = 0x{'f' * 9000}",
            "seed must be a whole number of at least 0, got one int that is too long",
        ),
        ("fps = 1e-320", "fps must lie in 0.001 to 1e[+]06, got 1e-320"),
        (f'"{"n" * 300}" = 1', "got 'n{76}[.]{3}$"),
        ("train = " + "[" * 9000, "less deeply nested"),
    ):
        path.write_text(PLAIN + line)
        with pytest.raises(ValueError, match=message):
            Plan.read(path)


def test_a_plan_on_standard_input_is_read_whole_or_refused(monkeypatch: Any) -> None:
    monkeypatch.setattr("sys.stdin", io.StringIO(PLAIN + "#" * 1_000_000))
    with pytest.raises(
        ValueError, match="-: expected a plan of at most 1,000,000 characters, got more"
    ):
        Plan.read("-")
    monkeypatch.setattr("sys.stdin", io.StringIO(PLAIN))
    assert len(Plan.read("-")) == 1


def tracks(seeds: int) -> Plan:
    return Plan.of(
        {"product": {"methods": ["random@pca"], "motions": ["walk"], "seeds": seeds}}
    )


def searches(seeds: int) -> Plan:
    return Plan.of(
        {
            "suite": SUITE,
            "methods": ["random"],
            "functions": [1],
            "instances": 1,
            "seeds": seeds,
        }
    )


@each("of", [tracks, searches])
def test_a_large_plan_is_held_in_a_few_bytes_a_cell_and_no_signature_is_read_a_cell(
    of: Callable[[int], Plan],
) -> None:
    of(10)
    calls = [effort(lambda seeds=seeds: of(seeds)).calls for seeds in (200, 400)]  # type: ignore[misc]
    assert (calls[1] - calls[0]) / 200 < 1000  # of Python and of C, a cell
    # only what the plan allocates: other threads of the process may allocate, too
    in_plan = tracemalloc.Filter(True, plan_module.__file__, all_frames=True)
    tracemalloc.start(20)
    try:
        plan = of(1000)
        snapshot = tracemalloc.take_snapshot().filter_traces([in_plan])
    finally:
        tracemalloc.stop()
    held = sum(trace.size for trace in snapshot.traces)
    assert len(plan) == 1000
    assert 0 < held / len(plan) < 300
