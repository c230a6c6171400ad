import numpy as np
import pytest

from posefit import Body, Camera
from posefit.motion.built_in import average_skeleton


@pytest.fixture(scope="session")
def body() -> Body:
    return Body.of(average_skeleton())


@pytest.fixture
def camera() -> Camera:
    return Camera.around(np.zeros(3), 0.4, 4.0, (96, 72))
