"""The experiments of the SAPSO paper, section 5: `posefit reproduce sapso`.

Acta Automatica Sinica 38(5), 2012.

paper.py       the paper's own tables and numbers
motions.py     a walk, a walk with a turn and a run: CMU's clips, or posefit's library
letter.py      SAPSO to the letter of the paper, the optimiser `sapso-letter`
methods.py     the compared methods: the paper's, the letter, and variants that lack
               a part
experiment.py  tracks, single images, first frames and baselines: all runs
tables.py      tables, claims with verdicts
figures.py     figures 3 to 7 and 9
"""
