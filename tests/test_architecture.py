"""What the packages promise as a whole: typed, complete when installed, no circles, no plugin named in posefit."""

import re
import tomllib
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

import posefit

ROOT = Path(__file__).parents[1]
FILES = [
    path
    for folder in ("posefit", "plugins", "envs")
    for path in sorted((ROOT / folder).rglob("*.py"))
]
OTHERS = ROOT / "plugins", ROOT / "envs"
PACKAGES = sorted(
    {ROOT / "posefit", *(path.parent for path in FILES if path.parent.parent in OTHERS)}
)
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))


def name_of(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def test_every_package_is_typed() -> None:
    assert [
        name_of(package) for package in PACKAGES if not (package / "py.typed").is_file()
    ] == []


def test_nothing_in_posefit_names_a_plugin() -> None:
    # templates, which are no .py files, may name what they make
    names = re.compile(
        rf"\b({'|'.join(package.name for package in PACKAGES if package.name != 'posefit')})\b"
    )
    own = [path for path in FILES if ROOT / "posefit" in path.parents]
    assert [
        name_of(path) for path in own if names.search(path.read_text("utf-8"))
    ] == []


def test_the_version_is_in_one_place() -> None:
    assert "version" in PROJECT["project"]["dynamic"]
    assert PROJECT["tool"]["hatch"]["version"] == {"path": "posefit/version.py"}
    literal = f'"{posefit.__version__}"'
    assert [name_of(path) for path in FILES if literal in path.read_text("utf-8")] == [
        "posefit/version.py"
    ]


def test_no_module_imports_itself_by_way_of_others() -> None:
    grimp = pytest.importorskip(
        "grimp", reason="import-linter, of posefit[dev], brings it along"
    )
    names = sorted(package.name for package in PACKAGES)
    graph = grimp.build_graph(
        *names, cache_dir=None, exclude_type_checking_imports=False
    )
    below = {
        module: sorted(graph.find_modules_directly_imported_by(module))
        for module in graph.modules
    }
    try:
        TopologicalSorter(below).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))
