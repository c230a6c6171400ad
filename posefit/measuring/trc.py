"""Joint positions as a .trc file, which OpenSim and other programs of biomechanics open."""

from collections.abc import Collection
from pathlib import Path

from posefit.measuring.centres import PLACES
from posefit.motion.motion import Motion


def write_trc(path: str | Path, motion: Motion, blank: Collection[int] = ()) -> None:
    """Write the 27 joints of every frame as markers, in metres and y up; of `blank` frames nothing but the time.

    Markers are named by `PLACES`. Programs that read such files take an empty field for an unobserved marker.
    """
    path, joints = Path(path), motion.joints
    count, fps = len(motion), f"{motion.fps:g}"
    head = ("DataRate", "CameraRate", "NumFrames", "NumMarkers", "Units", "OrigDataRate", "OrigDataStartFrame")
    lines = [
        f"PathFileType\t4\t(X/Y/Z)\t{path.name}",
        "\t".join([*head, "OrigNumFrames"]),
        "\t".join([fps, fps, str(count), str(len(PLACES)), "m", fps, "1", str(count)]),
        "Frame#\tTime\t" + "\t".join(f"{place}\t\t" for place in PLACES),
        "\t\t" + "\t".join(f"{axis}{k}" for k in range(1, len(PLACES) + 1) for axis in "XYZ"),
        "",
    ]
    for k, points in enumerate(joints):
        values = "\t".join("" if k in blank else f"{value:.6f}" for value in points.reshape(-1))
        lines.append(f"{k + 1}\t{k / motion.fps:.6f}\t{values}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="\n")
