"""A scene is followed: by a method, from a first pose that has to be searched, into files and figures.

    import posefit
    result = posefit.track("walk", view_degrees=90, seed=1)     # the flat call
    print(result.measures.mpjpe_mm, result.motion.poses.shape)

    from pathlib import Path                                    # the same in pieces
    from posefit.footage.source import scene_of
    from posefit.motion import built_in
    from posefit.tracking.options import TrackOptions
    from posefit.tracking.pipeline import track_scene

    scene = scene_of(["walk"], view_degrees=[90.0])
    training = [built_in.motion(style) for style in built_in.other_styles("walk")]
    result = follow(scene, training, TrackOptions(method="pso", seed=1))

| looking for | file |
|---|---|
| `posefit.track` and `posefit.fit`, every option a keyword | front.py |
| a scene is followed: the order of what happens | run.py |
| names become an optimiser, a prior or a tracker, with settings checked and a budget | method.py |
| several tracks from different beginnings, and which one to keep | tracks.py |
| the first pose, searched from several starts; the person's build | opening.py |
| errors and baselines of a track, frame by frame | evaluation.py |
| what every figure is called, its unit and meaning | measures.py |
| the folder that appears whole, and goes on where it ended; its files | outputs.py, formats.py |
| whether two tracks are the same | identity.py |
| pictures, what they are made of, a recording for the Rerun viewer | picture.py, drawing/, recording.py |
| the table that is printed, with the sentence that says what was not determined | table.py |
"""
