"""Write the pages of the handbook that are made from the code: settings, figures, equations, commands, modules.

`write` is called by docs/conf.py before every build; what it writes stands in docs/generated, which git ignores.
"""

import shutil
from pathlib import Path

import architecture

from generator import angles, commands, environments, equations, figures, joints, python, settings

DOCS = Path(__file__).parents[1]
GENERATED = DOCS / "generated"


def write() -> None:
    """Write every generated page. Raises ValueError where the packages import each other in a circle."""
    shutil.rmtree(GENERATED, ignore_errors=True)
    pages = {
        "settings.md": settings.page(),
        "figures.md": figures.page(),
        "equations.md": equations.page(),
        "commands.md": commands.page(),
        "environments.md": environments.page(),
        "joints.md": joints.page(),
        "angles.md": angles.page(),
        **{f"python/{name}.rst": text for name, text in python.pages().items()},
        "architecture.svg": architecture.drawing(),
    }
    for name, text in pages.items():
        path = GENERATED / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
