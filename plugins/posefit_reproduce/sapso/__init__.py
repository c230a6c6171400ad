"""The SAPSO paper's experiments: Acta Automatica Sinica 38(5), 2012, section 5. `posefit reproduce sapso`.

paper.py       the paper's own tables, the methods that are compared, and how much is run
motions.py     a walk, a walk with a turn and a run: CMU's clips, or built in
letter.py      SAPSO to the letter of the paper, the optimiser `sapso-letter`
experiment.py  the tracks, single images, first frames and baselines
claims.py      what the paper claims, and whether the experiments confirm it
report.py      tables 1 and 2, what was shortened, and the printed text
figures.py     figures 3 to 7 and 9
"""
