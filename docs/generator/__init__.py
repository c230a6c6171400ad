"""The parts of the handbook that are made from the code.

They are settings, figures, equations, commands, environments, messages and modules.
`python docs/generator` writes them, and so does docs/conf.py before every build. Parts
of pages in the repository are between `<!-- from the code: NAME -->` and
`<!-- end -->`; tests/docs compares them with the code. Pages of modules and
environments go to docs/generated, which is not in the repository.
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
# the parts of each page, by their names
PARTS = {
    "background/equations.md": {"equations": equations.page},
    "howto/measuring.md": {"angles": angles.page},
    "reference/commands.md": {"commands": commands.page},
    "reference/figures.md": {"figures": figures.page},
    "reference/joints.md": {"joints": joints.page},
    "reference/messages.md": {"messages": messages.page},
    "reference/settings.md": {"settings": settings.tracker, "methods": settings.page},
}


def pages() -> dict[str, str]:
    """Return the text of every page in the repository with a part from the code."""
    texts = {}
    for name, parts in PARTS.items():
        text = (DOCS / name).read_text("utf-8")
        for part, make in parts.items():
            text = _with_part(text, part, make())
        texts[name] = text
    return texts


def write() -> None:
    """Write every generated page."""
    shutil.rmtree(DOCS / "generated", ignore_errors=True)
    for name, text in {
        **pages(),
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


def _with_part(page: str, name: str, part: str) -> str:
    pattern = f"(<!-- from the code: {name} -->\n).*?(<!-- end -->)"
    return re.sub(
        pattern,
        lambda match: f"{match[1]}\n{part}\n{match[2]}",
        page,
        flags=re.DOTALL,
    )
