"""Put the results of `posefit reproduce` or a study into the pages that show them.

    python docs/studies/reproduced_pages.py sapso=OUT vsmm=OUT footage=OUT related=OUT

A page has `<!-- sapso: parts -->`, a table, and `<!-- end -->`. The table is replaced
by OUT/parts.md. A picture that a page shows as ../pictures/sapso-NAME is copied from
OUT/NAME to docs/pictures. Nothing else of a page changes.
"""

import re
import shutil
from pathlib import Path

import click

from posefit.cli.output import Command
from posefit.errors import InputError

DOCS = Path(__file__).parents[1]
PAGES = ("sapso.md", "patent.md", "related.md")


def filled(text: str, name: str, folder: Path) -> str:
    """Return a page with a folder's tables. Raises InputError if one is missing."""

    def table(match: re.Match[str]) -> str:
        path = folder / f"{match[1]}.md"
        if not path.is_file():
            raise InputError(
                f"{path}: expected a table of posefit reproduce or a study, got none"
            )
        content = path.read_text("utf-8").strip()
        return f"<!-- {name}: {match[1]} -->\n\n{content}\n\n<!-- end -->"

    return re.sub(
        rf"<!-- {name}: ([\w-]+) -->.*?<!-- end -->", table, text, flags=re.DOTALL
    )


@click.command(cls=Command)
@click.argument("folders", nargs=-1, required=True, metavar="NAME=OUT ...")
def main(folders: tuple[str, ...]) -> None:
    """Write the tables and figures of the folders into the handbook."""
    for page in (DOCS / "measured" / name for name in PAGES):
        text = page.read_text("utf-8")
        for name, _, out in (item.partition("=") for item in folders):
            text = filled(text, name, Path(out))
            for picture in sorted(
                set(re.findall(rf"\(\.\./pictures/{name}-([\w.-]+)\)", text))
            ):
                shutil.copyfile(
                    Path(out) / picture, DOCS / "pictures" / f"{name}-{picture}"
                )
        page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
