"""What the silhouette of one frame leaves open: every pose of the library that fits nearly as well as the best.

    from posefit.ambiguity.run import ambiguity_of
    from posefit.ambiguity.table import ambiguity_table

    found = ambiguity_of("16_15", frame=20, within=2.0, train=["library:-16"])
    print(ambiguity_table(found))
    print(found.floors[0].spread_mm, found.floors[1].spread_mm)    # by one camera, and by two

| looking for | file |
|---|---|
| the poses that are compared | library.py |
| the search for all that fit nearly as well as the best | search.py |
| groups of poses that are alike, and the spread of them all | clusters.py |
| the build of a person who was followed before | build.py |
| one frame of a source, by one camera and by more | run.py |
| what is printed, drawn and written | table.py, picture.py, outputs.py |
"""
