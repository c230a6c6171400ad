"""The scripts that made what the package carries: `python -m posefit_vsmm.fit.joints` and `posefit_vsmm.fit.motion`."""
