"""`python -m posefit` is `posefit`."""

from posefit.cli import main

main()
