"""The rules that the house is built by, as far as they can be counted."""

import ast
import re
import tomllib
from collections import Counter
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import posefit
from tests.mutants import MUTANTS, Mutant, changed

ROOT = Path(__file__).parents[1]
ROOMS = ("posefit", "plugins", "envs")
FILES = [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]
PACKAGES = [
    ROOT / "posefit",
    *(path.parent for path in FILES if path.parent.parent in (ROOT / "plugins", ROOT / "envs")),
]
LINES, MODULES = 300, 14  # of a file, of a folder: with more it probably hides two nouns, or two rooms
# What is not reached yet: a set only ever gets smaller, and the tests fail where it holds what is mended.
NAMES_A_PLUGIN: set[str] = set()
TOO_LONG: set[str] = set()
TOO_FULL: set[str] = set()


def shown(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_there_are_files_to_look_at() -> None:
    assert len(FILES) > 200
    assert len(set(PACKAGES)) > 10


def test_every_importable_package_says_that_it_is_typed() -> None:
    assert [shown(package) for package in sorted(set(PACKAGES)) if not (package / "py.typed").is_file()] == []


def test_everything_that_a_package_reads_is_in_what_is_installed() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    patterns = project["tool"]["setuptools"]["package-data"]["*"]
    data = [path for package in PACKAGES for path in package.rglob("*") if path.is_file()]
    data = [path for path in data if path.suffix != ".py" and "__pycache__" not in path.parts]
    assert len(data) > 20
    assert [shown(path) for path in data if not any(path.match(pattern) for pattern in patterns)] == []


def test_nothing_in_posefit_names_a_plugin() -> None:
    # but for hooks; templates, which are no .py files, may name what they make
    names = re.compile(r"\bposefit_(?!register_)[a-z]+")
    found = {
        shown(path) for path in FILES if shown(path).startswith("posefit/") and names.search(path.read_text("utf-8"))
    }
    assert found == NAMES_A_PLUGIN


def test_no_file_is_too_long() -> None:
    assert {shown(path) for path in FILES if len(path.read_text("utf-8").splitlines()) > LINES} == TOO_LONG


def test_no_folder_is_too_full() -> None:
    modules = Counter(shown(path.parent) for path in FILES)
    assert {folder for folder, count in modules.items() if count > MODULES} == TOO_FULL


def test_the_version_stands_in_one_place() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
    assert "version" not in project["project"]
    assert "version" in project["project"]["dynamic"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "posefit.version.__version__"}
    literal = f'"{posefit.__version__}"'
    assert [shown(path) for path in FILES if literal in path.read_text("utf-8")] == ["posefit/version.py"]


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.what)
def test_what_a_mutant_changes_is_still_there_and_so_is_its_test(mutant: Mutant) -> None:
    assert changed((ROOT / mutant.path).read_text("utf-8"), mutant)
    file, _, name = mutant.test.partition("::")
    assert f"\ndef {name.partition('[')[0]}(" in (ROOT / file).read_text("utf-8")


def test_no_module_imports_itself_by_way_of_others() -> None:
    grimp = pytest.importorskip("grimp", reason="import-linter, of posefit[dev], brings it along")
    graph = grimp.build_graph(
        *sorted({package.name for package in PACKAGES}), cache_dir=None, exclude_type_checking_imports=False
    )
    below = {module: sorted(graph.find_modules_directly_imported_by(module)) for module in graph.modules}
    TopologicalSorter(below).prepare()  # CycleError names a circle


# Commands are called like the functions they stand for; rules of the kit are called like what they check.
TWICE = {"track", "fit", "extract", "suite", "check", "main"}


def test_no_public_name_stands_for_two_things() -> None:
    homes: dict[str, list[str]] = {}
    for path in FILES:
        if path.parent.name == "testing":
            continue
        for node in ast.parse(path.read_text("utf-8")).body:
            if isinstance(node, ast.ClassDef | ast.FunctionDef) and not node.name.startswith(
                ("_", "posefit_register_")
            ):
                homes.setdefault(node.name, []).append(shown(path))
    assert {name: found for name, found in homes.items() if len(found) > 1 and name not in TWICE} == {}
    assert {name for name, found in homes.items() if len(found) > 1} == TWICE
