"""Motion capture: clips of poses, and the files they come from.

| looking for | file |
|---|---|
| a clip: poses, translations, frames a second; cutting and resampling it | motion.py |
| a motion by what a user names, at any rate; what methods learn from | clips.py |
| the built-in motions, which need no data | built_in.py |
| recorded clips of ten people, with the package | recorded.py |
| what "instance 17" is: the one numbering, its random streams, variations of a motion | instances.py |
| how joints accelerate, and how far feet slide while they stand | steadiness.py |
| Acclaim skeletons, such as CMU's `02.asf` | asf.py |
| Acclaim motions, such as CMU's `02_01.amc`; `read_clip` reads both files at once | amc.py |
| lines of text files, with errors that name file and line | lines.py |
| BVH, of many programs | bvh.py |
| what the joints of other programs are, by their names | joint_names.py |
| a motion of another program's skeleton, as one of posefit's | rig.py |
| files for OpenSim, and for Blender and browsers | opensim.py, gltf.py |

A file is hostile until parsed: what is wrong with it raises InputError with the file, the line, what was expected
and what came. Degrees and file units stay in the files; in memory there are radians and metres.
"""
