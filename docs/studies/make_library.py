"""Makes the library of recorded motions: `python docs/studies/make_library.py CMU30_DIR`.

CMU30_DIR holds clips at 30 frames a second: one NN.npz a subject with `poses` (T, 66) in radians, `translations` (T, 3)
in metres, `names` and `lengths` of the clips, and their skeletons in asf/NN.asf. Of each clip those poses are stored
between which the others can be interpolated, no joint more than a centimetre off. It is run by hand when a person is
added; its result, recorded.npz, is what the package carries.
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
    "Recorded motions of mocap.cs.cmu.edu. The data used in this project was obtained from mocap.cs.cmu.edu. "
    "The database was created with funding from NSF EIA-0196217."
)
# metres that a joint of a pose left out may be away from where it is interpolated
TOLERANCE = 0.01
LONGEST_GAP = 8  # frames from one stored pose to the next


def kept_frames(
    skeleton: Skeleton, poses: Array, translations: Array
) -> NDArray[np.int64]:
    """Return which frames of poses (T, 66) and translations (T, 3) to keep, the first and the last among them.

    Each gap is as long as it can be, so that a body at rest leaves few poses.
    """
    values = np.column_stack([poses, translations])
    joints = skeleton.joints(poses, translations)

    def replaceable(start: int, stop: int) -> bool:
        """Whether the frames between two that are stored can be interpolated."""
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
    """Write recorded.npz beside this file. Raises ValueError where CMU30_DIR holds no subject."""
    files = sorted(root.glob("*.npz"), key=lambda path: int(path.stem))
    if not files:
        raise InputError(
            f"CMU30_DIR must hold one .npz a subject, got {root} without any"
        )
    skeletons: list[dict[str, Any]] = []
    names = []
    owners = []
    counts = []
    gaps = []
    numbers = []
    for path in files:
        skeleton = parse_asf(root / "asf" / f"{path.stem}.asf").skeleton
        skeletons.append(
            {
                "name": path.stem,
                "offsets": np.round(skeleton.offsets, 6).tolist(),
                "axes_degrees": np.round(
                    np.degrees(joint_angles_from_rotation(skeleton.axes)), 4
                ).tolist(),
                "channels": skeleton.channels,
                "limits_degrees": None
                if skeleton.limits is None
                else np.round(np.degrees(skeleton.limits), 4).tolist(),
            }
        )
        with np.load(path) as stored:
            if float(stored["fps"]) != FPS:
                raise InputError(
                    f"{path}: expected clips at {FPS:g} frames a second, got {float(stored['fps']):g}"
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
                    f"{path}: expected poses that change little by little, got a jump in {name}"
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
        f"{target.name}: {len(names)} clips, {sum(counts)} poses, {target.stat().st_size} bytes"
    )


if __name__ == "__main__":
    main()
