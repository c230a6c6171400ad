"""A new plugin to start from: a small package that installs, works and has a test that passes."""

import re
from collections.abc import Sequence
from importlib.resources import files
from importlib.util import find_spec
from keyword import iskeyword
from pathlib import Path
from string import Template

from posefit.errors import InputError
from posefit.files import new_folder
from posefit.fitting.check import one_of
from posefit.hooks import PROJECT
from posefit.reading import quoted
from posefit.registry import CHECKED_KINDS, COMMAND, Registrable, plugins_of, registry

TAKEN = {"Frame"}  # names that a template's module has already


def write_plugin(
    name: str,
    kind: Registrable,
    folder: str | Path | None = None,
    commands: Sequence[str] = (),
) -> Path:
    """Return the new folder with a small installable plugin, `posefit-NAME` unless another is given.

    `commands` are the names of posefit's own, which a new one cannot have. Raises ValueError where the name cannot
    be a plugin's, or the folder is there already.
    """
    one_of("kind", kind, (*CHECKED_KINDS, COMMAND))
    if not re.fullmatch(r"[a-z][a-z0-9]*([-_][a-z0-9]+)*", name):
        raise InputError(
            f"name must be small letters, digits, - and _, and begin with a letter, got {quoted(name)}"
        )
    if name in (known := _taken(kind, commands)):
        raise InputError(
            f"name must be a new one, got {name!r}, which {known[name]} registers already"
        )
    module = name.replace("-", "_")
    if (there := find_spec(f"{PROJECT}_{module}")) is not None:
        raise InputError(
            f"name must make a new module, got {name!r}: its module {there.name} would hide the one of that name in "
            f"{there.origin or 'sys.path'}"
        )
    class_name = "".join(part.capitalize() for part in module.split("_"))
    if class_name in TAKEN or iskeyword(class_name):
        class_name += kind.capitalize()
    used = {
        COMMAND: name,
        "segmenter": f"extract VIDEO --out masks --extraction {name}",
        "start": f"fit MASK.png --height 1.75 --set tracker.start={name}",
    }.get(kind, f"track walk --method {'@' if kind == 'prior' else ''}{name}")
    words = {
        "name": name,
        "kind": kind,
        "module": module,
        "dashed": name.replace("_", "-"),
        "class_name": class_name,
        "usage": f"posefit check {kind} {name}\n" * (kind != COMMAND)
        + f"posefit {used}",
    }
    target = Path(folder or f"posefit-{words['dashed']}")
    target.parent.mkdir(parents=True, exist_ok=True)
    with new_folder(target) as building:
        for template, written in (
            ("pyproject.toml", "pyproject.toml"),
            ("README.md", "README.md"),
            (f"{kind}.py", f"posefit_{module}.py"),
            (f"{COMMAND if kind == COMMAND else 'kit'}_test.py", f"test_{module}.py"),
        ):
            text = (files("posefit") / "templates" / f"{template}.txt").read_text(
                encoding="utf-8"
            )
            (building / written).write_text(
                Template(text).substitute(words), encoding="utf-8"
            )
    return target


def _taken(kind: Registrable, commands: Sequence[str]) -> dict[str, str]:
    """Return the names that a new plugin cannot have, each with the distribution that has it."""
    if kind != COMMAND:
        return {
            offer.name: offer.distribution for offer in registry().offers[kind].values()
        }
    plugins = plugins_of((COMMAND,), tuple(commands))
    others = {
        str(command.name): plugin.distribution
        for plugin in plugins
        for command in plugin.commands
    }
    return dict.fromkeys(commands, PROJECT) | others
