"""A motion in the words and the units of people who measure: plain functions of a `Motion`.

| looking for | file |
|---|---|
| what each of the 27 joints is on a person; the centres of the large joints | centres.py |
| the axes of the segments | segments.py |
| clinical angles of hip, knee, ankle, shoulder and elbow, in degrees | angles.py |
| when feet strike and lift off | events.py |
| cadence, step, stride, speed, stance, and whether it is a walk, or backwards | gait.py |
| tables, and files for other programs | tables.py, c3d.py |

    from posefit.measuring.angles import clinical_angles
    from posefit.measuring.gait import gait_of
    from posefit.motion import recorded

    walk = recorded.clip("16_15").motion()
    print(clinical_angles(walk.skeleton, walk.poses)["left_knee_flexion"].max(), gait_of(walk).cadence)
"""
