"""The list of messages about mistakes in the input, from the code that raises them."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDERS = ("posefit", "plugins", "envs")
ADVICE = ROOT / "docs/howto/troubleshooting.md"
_ROW = re.compile(r"^\| `([^`]+)`[^|]*\| (.+) \|$", re.MULTILINE)


def page() -> str:
    """Return a table of messages for each package, as Markdown.

    A column of advice is added if a message of the package has some.
    """
    parts = []
    for package, messages in by_package().items():
        advice = {text: _advice(text) for text, _ in messages}
        rows = ["| message | module |", "|---|---|"]
        if any(advice.values()):
            rows = ["| message | module | what to do |", "|---|---|---|"]
        for text, module in messages:
            row = f"| `{text}` | `{module}` |"
            if any(advice.values()):
                row += f" {advice[text]} |"
            rows.append(row)
        parts.append(f"## {package}\n\n" + "\n".join(rows))
    return "\n\n".join(parts) + "\n"


def by_package() -> dict[str, list[tuple[str, str]]]:
    """Return each package's messages, with the modules that raise them.

    In a message, `...` is a name or a value.
    """
    packages: dict[str, list[tuple[str, str]]] = {}
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            names = path.relative_to(ROOT).with_suffix("").parts
            module = ".".join(names[1:] if folder != "posefit" else names)
            package = ".".join(module.split(".")[: 2 if folder == "posefit" else 1])
            found = {(text, module): None for text in _messages(path)}
            if found:
                packages.setdefault(package, []).extend(found)
    return packages


def _messages(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if not isinstance(node, ast.Call) or not node.args:
            continue
        if getattr(node.func, "id", "") not in ("InputError", "ArgumentError"):
            continue
        text = _template(node.args[0])
        if re.search(r"[a-z]{3}", text):
            yield text


def _template(node: ast.expr) -> str:
    """Return a text with `...` for each of its values."""
    values = node.values if isinstance(node, ast.JoinedStr) else [node]
    parts = []
    for value in values:
        is_text = isinstance(value, ast.Constant) and isinstance(value.value, str)
        parts.append(str(value.value) if is_text else "...")
    text = re.sub(r"(\.\.\.)+", "...", "".join(parts))
    return " ".join(text.split()).replace("|", r"\|").replace("`", "'")


def _advice(text: str) -> str:
    """Return the advice of troubleshooting.md about a message, or ""."""
    for message, advice in _ROW.findall(ADVICE.read_text("utf-8")):
        parts = [part.strip() for part in message.split("...")]
        # a few words fit messages that the row is not about
        if len(message) > 12 and all(part in text for part in parts):
            return str(advice).replace("](", "](../howto/")
    return ""
