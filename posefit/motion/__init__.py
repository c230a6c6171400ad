"""Motion capture: clips of poses, and the files they come from.

| looking for | file |
|---|---|
| a clip: poses, translations, frame rate; cutting and resampling it | motion.py |
| the motion that a user names, at any rate; motions to learn from | clips.py |
| the built-in motions, which need no data | built_in.py |
| recorded clips of ten people, which come with the package | recorded.py |
| what "instance 17" is: numbers, random streams, variations | instances.py |
| how joints accelerate, and how far feet slide on the ground | steadiness.py |
| Acclaim skeletons, such as CMU's `02.asf` | asf.py |
| Acclaim motions, such as CMU's `02_01.amc`; `read_clip` reads both files | amc.py |
| lines of text files, with errors that name file and line | lines.py |
| BVH files of many programs | bvh.py |
| joints of other programs, recognised by their names | joint_names.py |
| a motion of another program's skeleton, as one of posefit's | rig.py |
| files for OpenSim, and for Blender and browsers | opensim.py, gltf.py |

Files are checked in full. A mistake raises InputError with the name of the file, the
line, and the expected and the actual text. Files have degrees and their own unit of
length; in memory everything is in radians and metres.
"""
