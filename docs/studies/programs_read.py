"""Reads the files of a track in a program's environment, for programs.py.

    python programs_read.py PROGRAM FOLDER

It prints a line of JSON for each file: its name, and an error, nothing, or a dash if
the program does not offer this. posefit need not be installed.
"""

import importlib
import json
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

EXPECTED = "expected.json"
NOT_OFFERED = "-"
METRES = 2e-6  # tolerance of a joint; tables have micrometres
BONE_METRES = 1e-4  # tolerance after a program's kinematics with 32-bit numbers
SECONDS = 1e-6
TASKS = "<IKMarkerTask name='{}'><apply>true</apply><weight>1</weight></IKMarkerTask>"
# scales a thigh by the distance of two markers, then places all markers
SCALING = """<OpenSimDocument Version="40000"><ScaleTool name="person"><mass>70</mass>
<GenericModelMaker><model_file>model.osim</model_file>
<marker_set_file>Unassigned</marker_set_file></GenericModelMaker>
<ModelScaler><apply>true</apply><scaling_order>measurements</scaling_order>
<MeasurementSet><objects><Measurement name="thigh"><apply>true</apply>
<MarkerPairSet><objects><MarkerPair><markers>left_hip left_knee</markers>\
</MarkerPair></objects></MarkerPairSet>
<BodyScaleSet><objects><BodyScale name="lfemur"><axes>X Y Z</axes>\
</BodyScale></objects></BodyScaleSet>
</Measurement></objects></MeasurementSet>
<marker_file>track.trc</marker_file><time_range>{start} {stop}</time_range>
<output_model_file>scaled.osim</output_model_file></ModelScaler>
<MarkerPlacer><apply>true</apply><IKTaskSet><objects>{tasks}</objects></IKTaskSet>
<marker_file>track.trc</marker_file><time_range>{start} {stop}</time_range>
<output_model_file>placed.osim</output_model_file></MarkerPlacer></ScaleTool>\
</OpenSimDocument>"""


class NotOfferedError(Exception):
    """A program has nothing for this kind of track."""


class Expected:
    """The content that the files of a track should have."""

    def __init__(self) -> None:
        stored = json.loads(Path(EXPECTED).read_text())
        self.joints = np.array(stored["joints"])  # (T, 27, 3) metres
        self.times = np.array(stored["times"])  # (T,) seconds
        self.held = np.array(stored["held"])  # (T,)
        self.places: list[str] = stored["places"]
        self.fps = float(stored["fps"])
        self.first = int(stored["first"])

    @property
    def known(self) -> Any:
        """The rows of frames that were not held."""
        return np.flatnonzero(~self.held)


def same(name: str, values: Any, expected: Any, tolerance: float) -> None:
    """Raise ValueError if values differ from the expected ones."""
    values = np.asarray(values, dtype=float)
    expected = np.asarray(expected, dtype=float)
    if values.shape != expected.shape:
        raise ValueError(f"{name}: {values.shape}, not {expected.shape}")
    if (np.isnan(values) != np.isnan(expected)).any():
        raise ValueError(f"{name}: {np.isnan(values).sum()} unknown")
    if values.size and not np.isnan(values).all():
        off = float(np.nanmax(np.abs(values - expected)))
        if off > tolerance:
            raise ValueError(f"{name}: {off:.3g} off")


def blanked(expected: Expected) -> Any:
    """Return the joints (T, 27, 3), NaN in frames that were held."""
    joints = expected.joints.copy()
    joints[expected.held] = np.nan
    return joints


# ---- programs; each check reads one file and compares it with the expected content


def opensim_markers(expected: Expected) -> None:
    opensim = importlib.import_module("opensim")
    table = opensim.TimeSeriesTableVec3("track.trc")
    rows = range(table.getNumRows())
    points = [
        [table.getRowAtIndex(k)[marker].to_numpy() for marker in range(27)]
        for k in rows
    ]
    known = expected.known
    same("times", table.getIndependentColumn(), expected.times[known], SECONDS)
    same("points", points, expected.joints[known], METRES)
    data = opensim.MarkerData("track.trc")
    same("rate", data.getDataRate(), expected.fps, 1e-9)


def opensim_kinematics(expected: Expected) -> None:
    opensim = importlib.import_module("opensim")
    # Python must not delete the model before the tool
    model = opensim.Model("model.osim")
    tool = opensim.InverseKinematicsTool()
    tool.setModel(model)
    tool.setMarkerDataFileName("track.trc")
    tool.setStartTime(float(expected.times[0]) - SECONDS)
    tool.setEndTime(float(expected.times[-1]) + SECONDS)
    # by default the solver stops with markers up to 2 mm off, if poses jump
    tool.set_accuracy(1e-9)
    tool.setOutputMotionFileName("inverse.mot")
    tool.run()
    opensim_joints(expected, "inverse.mot", expected.known)


def opensim_motion(expected: Expected) -> None:
    opensim_joints(expected, "track.mot", np.arange(len(expected.times)))


def opensim_joints(expected: Expected, name: str, rows: Any) -> None:
    """Raise ValueError if the model's markers are not at the joints in these rows."""
    opensim = importlib.import_module("opensim")
    model = opensim.Model("model.osim")
    state = model.initSystem()
    table = opensim.TimeSeriesTable(name)
    labels = list(table.getColumnLabels())
    same("times", table.getIndependentColumn(), expected.times[rows], SECONDS)
    found = []
    for k in range(table.getNumRows()):
        values = table.getRowAtIndex(k).to_numpy()
        for label, value in zip(labels, values, strict=True):
            coordinate = model.getCoordinateSet().get(label)
            turns = coordinate.getMotionType() == opensim.Coordinate.Rotational
            coordinate.setValue(state, np.radians(value) if turns else value, False)
        model.realizePosition(state)
        markers = (model.getMarkerSet().get(place) for place in expected.places)
        found.append([each.getLocationInGround(state).to_numpy() for each in markers])
    same("markers", found, expected.joints[rows], METRES)


def opensim_scaling(expected: Expected) -> None:
    opensim = importlib.import_module("opensim")
    times = expected.times[expected.known]
    if len(times) < 2:
        raise NotOfferedError  # it averages over time, and one frame has no duration
    tasks = "".join(map(TASKS.format, expected.places))
    text = SCALING.format(start=times[0] - 1e-6, stop=times[-1] + 1e-6, tasks=tasks)
    Path("scale.xml").write_text(text)
    if not opensim.ScaleTool("scale.xml").run():
        raise ValueError("the tool did not run")
    # Python must not delete the models before their parts
    models = [opensim.Model(name) for name in ("model.osim", "scaled.osim")]
    before, after = (
        model.getMarkerSet().get("left_knee").get_location().to_numpy()
        for model in models
    )
    same("thigh", after, before, 1e-5)
    opensim.Model("placed.osim")


def nimble_points(expected: Expected) -> None:
    library = importlib.import_module("nimblephysics_libs._nimblephysics")
    parser = library.biomechanics.OpenSimParser
    # it finds no file by a relative path
    read = parser.loadTRC(os.path.abspath("track.trc"))
    rows = read.markerTimesteps
    points = [[markers[name] for name in expected.places] for markers in rows]
    known = expected.known
    same("points", points, expected.joints[known], METRES)
    same("times", read.timestamps, expected.times[known], SECONDS)


def ezc3d_points(expected: Expected) -> None:
    read = importlib.import_module("ezc3d").c3d("track.c3d")
    points = read["data"]["points"][:3].transpose(2, 1, 0) / 1e3
    same("points", points, blanked(expected), METRES)
    header = read["header"]["points"]
    same("rate", header["frame_rate"], expected.fps, 1e-5 * expected.fps)
    same("first frame", header["first_frame"], expected.first, 0)


def c3d_points(expected: Expected) -> None:
    with Path("track.c3d").open("rb") as file:
        reader = importlib.import_module("c3d").Reader(file)
        rate = reader.point_rate
        frames = list(reader.read_frames())
    points = np.array([points for _, points, _ in frames])
    metres = np.where(points[:, :, 3:4] < 0.0, np.nan, points[:, :, :3] / 1e3)
    same("points", metres, blanked(expected), METRES)
    same("rate", rate, expected.fps, 1e-5 * expected.fps)
    same("first frame", frames[0][0], expected.first + 1, 0)


def kineticstoolkit_points(expected: Expected) -> None:
    read = importlib.import_module("kineticstoolkit.lab").read_c3d("track.c3d")
    series = read["Points"]
    points = np.stack([series.data[name] for name in expected.places], axis=1)
    same("points", points[:, :, :3], blanked(expected), METRES)
    same("times", series.time, expected.times, 1e-6)


def pyomeca_points(expected: Expected) -> None:
    markers = importlib.import_module("pyomeca").Markers.from_c3d("track.c3d")
    points = markers.values[:3].transpose(2, 1, 0) / 1e3
    same("points", points, blanked(expected), METRES)
    # its times start at the first frame of the file
    times = markers.time.values + markers.attrs["first_frame"] / markers.attrs["rate"]
    same("times", times, expected.times, 1e-6)


def trc_points(expected: Expected) -> None:
    data = importlib.import_module("trc").TRCData()
    data.load("track.trc")
    points = np.stack([data[name] for name in expected.places], axis=1)
    known = expected.known
    same("points", points, expected.joints[known], METRES)
    same("times", data["Time"], expected.times[known], SECONDS)
    same("numbers", data["Frame#"], expected.first + known + 1, 0)


def bvhio_joints(expected: Expected) -> None:
    bvhio = importlib.import_module("bvhio")
    head = bvhio.readAsBvh("track.bvh")
    same("rate", 1.0 / head.FrameTime, expected.fps, 1e-6 * expected.fps)
    root = bvhio.readAsHierarchy("track.bvh")
    knees = []
    for k in range(head.FrameCount):
        root.loadPose(k)
        knees.append(list(root.filter("LeftLeg")[0].PositionWorld))
    same("knees", knees, expected.joints[:, knee(expected)], BONE_METRES)


def pymotion_joints(expected: Expected) -> None:
    reader = importlib.import_module("pymotion.io.bvh").BVH()
    reader.load("track.bvh")
    kinematics = importlib.import_module("pymotion.ops.skeleton")
    turns, places, parents, offsets, _, _ = reader.get_data()
    joints, _ = kinematics.fk(turns, places[:, 0], offsets, parents)
    names = list(reader.data["names"])
    knees = joints[:, names.index("LeftLeg")]
    same("knees", knees, expected.joints[:, knee(expected)], BONE_METRES)
    same("rate", 1.0 / reader.data["frame_time"], expected.fps, 1e-6 * expected.fps)


def pybvh_joints(expected: Expected) -> None:
    read = importlib.import_module("pybvh").read_bvh_file("track.bvh", world_up="+y")
    knees = read.node_positions()[:, read.node_index["LeftLeg"]]
    same("knees", knees, expected.joints[:, knee(expected)], BONE_METRES)
    same("rate", 1.0 / read.frame_time, expected.fps, 1e-6 * expected.fps)


def trimesh_body(_: Expected) -> None:
    scene = importlib.import_module("trimesh").load("track.glb")
    if scene.graph.transforms.parents["LeftLeg"] != "LeftUpLeg":
        raise ValueError("the joints are not a tree")
    # left, right and middle
    same("meshes", len(scene.geometry), 3, 0)
    for mesh in scene.geometry.values():
        if not len(mesh.faces):
            raise ValueError("a mesh without faces")


def pygltflib_times(expected: Expected) -> None:
    document = importlib.import_module("pygltflib").GLTF2().load("track.glb")
    importlib.import_module("pygltflib.validator").validate(document)
    (animation,) = document.animations
    accessor = document.accessors[animation.samplers[0].input]
    view = document.bufferViews[accessor.bufferView]
    content = document.binary_blob()
    times = np.frombuffer(content, "<f4", accessor.count, view.byteOffset)
    same("times", times, expected.times, 1e-6 * max(expected.times[-1], 1.0))


def blender_bones(expected: Expected) -> None:
    bpy = importlib.import_module("bpy")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_anim.bvh(
        filepath=os.path.abspath("track.bvh"), update_scene_fps=True
    )
    scene = bpy.context.scene
    armature = bpy.context.object
    rate = scene.render.fps / scene.render.fps_base
    same("rate", rate, expected.fps, 1e-6 * expected.fps)
    knees = []
    for k in range(len(expected.times)):
        scene.frame_set(k + 1)
        knees.append(armature.matrix_world @ armature.pose.bones["LeftLeg"].head)
    same("knees", y_up(knees), expected.joints[:, knee(expected)], BONE_METRES)


def blender_armature(expected: Expected) -> None:
    bpy = importlib.import_module("bpy")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=os.path.abspath("track.glb"))
    scene = bpy.context.scene
    (armature,) = [each for each in bpy.data.objects if each.type == "ARMATURE"]
    (skin,) = [each.type for each in bpy.data.objects["body"].modifiers]
    same("armature of the skin", float(skin == "ARMATURE"), 1.0, 0.0)
    # the joints, and the ends of the five last bones
    same("bones", len(armature.data.bones), len(expected.places) + 5, 0)
    rate = scene.render.fps / scene.render.fps_base
    spanned = np.array(armature.animation_data.action.frame_range) / rate
    same("length", spanned, expected.times[[0, -1]], 1e-5)
    knees = []
    for seconds in expected.times:
        whole, part = divmod(float(seconds) * rate, 1.0)
        scene.frame_set(int(whole), subframe=part)
        knees.append(armature.matrix_world @ armature.pose.bones["LeftLeg"].head)
    same("knees", y_up(knees), expected.joints[:, knee(expected)], BONE_METRES)


def av_frames(expected: Expected) -> None:
    with importlib.import_module("av").open("overlay.mp4") as video:
        frames = list(video.decode(video=0))
        rate = float(video.streams.video[0].average_rate)
    same("frames", len(frames), len(expected.times), 0)
    # a single frame has no meaningful rate
    if len(frames) > 1:
        same("rate", rate, expected.fps, 0.006)


def pandas_tables(expected: Expected) -> None:
    pandas = importlib.import_module("pandas")
    table = pandas.read_csv("frames.csv")
    columns = [f"{place}_{axis}" for place in expected.places for axis in "xyz"]
    points = table[columns].to_numpy().reshape(-1, 27, 3)
    same("points", points, blanked(expected), METRES)
    same("times", table["seconds"], expected.times, SECONDS)
    angles = pandas.read_csv("angles.csv")
    same("times", angles["seconds"], expected.times, SECONDS)
    unknown = angles["left_knee_flexion"].isna()
    same("blank", unknown, expected.held, 0)


def y_up(points: Any) -> Any:
    """Return Blender's points (n, 3), with z up, in posefit's axes."""
    x, y, z = np.array([list(point) for point in points]).T
    return np.column_stack([x, z, -y])


def knee(expected: Expected) -> int:
    """Return the number of the left knee."""
    return expected.places.index("left_knee")


Check = Callable[[Expected], None]
PROGRAMS: dict[str, dict[str, Check]] = {
    "opensim": {
        "track.trc": opensim_markers,
        "track.trc, inverse kinematics": opensim_kinematics,
        "track.trc, scaling": opensim_scaling,
        "track.mot and model.osim": opensim_motion,
    },
    "trc-data-reader": {"track.trc": trc_points},
    "nimblephysics": {"track.trc": nimble_points},
    "ezc3d": {"track.c3d": ezc3d_points},
    "c3d": {"track.c3d": c3d_points},
    "kineticstoolkit": {"track.c3d": kineticstoolkit_points},
    "pyomeca": {"track.c3d": pyomeca_points},
    "bvhio": {"track.bvh": bvhio_joints},
    "upc-pymotion": {"track.bvh": pymotion_joints},
    "pybvh": {"track.bvh": pybvh_joints},
    "bpy": {"track.bvh": blender_bones, "track.glb": blender_armature},
    "trimesh": {"track.glb": trimesh_body},
    "pygltflib": {"track.glb": pygltflib_times},
    "av": {"overlay.mp4": av_frames},
    "pandas": {"frames.csv and angles.csv": pandas_tables},
}
# in programs_read.mjs
NODE_PROGRAMS: dict[str, list[str]] = {
    "gltf-validator": ["track.glb"],
    "three": ["track.glb", "track.bvh", "track.glb on the joints of track.bvh"],
}


def results(program: str) -> Iterator[tuple[str, str]]:
    """Yield each file that a program reads, and an error, nothing, or a dash."""
    expected = Expected()
    for name, check in PROGRAMS[program].items():
        try:
            check(expected)
        except NotOfferedError:
            yield name, NOT_OFFERED
        except Exception as error:
            yield name, f"{type(error).__name__}: {' '.join(str(error).split())[:200]}"
        else:
            yield name, ""


if __name__ == "__main__":
    os.chdir(sys.argv[2])
    for file, words in results(sys.argv[1]):
        # programs print text as well
        print("\n" + json.dumps(["result", file, words]), flush=True)
