"""`python -m posefit` is `posefit`."""

from posefit.cli import run

run()
