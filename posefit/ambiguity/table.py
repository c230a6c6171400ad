"""What `posefit ambiguity` prints: lines for people, and the same as numbers."""

from typing import Any

import numpy as np

from posefit.ambiguity.clusters import AlikePoses
from posefit.ambiguity.run import Ambiguity
from posefit.ambiguity.search import YAWS
from posefit.geometry.alike import facing
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import JOINTS, kind
from posefit.version import __version__

FEW = 10  # poses; the spread of so few says more of the library than of the silhouette
TOLD = 8  # clusters that have a line each
WIDEST = 3  # joints that are named


def summary_of(found: Ambiguity) -> dict[str, Any]:
    """Return everything as `--json` prints it: weights, millimetres and degrees."""
    return {
        "source": found.scene.name,
        "frame": found.frame,
        "within": found.within,
        "temperature": found.temperature,
        "translation": "known" if found.moment.known else "aligned",
        "views": len(found.moment.cameras),
        "library": {"clips": len(found.library.names), "poses": len(found.library), "yaws": YAWS},
        "alike": len(found.states),
        "least_cost": float(found.states.costs.min()),
        "modes": [_mode(found, k) for k in range(len(found.clusters))],
        "floor": [
            {
                "views": floor.views,
                "alike": floor.count,
                "least_cost": floor.least,
                "spread_mm": floor.spread_mm,
                "joints_mm": dict(zip(JOINTS, floor.joints_mm.tolist(), strict=True)),
            }
            for floor in found.floors
        ],
        "seconds": found.seconds,
        "warnings": list(found.scene.warnings),
        "version": __version__,
    }


def ambiguity_table(found: Ambiguity) -> str:
    """Return the lines that `posefit ambiguity` prints."""
    count, alike = len(found.library), len(found.states)
    lines = [
        f"{found.scene.name}, frame {found.frame}: {count:,} poses of the library at {YAWS} yaws, compared in "
        f"{found.seconds:.1f} s",
        f"{alike:,} cost at most {found.within:g} more than the least, {found.states.costs.min():.2f}, in "
        f"{len(found.clusters)} {'mode' if len(found.clusters) == 1 else 'modes'}",
    ]
    known = found.truth_mm is not None
    lines.append(
        f"{'weight':>6} {'spread mm':>9} {'from first mm':>13} "
        + (f"{'from truth mm':>13} " if known else "")
        + f"{'yaw deg':>7} {'seen from deg':>13}  {'image':9}  example"
    )
    for k in range(min(TOLD, len(found.clusters))):
        one = _mode(found, k)
        clip = f"{one['clip']} frame {one['clip_frame']}{', mirrored' if one['clip_mirrored'] else ''}"
        lines.append(
            f"{one['weight']:6.2f} {one['spread_mm']:9.0f} {one['away_mm']:13.0f} "
            + (f"{one['truth_mm']:13.0f} " if known else "")
            + f"{one['yaw_degrees']:7.0f} {one['view_degrees']:13.0f}  {one['image'] or '-':9}  {clip}"
        )
    if more := found.clusters[TOLD:]:
        lines.append(f"{sum(one.weight for one in more):6.2f} in {len(more)} more")
    lines.append("spread of what cannot be told apart, mm:")
    for floor in found.floors:
        lines.append(f"{floor.spread_mm:6.0f}  by {floor.views}: {_widest(floor.joints_mm)}; {floor.count:,} poses")
    if min(floor.count for floor in found.floors) < FEW:
        lines.append(
            f"fewer than {FEW} poses say more of what is in the library than of the silhouette: try a larger --within"
        )
    return "\n".join(lines)


def by_kind(joints_mm: Any) -> dict[str, float]:
    """Return the spreads (27,) of joints without their sides: the root mean square of left and right."""
    squares: dict[str, list[float]] = {}
    for name, value in zip(JOINTS[1:], joints_mm[1:], strict=True):
        squares.setdefault(kind(name), []).append(float(value) ** 2)
    return {name: float(np.sqrt(np.mean(values))) for name, values in squares.items()}


def _widest(joints_mm: Any) -> str:
    spreads = by_kind(joints_mm)
    names = sorted(spreads, key=lambda name: -spreads[name])[:WIDEST]
    return ", ".join(f"{name} {spreads[name]:.0f}" for name in names)


def _mode(found: Ambiguity, k: int) -> dict[str, Any]:
    """Return what is told of a cluster."""
    one: AlikePoses = found.clusters[k]
    row, yaw = int(found.states.rows[one.best]), float(found.states.poses[one.best, 0])
    towards = facing(found.moment.cameras[0], found.states.translations[one.best])
    library = found.library
    return {
        "weight": one.weight,
        "poses": len(one.members),
        "spread_mm": one.spread_mm,
        "away_mm": one.away_mm,
        **({} if found.truth_mm is None else {"truth_mm": found.truth_mm[k]}),
        "yaw_degrees": float(np.degrees(yaw)),
        "view_degrees": float(np.degrees(wrapped(np.array(towards - yaw)))),
        "image": one.image or None,
        "cost": float(found.states.costs[one.best]),
        "clip": library.names[library.clips[row]],
        "clip_frame": int(library.frames[row]),
        "clip_mirrored": library.is_mirrored(row),
    }
