"""Imports a module's names when they are first used; a stub declares them.

SPEC 1 of Scientific Python describes the pattern.
"""

import re
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

_IMPORT = re.compile(r"^from (posefit\.\S+) import (\w+)", re.MULTILINE)


def names_of_stub(
    module: str, file: str
) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """Return `__getattr__`, `__dir__` and the names of a module.

    Args:
        module: The module's name.
        file: Its file. A stub in the same folder declares the names.
    """
    stub = Path(file).with_suffix(".pyi").read_text(encoding="utf-8")
    homes = {name: home for home, name in _IMPORT.findall(stub)}

    def value_of(name: str) -> Any:
        if name not in homes:
            from posefit.reading import suggestion

            raise AttributeError(
                f"module {module!r} has no attribute {name!r}{suggestion(name, homes)}"
            )
        value = getattr(import_module(homes[name]), name)
        setattr(sys.modules[module], name, value)
        return value

    return value_of, lambda: sorted({*vars(sys.modules[module]), *homes}), list(homes)
