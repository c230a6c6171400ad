"""The parts of the handbook that are made from the code.

They are settings, figures, equations, commands, environments, messages and modules.
`python docs/generator` writes them, and so does docs/conf.py before every build. Parts
of pages in the repository are between `<!-- from the code: NAME -->` and
`<!-- end -->`; tests/docs compares them with the code. Whole pages go to
docs/generated, which is not in the repository.
"""

import re
import shutil
from pathlib import Path

from generator import (
    angles,
    commands,
    environments,
    equations,
    figures,
    joints,
    messages,
    python,
    settings,
)

DOCS = Path(__file__).parents[1]
PARTS = {
    "background/equations.md": equations.page,
    "howto/measuring.md": angles.page,
    "reference/joints.md": joints.page,
    "reference/settings.md": settings.tracker,
}
_PART = re.compile(r"(<!-- from the code: \w+ -->\n).*?(<!-- end -->)", re.DOTALL)


def pages() -> dict[str, str]:
    """Return the text of every page in the repository with a part from the code."""
    return {
        name: _with_part((DOCS / name).read_text("utf-8"), make())
        for name, make in PARTS.items()
    }


def write() -> None:
    """Write every generated page."""
    shutil.rmtree(DOCS / "generated", ignore_errors=True)
    for name, text in {
        **pages(),
        "generated/commands.md": commands.page(),
        "generated/figures.md": figures.page(),
        "generated/messages.md": messages.page(),
        "generated/settings.md": settings.page(),
        **{
            f"generated/python/{name}.rst": text
            for name, text in python.pages().items()
        },
        **{
            f"generated/environments/{name}.md": text
            for name, text in environments.pages().items()
        },
    }.items():
        path = DOCS / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _with_part(page: str, part: str) -> str:
    return _PART.sub(lambda match: f"{match[1]}\n{part}\n{match[2]}", page)
