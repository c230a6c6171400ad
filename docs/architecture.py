"""Draw the packages from their imports: `python docs/architecture.py [FILE.svg]`.

Every package and module right below `posefit`, every plugin package and the environments are a box. An arrow says that
something in the upper box imports something in the lower one, wherever the import stands, but for those that only a
type checker sees. An arrow that two others imply is left out. Exit status 1 where boxes import each other in a
circle.
"""

import sys
from collections.abc import Iterable, Mapping
from html import escape
from itertools import pairwise
from pathlib import Path

import grimp

ROOT = "posefit"
ENVIRONMENTS = "posefit_envs"
HERE = Path(__file__).parent

BOX, GAP, ROW, MARGIN, LETTER = 34, 26, 74, 20, 7.4  # pixels: heights, gaps, and the width of a letter
SWEEPS = 8  # of the ordering, up and down in turn
COLOURS = {"package": "#dbe7f3", "plugin": "#e4f0dc", "environment": "#f6e7cf"}

Graph = dict[str, frozenset[str]]


def imports() -> Graph:
    """Return for each box the boxes that it imports."""
    plugins = sorted(
        {
            path.parent.name
            for folder in ("plugins", "envs")
            for path in (HERE.parent / folder).glob("posefit_*/__init__.py")
        }
    )
    imports = grimp.build_graph(ROOT, *plugins, cache_dir=None, exclude_type_checking_imports=True)
    graph: dict[str, set[str]] = {}
    for module in imports.modules:
        mine = box_of(module)
        if mine is None:
            continue
        graph.setdefault(mine, set())
        theirs = {box_of(other) for other in imports.find_modules_directly_imported_by(module)}
        graph[mine] |= {one for one in theirs if one not in (None, mine)}
    return {box: frozenset(lower) for box, lower in sorted(graph.items())}


def box_of(module: str) -> str | None:
    """Return the box a module is in; none for `posefit` itself, which only hands on the names of others."""
    parts = module.split(".")
    if parts[0] != ROOT:
        return parts[0]
    return parts[1] if len(parts) > 1 and parts[1] != "__main__" else None


def circle(graph: Mapping[str, Iterable[str]]) -> list[str]:
    """Return boxes that import each other in a circle, the first one again at the end; empty where there is none."""
    done: set[str] = set()

    def visit(box: str, path: list[str]) -> list[str]:
        if box in path:
            return [*path[path.index(box) :], box]
        if box not in done:
            for lower in sorted(graph[box]):
                if cycle := visit(lower, [*path, box]):
                    return cycle
            done.add(box)
        return []

    return next((cycle for box in graph if (cycle := visit(box, []))), [])


def reduced(graph: Graph) -> Graph:
    """Return the arrows that no path over other boxes implies."""

    def below(box: str) -> set[str]:
        return {one for lower in graph[box] for one in (lower, *below(lower))}

    return {box: frozenset(lower - {one for other in lower for one in below(other)}) for box, lower in graph.items()}


def grouped(graph: Graph) -> tuple[Graph, dict[str, str]]:
    """Return the graph with the plugins that import the same as one box, and the text of every box."""
    groups: dict[frozenset[str], list[str]] = {}
    for box, lower in graph.items():
        if _outside(box) and box != ENVIRONMENTS:
            groups.setdefault(lower, []).append(box)
    leader = {box: boxes[0] for boxes in groups.values() for box in boxes}
    texts = {boxes[0]: ", ".join(one.removeprefix("posefit_") for one in boxes) for boxes in groups.values()}
    kept = {
        box: frozenset(leader.get(one, one) for one in lower)
        for box, lower in graph.items()
        if leader.get(box, box) == box
    }
    return kept, {box: texts.get(box, box.removeprefix("posefit_")) for box in kept}


def levels(graph: Graph) -> list[list[str]]:
    """Return rows of boxes, the lowest first; a box stands right above the highest one that it imports."""
    height: dict[str, int] = {}

    def of(box: str, least: int) -> int:
        if box not in height:
            height[box] = max([least, *(1 + of(one, 0) for one in graph[box])])
        return height[box]

    own = [box for box in graph if not _outside(box)]
    top = max((of(box, 0) for box in own), default=0)
    for box in sorted(graph, key=lambda box: box == ENVIRONMENTS):  # the environments stand above all
        of(box, top + 1)
    rows: list[list[str]] = [[] for _ in range(1 + max(height.values()))]
    for box in sorted(height):
        rows[height[box]].append(box)
    return [row for row in rows if row]


def routed(rows: list[list[str]], graph: Graph) -> tuple[list[list[str]], dict[str, list[str]], list[list[str]]]:
    """Return the rows with a bend in every row that an arrow passes, what is next below each, and the arrows' paths."""
    height = {box: level for level, row in enumerate(rows) for box in row}
    rows = [list(row) for row in rows]
    below: dict[str, list[str]] = {box: [] for box in graph}
    ways = []
    for box, lower in graph.items():
        for one in sorted(lower):
            bends = [f"{box}>{one}@{level}" for level in range(height[box] - 1, height[one], -1)]
            for bend, level in zip(bends, range(height[box] - 1, height[one], -1), strict=True):
                rows[level].append(bend)
            way = [box, *bends, one]
            for upper, under in pairwise(way):
                below.setdefault(upper, []).append(under)
            ways.append(way)
    return rows, below, ways


def ordered(rows: list[list[str]], below: Mapping[str, list[str]]) -> list[list[str]]:
    """Return the rows with each box about at the middle of its neighbours, so that few arrows cross. Sugiyama, 1981."""
    above: dict[str, list[str]] = {}
    for box, lower in below.items():
        for one in lower:
            above.setdefault(one, []).append(box)
    rows = [list(row) for row in rows]
    for sweep in range(SWEEPS):
        upwards = sweep % 2 == 0
        neighbours = below if upwards else above
        for level in range(len(rows)) if upwards else reversed(range(len(rows))):
            place = {box: (k + 0.5) / len(row) for row in rows for k, box in enumerate(row)}
            rows[level].sort(key=lambda box: _mean([place[one] for one in neighbours.get(box, [])], place[box]))
    return rows


def _mean(values: list[float], otherwise: float) -> float:
    return sum(values) / len(values) if values else otherwise


def _outside(box: str) -> bool:
    """Return whether a box is a plugin or the environments, which are outside `posefit`."""
    return box.startswith(f"{ROOT}_")


def svg(graph: Graph) -> str:
    """Return the drawing."""
    arrows, texts = grouped(reduced(graph))
    rows, below, ways = routed(levels(arrows), arrows)
    rows = ordered(rows, below)
    widths = {box: LETTER * len(texts[box]) + 24 if box in texts else 0.0 for row in rows for box in row}
    wide = max(sum(widths[box] + GAP for box in row) for row in rows) + 2 * MARGIN
    tall = ROW * len(rows) + 2 * MARGIN - (ROW - BOX)
    middles: dict[str, tuple[float, float]] = {}
    for level, row in enumerate(rows):
        x = (wide - sum(widths[box] for box in row) - GAP * (len(row) - 1)) / 2
        for box in row:
            middles[box] = x + widths[box] / 2, tall - MARGIN - level * ROW - BOX / 2
            x += widths[box] + GAP
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {wide:.0f} {tall:.0f}" width="{wide:.0f}" '
        'font-family="ui-sans-serif, sans-serif" font-size="13">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0L8 4L0 8z" fill="#7a8794"/></marker></defs>',
        f'<rect width="{wide:.0f}" height="{tall:.0f}" fill="white"/>',
    ]
    for way in ways:
        x, y = middles[way[0]]
        path = f"M{x:.1f} {y + BOX / 2:.1f}"
        for box in way[1:]:
            (u, v), start = middles[box], y + BOX / 2
            end = v - BOX / 2
            middle = (start + end) / 2
            path += f"C{x:.1f} {middle:.1f} {u:.1f} {middle:.1f} {u:.1f} {end:.1f}"
            path += "" if box in texts else f"L{u:.1f} {v + BOX / 2:.1f}"
            x, y = u, v
        lines.append(f'<path d="{path}" fill="none" stroke="#7a8794" marker-end="url(#tip)"/>')
    for box in texts:
        x, y = middles[box]
        kind = "environment" if box == ENVIRONMENTS else "plugin" if _outside(box) else "package"
        left, top = x - widths[box] / 2, y - BOX / 2
        lines.append(
            f'<rect x="{left:.1f}" y="{top:.1f}" width="{widths[box]:.1f}" height="{BOX}" rx="5" '
            f'fill="{COLOURS[kind]}" stroke="#5b6773"/>'
            f'<text x="{x:.1f}" y="{y + 4.5:.1f}" text-anchor="middle" fill="#1d2733">{escape(texts[box])}</text>'
        )
    return "\n".join([*lines, "</svg>"]) + "\n"


def drawing() -> str:
    """Return the drawing. Raises ValueError naming a circle where there is one."""
    graph = imports()
    if boxes := circle(graph):
        raise ValueError(f"boxes must not import each other in a circle, got {' -> '.join(boxes)}")
    return svg(graph)


def main(arguments: list[str]) -> int:
    """Write the drawing and return the exit status."""
    path = Path(arguments[0]) if arguments else HERE / "pictures" / "architecture.svg"
    try:
        text = drawing()
    except ValueError as error:
        print(error, file=sys.stderr)
        return 1
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    print(f"written to {path}")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
