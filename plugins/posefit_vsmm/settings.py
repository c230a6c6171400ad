"""The settings of `vsmm`; see `posefit_vsmm.tracker.vsmm` for what they mean."""

from dataclasses import dataclass
from typing import Literal

from posefit.fitting.check import choices, positive

Variant = Literal["default", "patent"]
Structure = Literal["variable", "all"]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """Where the patent's letter and the default differ, the code asks for `patent`; all else is the user's choice."""

    variant: Variant = "default"
    structure: Structure = "variable"
    groups: str = ""
    models: str = ""
    process_noise: float = 1.0
    joint_noise: float = 1.0
    recovery: bool | None = None

    def __post_init__(self) -> None:
        choices(Settings, vars(self))
        positive("process_noise", self.process_noise)
        positive("joint_noise", self.joint_noise)

    @property
    def patent(self) -> bool:
        """Whether interpretations are the patent's letter."""
        return self.variant == "patent"

    @property
    def recovers(self) -> bool:
        """Whether a lost pose is estimated again and a lost limb sought all around. Interpretation V14."""
        return not self.patent if self.recovery is None else self.recovery
