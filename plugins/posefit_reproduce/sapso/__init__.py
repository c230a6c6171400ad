"""The SAPSO paper's experiments: Acta Automatica Sinica 38(5), 2012, section 5. `posefit reproduce sapso`.

paper.py       the paper's own tables and numbers
motions.py     a walk, a walk with a turn and a run: CMU's clips, or built in
letter.py      SAPSO to the letter of the paper, the optimiser `sapso-letter`
methods.py     what is compared: the paper's methods, the letter, and what lacks one part of the method
experiment.py  tracks, single images, first frames and baselines: all runs
tables.py      tables, claims with verdicts
figures.py     figures 3 to 7 and 9
"""
