"""The blocks of code in README and the handbook."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
RUN = ("python", "sh", "toml")  # languages whose blocks are tested
SHOWN = ("text",)  # what the block before it prints, or what is no code
_BLOCK = re.compile(
    r"^(?P<fence>`{3,})(?P<language>[^\n]*)\n(?P<text>.*?)^(?P=fence)[ ]*$",
    re.MULTILINE | re.DOTALL,
)
_MADE = re.compile(r"<!-- from the code: .*?<!-- end -->", re.DOTALL)
_MARK = re.compile(
    r"<!-- (nightly|not run|not a plan|not compared): ((?:(?!-->).)*) -->\n\Z",
    re.DOTALL,
)


@dataclass(frozen=True)
class Block:
    """A fenced block, and why it is not run or compared, where a comment right before it says so."""

    page: str
    line: int
    language: str
    text: str = field(repr=False)
    # "nightly", "not run", "not compared", or "not a plan" of TOML that is something
    # else
    mark: str = ""
    reason: str = ""

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def pages() -> list[Path]:
    """Return README and every page of the handbook that was written by hand."""
    files = [*DOCS.rglob("*.md"), *DOCS.rglob("*.ipynb")]
    written = [
        path
        for path in files
        if not {"_build", "generated", "contributions"} & set(path.parts)
    ]
    return [ROOT / "README.md", *sorted(written)]


def blocks(page: Path) -> Iterator[Block]:
    """Yield the blocks of a page, in order; not those that are instructions to the builder."""
    if page.suffix == ".ipynb":
        yield from _cells(page)
        return
    text = _MADE.sub(lambda made: "\n" * made[0].count("\n"), page.read_text("utf-8"))
    for block in _BLOCK.finditer(text):
        language = block["language"].strip()
        if language.startswith("{"):
            continue
        before = text[: block.start()]
        why = marked.groups() if (marked := _MARK.search(before)) else ()
        yield Block(
            str(page.relative_to(ROOT)),
            before.count("\n") + 1,
            language,
            block["text"],
            *why,
        )


def sentences() -> Iterator[tuple[str, str]]:
    """Yield the name of each page that was written by hand, with its text without blocks."""
    for page in pages():
        if page.suffix == ".md":
            text = _MADE.sub("", page.read_text("utf-8"))
            yield str(page.relative_to(ROOT)), _BLOCK.sub("", text)


def _cells(page: Path) -> Iterator[Block]:
    """Yield the cells of a notebook that hold code, each with what it prints."""
    name = str(page.relative_to(ROOT))
    for k, cell in enumerate(json.loads(page.read_text("utf-8"))["cells"]):
        if cell["cell_type"] == "code":
            yield Block(name, k, "python", "".join(cell["source"]))
            texts = [
                output["text"]
                for output in cell["outputs"]
                if output["output_type"] == "stream"
            ]
            yield Block(name, k, "text", "".join("".join(text) for text in texts))
