"""`python -m posefit` is `posefit`."""
