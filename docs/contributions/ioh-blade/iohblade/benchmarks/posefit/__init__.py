from posefit_bridges.blade import Problem as Posefit
