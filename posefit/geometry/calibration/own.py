"""posefit's own cameras, as `Camera.to_json` writes them."""

from posefit.geometry.calibration.dialect import Dialect
from posefit.geometry.calibration.lens import Calibration
from posefit.geometry.calibration.values import Stored
from posefit.geometry.camera import Camera


def _read(stored: Stored) -> list[Calibration]:
    return [Calibration.of(Camera.from_json(stored.path), stored.path.stem)]


OWN = Dialect("posefit", lambda stored: "camera_from_world" in stored.values, _read)
