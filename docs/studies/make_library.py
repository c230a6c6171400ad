"""Makes the recorded library: `python docs/studies/make_library.py CMU30_DIR`.

CMU30_DIR holds clips at 30 frames a second. There is one NN.npz for each subject, with
`poses` (T, 66) in radians, `translations` (T, 3) in metres, and `names` and `lengths`
of the clips. Skeletons are in asf/NN.asf. Of each clip only some poses are stored; the
others are interpolated, with no joint more than a centimetre off. Run it by hand when a
person is added. The package contains its result, recorded.npz.
"""

import json
from pathlib import Path
from typing import Any

import click
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.geometry.rotation import joint_angles_from_rotation
from posefit.geometry.skeleton import Skeleton
from posefit.motion import recorded
from posefit.motion.asf import parse_asf
from posefit.motion.recorded import FPS, STEP

ORIGIN = (
    "Recorded motions of mocap.cs.cmu.edu. "
    "The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)
# largest distance in metres of an interpolated joint from the recorded one
TOLERANCE = 0.01
LONGEST_GAP = 8  # frames between stored poses


def kept_frames(
    skeleton: Skeleton, poses: Array, translations: Array
) -> NDArray[np.int64]:
    """Return the frames of poses (T, 66) and translations (T, 3) to store.

    The first and the last are among them. Each gap is as long as possible, so that a
    body at rest needs few poses.
    """
    values = np.column_stack([poses, translations])
    joints = skeleton.joints(poses, translations)

    def replaceable(start: int, stop: int) -> bool:
        """Return whether the frames between two stored ones can be interpolated."""
        share = np.linspace(0.0, 1.0, stop - start + 1)[1:-1, None]
        between = (1.0 - share) * values[start] + share * values[stop]
        away = (
            skeleton.joints(between[:, :-3], between[:, -3:]) - joints[start + 1 : stop]
        )
        return bool(np.linalg.norm(away, axis=-1).max() <= TOLERANCE)

    rows = [0]
    while (start := rows[-1]) < len(poses) - 1:
        stop = start + 1
        while (
            stop + 1 < len(poses)
            and stop + 1 - start <= LONGEST_GAP
            and replaceable(start, stop + 1)
        ):
            stop += 1
        rows.append(stop)
    return np.array(rows)


@click.command(cls=Command)
@click.argument("root", metavar="CMU30_DIR", type=click.Path(path_type=Path))
def main(root: Path) -> None:
    """Write recorded.npz into the package.

    Raises ValueError if CMU30_DIR holds no subject.
    """
    files = sorted(root.glob("*.npz"), key=lambda path: int(path.stem))
    if not files:
        raise InputError(
            f"CMU30_DIR must contain one .npz per subject, got {root} without any"
        )
    skeletons: list[dict[str, Any]] = []
    names = []
    owners = []
    counts = []
    gaps = []
    numbers = []
    for path in files:
        skeleton = parse_asf(root / "asf" / f"{path.stem}.asf").skeleton
        limits = None
        if skeleton.limits is not None:
            limits = np.round(np.degrees(skeleton.limits), 4).tolist()
        skeletons.append(
            {
                "name": path.stem,
                "offsets": np.round(skeleton.offsets, 6).tolist(),
                "axes_degrees": np.round(
                    np.degrees(joint_angles_from_rotation(skeleton.axes)), 4
                ).tolist(),
                "channels": skeleton.channels,
                "limits_degrees": limits,
            }
        )
        with np.load(path) as stored:
            if float(stored["fps"]) != FPS:
                raise InputError(
                    f"{path}: expected clips at {FPS:g} frames a second, "
                    f"got {float(stored['fps']):g}"
                )
            clips = zip(
                stored["names"].tolist(), stored["lengths"].tolist(), strict=True
            )
            everything = np.column_stack(
                [stored["poses"], stored["translations"]]
            ).astype(np.float64)
        start = 0
        for name, length in clips:
            values = everything[start : start + length]
            start += length
            rows = kept_frames(skeleton, values[:, :-3], values[:, -3:])
            steps = np.rint(values[rows] / STEP).astype(np.int64)
            changes = np.diff(steps, axis=0, prepend=0)
            if np.abs(changes).max() > np.iinfo(np.int16).max:
                raise InputError(
                    f"{path}: expected poses that change gradually, "
                    f"got a jump in {name}"
                )
            names.append(name)
            owners.append(len(skeletons) - 1)
            counts.append(len(rows))
            gaps.append(np.diff(rows, prepend=0))
            numbers.append(changes)
    target = Path(recorded.__file__).with_name("recorded.npz")
    np.savez_compressed(
        target,
        origin=np.array(ORIGIN),
        skeletons=np.array(json.dumps(skeletons, separators=(",", ":"))),
        names=np.array(names),
        owners=np.array(owners, dtype=np.uint8),
        counts=np.array(counts, dtype=np.uint16),
        gaps=np.concatenate(gaps).astype(np.uint8),
        # one angle after the other: similar numbers side by side compress better
        changes=np.ascontiguousarray(np.concatenate(numbers).T.astype(np.int16)),
    )
    print(
        f"{target.name}: {len(names)} clips, {sum(counts)} poses, "
        f"{target.stat().st_size} bytes"
    )


if __name__ == "__main__":
    main()
