"""Weighted poses: the possible poses, their probabilities, and intervals of joints.

A silhouette seldom determines a single pose. A `Posterior` has the possible poses of
one frame with their weights.

    from posefit.uncertainty.intervals import joint_intervals
    from posefit.uncertainty.modes import modes_of

    for mode in modes_of(skeleton, posterior):             # the likeliest first
        print(mode.weight, mode.pose[0])
    radii = joint_intervals(skeleton, posterior, pose)     # metres about each joint
    print(radii[1])                                        # right in 80 of 100 cases

| subject | field's term | file |
|---|---|---|
| clusters of weighted poses; exchanged sides | modes, mirror ambiguity | modes.py |
| errors of joints and angles | credible intervals, of a mixture | intervals.py |
| errors that all frames of footage share | systematic error | shared.py |
| corrected probabilities and intervals | conformal prediction, ECE | calibration.py |
"""
