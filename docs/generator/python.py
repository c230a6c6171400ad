"""The reference of the Python packages: a page for each, from its docstrings."""

import ast
import importlib
import importlib.util
import pkgutil
from pathlib import Path

ROOT = Path(__file__).parents[2]


def pages() -> dict[str, str]:
    """Return a page for each package by name, and one for the top-level modules."""
    packages = {name: _modules(name) for name in _packages()}
    alone = [
        f"posefit.{one.name}"
        for one in pkgutil.iter_modules([str(ROOT / "posefit")])
        if _alone(one)
    ]
    pages = {name: _page(name, modules) for name, modules in packages.items()}
    pages["posefit"] = _page("posefit", alone)
    return pages


def _alone(module: pkgutil.ModuleInfo) -> bool:
    return not module.ispkg and not module.name.startswith("_")


def _packages() -> list[str]:
    """Return the packages of posefit, its plugins and its environments."""
    inner = [
        f"posefit.{one.name}"
        for one in pkgutil.iter_modules([str(ROOT / "posefit")])
        if one.ispkg
    ]
    outer = [
        path.name
        for folder in ("plugins", "envs")
        for path in sorted((ROOT / folder).glob("posefit_*"))
    ]
    return [*inner, *outer]


def _modules(package: str) -> list[str]:
    path = importlib.import_module(package).__path__
    modules = sorted(
        module.name for module in pkgutil.walk_packages(path, f"{package}.")
    )
    return [name for name in modules if ast.get_docstring(ast.parse(_source(name)))]


def _source(name: str) -> str:
    """Return a module's code. It is not imported, because its library may be absent."""
    spec = importlib.util.find_spec(name)
    assert spec is not None
    assert spec.origin is not None
    return Path(spec.origin).read_text("utf-8")


def _page(package: str, modules: list[str]) -> str:
    members = [] if modules else ["   :members:"]
    lines = [
        f"``{package}``",
        "=" * (len(package) + 4),
        "",
        f".. automodule:: {package}",
        *members,
        "",
    ]
    for module in modules:
        lines += [
            f"``{module}``",
            "-" * (len(module) + 4),
            "",
            f".. automodule:: {module}",
            "   :members:",
        ]
        # what a module imports is listed elsewhere
        lines += ["   :ignore-module-all:", ""]
    return "\n".join(lines)
