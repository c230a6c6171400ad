"""The box that optimisers search: proposals in [-1, 1]^d, and their poses."""

from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array, writeable
from posefit.errors import InputError
from posefit.fitting.box import Start
from posefit.fitting.check import one_of
from posefit.fitting.kernels import unpack_proposals
from posefit.fitting.prior import Latents, Tilt
from posefit.geometry.rotation import wrapped, yaw_first
from posefit.geometry.skeleton import ANGLES
from posefit.reading import quoted

Translation = Literal["known", "searched", "aligned"]  # Interpretation S4
RootOrder = Literal["yaw_first", "xyz"]
TRANSLATIONS: tuple[Translation, ...] = ("known", "searched", "aligned")

# Ours: the range of yaw, pitch and roll to either side.
ROOT_RANGE_DEGREES = (45.0, 15.0, 15.0)
TRANSLATION_RANGE = (0.5, 0.5, 0.5)  # ours: metres to either side


@dataclass(frozen=True, eq=False)
class SearchSpace:
    """Maps proposals (n, d) in [-1, 1]^d to poses (n, 66) and translations (n, 3).

    The coordinates of a proposal are, in this order: root yaw, pitch, roll in radians;
    the translation in metres, if it is searched; the latents of the prior. With a
    `tilt`, pitch and roll are added to their mean for the latents, and the box of both
    moves with the last pose.

    Args:
        prior: The fitted prior.
        root_centre: The centre (3,) of the root's yaw, pitch and roll, in radians.
        root_range: The range (3,) to either side of it, in radians.
        anchor: The position (3,) of the root, known or guessed, in metres.
        translation: Whether the position is "known", "searched" or "aligned".
        translation_range: The range (3,) of a searched position in metres.
        start: The distribution of a first population, or None for anywhere.
        tilt: The learned pitch and roll, or None for a box around `root_centre`.
        root_order: The order of the root's rotations.

    Raises:
        InputError: A range or a name is wrong, or a learned tilt is combined with the
            root order "xyz".

    Example:
        >>> import numpy as np
        >>> import posefit
        >>> walk = posefit.load_motion("walk")
        >>> prior = posefit.prior("pca")().fit(walk.poses[:, 3:])
        >>> space = posefit.SearchSpace(
        ...     prior, np.zeros(3), np.radians([45, 15, 15]), walk.translations[0]
        ... )
        >>> poses, places = space.decode(np.zeros((4, space.dimensions)))
        >>> poses.shape, places.shape
        ((4, 66), (4, 3))
    """

    prior: Latents = field(repr=False)
    root_centre: Array  # (3,) radians: the middle of the root's range
    root_range: Array  # (3,) radians to either side; a range of pi wraps around
    # (3,) metres: the known translation, the middle of the searched range, or where
    # aligning starts
    anchor: Array
    translation: Translation = "known"
    # (3,) metres
    translation_range: Array = field(
        default_factory=lambda: np.array(TRANSLATION_RANGE)
    )
    # None: the first population is drawn uniformly from the box
    start: Start | None = None
    # None: pitch and roll are in the pose
    tilt: Tilt | None = field(default=None, repr=False)
    root_order: RootOrder = "yaw_first"  # Interpretation S3; "xyz" has no tilt
    # (d,) coordinates of the box's middle
    centre: Array = field(init=False, repr=False)
    half: Array = field(init=False, repr=False)  # (d,) half its sides
    # (d,) coordinates that wrap around
    periodic: NDArray[np.bool_] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        one_of("translation", self.translation, TRANSLATIONS)
        if self.root_order == "xyz" and self.tilt is not None:
            raise InputError(
                'tilt must be "box" with the root order "xyz", that of the variant '
                '"paper", got a learned one'
            )
        for name in ("root_range", "translation_range"):
            reach = np.asarray(getattr(self, name))
            if reach.shape != (3,) or not (
                np.isfinite(reach).all() and (reach >= 0.0).all()
            ):
                came = quoted(reach.tolist())
                raise InputError(f"{name} must be 3 numbers of 0 or more, got {came}")
        low = np.asarray(self.prior.low)
        high = np.asarray(self.prior.high)
        middle = [self.root_centre, 0.5 * (low + high)]
        half = [self.root_range, 0.5 * (high - low)]
        if self.translation == "searched":
            middle.insert(1, self.anchor)
            half.insert(1, self.translation_range)
        object.__setattr__(self, "centre", np.concatenate(middle).astype(np.float64))
        object.__setattr__(self, "half", np.concatenate(half).astype(np.float64))
        object.__setattr__(self, "anchor", np.array(self.anchor, dtype=np.float64))
        periodic = np.zeros(len(self.centre), dtype=bool)
        periodic[:3] = np.asarray(self.root_range) >= np.pi - 1e-12
        object.__setattr__(self, "periodic", periodic)

    @property
    def dimensions(self) -> int:
        """The number of coordinates of a proposal."""
        return len(self.centre)

    def around(
        self,
        coordinates: Array,
        start: Start | None = None,
        anchor: Array | None = None,
    ) -> "SearchSpace":
        """Return the space with its yaw range centred on coordinates (d,).

        A searched translation is centred on them too, and so are pitch and roll of a
        tilt, within its range.
        """
        root = np.array([coordinates[0], *self.root_centre[1:]])
        if self.tilt is not None:
            root[1:] = self.tilt.around(coordinates[1:3], self.root_range[1:])[0]
        if self.translation == "searched":
            anchor = coordinates[3:6]
        return replace(
            self,
            root_centre=root,
            anchor=self.anchor if anchor is None else anchor,
            start=start,
        )

    def coordinates(self, proposals: Array) -> Array:
        """Return the coordinates (..., d) of proposals: radians, metres and latents."""
        return self.centre + self.half * proposals

    def proposals(self, coordinates: Array) -> Array:
        """Return the proposals (..., d) in the box nearest to coordinates (..., d)."""
        away = coordinates - self.centre
        away[..., :3] = wrapped(away[..., :3])
        return np.clip(away / np.where(self.half > 0.0, self.half, 1.0), -1.0, 1.0)

    def decode(self, proposals: Array) -> tuple[Array, Array]:
        """Return the poses (n, 66) and translations (n, 3) of proposals (n, d).

        An aligned translation is only its anchor here. `SilhouetteCost`,
        which has the silhouettes, aligns it.

        Raises:
            InputError: The shape is wrong, or a proposal is not finite.
        """
        proposals = writeable(proposals)
        d = len(self.centre)
        m = len(self.prior.low)
        if proposals.shape[1:] != (d,):
            raise InputError(
                f"proposals must have shape (n, {d}), got {proposals.shape}"
            )
        n = len(proposals)
        poses = np.empty((n, ANGLES))
        translations = np.empty((n, 3))
        latents = np.empty((n, m))
        if self.tilt is None:
            tilt = np.zeros((3 + m, 2))
        else:
            tilt = self.tilt.mean
        if not unpack_proposals(
            proposals,
            self.centre,
            self.half,
            self.anchor,
            tilt,
            poses,
            translations,
            latents,
        ):
            raise InputError("proposals must be finite, got nan or infinity")
        if self.root_order == "xyz":
            poses[:, :3] = yaw_first(poses[:, :3])
        poses[:, 3:] = self.prior.inverse_transform(latents)
        return poses, translations

    def feasible(self, proposals: Array) -> NDArray[np.bool_]:
        """Return which proposals (n, d) lie in the box and are poses. SAPSO 2.2."""
        latents = slice(self.dimensions - len(self.prior.low), None)
        allowed = self.prior.feasible(
            self.centre[latents] + self.half[latents] * proposals[:, latents]
        )
        return np.asarray(allowed & (np.abs(proposals) <= 1.0).all(axis=1))

    def moved(self, proposals: Array, origin: "SearchSpace") -> Array:
        """Return the proposals (n, d) nearest to the poses of those in `origin`."""
        return self.proposals(origin.centre + origin.half * proposals)
