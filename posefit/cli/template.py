"""A new plugin to start from: a small package that installs, works and has a test that passes."""

import re
from importlib.resources import files
from pathlib import Path
from string import Template

from posefit.files import new_folder
from posefit.registry import KINDS, Kind, registry


def new(name: str, kind: Kind, folder: str | Path | None = None) -> Path:
    """Return the new folder with a small installable plugin, `posefit-NAME` unless another is given.

    Raises ValueError where the name cannot be a plugin's, or the folder is there already.
    """
    if kind not in KINDS:
        raise ValueError(f"kind must be one of {', '.join(KINDS)}, got {kind!r}")
    if not re.fullmatch(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*", name):
        raise ValueError(f"name must be small letters, digits, - and _, and begin with a letter, got {name!r}")
    if name in (known := registry().offers[kind]):
        raise ValueError(f"name must be a new one, got {name!r}, which {known[name].distribution} registers already")
    module = name.replace("-", "_")
    words = {
        "name": name,
        "kind": kind,
        "module": module,
        "dashed": name.replace("_", "-"),
        "class_name": "".join(part.capitalize() for part in module.split("_")),
        "option": f"{kind} {name}",
    }
    target = Path(folder or f"posefit-{words['dashed']}")
    if target.exists():
        raise ValueError(f"{target}: expected a new folder, got one that exists")
    target.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(target) as building:
        for template, written in (
            ("pyproject.toml", "pyproject.toml"),
            ("README.md", "README.md"),
            (f"{kind}.py", f"posefit_{module}.py"),
            ("test.py", f"test_{module}.py"),
        ):
            text = (files("posefit") / "templates" / f"{template}.txt").read_text(encoding="utf-8")
            (building / written).write_text(Template(text).substitute(words), encoding="utf-8")
    return target
