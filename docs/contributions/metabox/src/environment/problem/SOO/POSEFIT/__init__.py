from posefit_bridges.metabox import Dataset as Posefit_Dataset
