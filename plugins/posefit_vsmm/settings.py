"""The settings of `vsmm`; see `posefit_vsmm.tracker.vsmm` for what they mean."""

from dataclasses import dataclass
from typing import Literal

from posefit.fitting.check import choices, positive

Variant = Literal["default", "patent"]
Structure = Literal["variable", "all"]


@dataclass(frozen=True)
class Settings:
    """Where the default differs from the patent's letter, the code asks for `patent`."""

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
