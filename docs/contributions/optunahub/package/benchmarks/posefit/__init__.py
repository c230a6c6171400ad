from ._posefit import Problem

__all__ = ["Problem"]
