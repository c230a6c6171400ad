"""BVH files against forward kinematics done slowly from the file's own definition."""

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.skeleton import JOINTS, PARENTS
from posefit.motion import built_in, bvh
from posefit.motion.bvh import NAMES, read_bvh, write_bvh
from tests.cases import each
from tests.geometry.turns import about

pytest.importorskip("pybvh")

TREE = [(name, NAMES[name], JOINTS[above] if above >= 0 else "-") for name, above in zip(JOINTS, PARENTS, strict=True)]
ORDERS = ("ZYX", "ZXY", "XYZ", "YZX")


@dataclass
class Node:
    name: str
    offset: Array
    order: str
    children: list["Node"] = field(default_factory=list)
    tip: Array | None = None  # End Site


def build(names: str) -> tuple[Node, dict[str, Node]]:
    """Return a BVH tree with random bones, where the BVH joint of a bone sits at the bone's start."""
    rng = np.random.default_rng(5)
    vectors = {bone: np.round(rng.normal(size=3), 5) for bone, _, _ in TREE}
    vectors["root"] = np.zeros(3)
    nodes: dict[str, Node] = {}
    for k, (bone, cgspeed, parent) in enumerate(TREE):
        name = cgspeed if names == "cgspeed" else bone
        nodes[bone] = Node(name, vectors.get(parent, np.zeros(3)), ORDERS[k % len(ORDERS)])
        if parent != "-":
            nodes[parent].children.append(nodes[bone])
    for bone, node in nodes.items():
        if not node.children:
            node.tip = vectors[bone]
    # as in the real files: fingers go on from the hand, a thumb hangs beside it
    fingers = Node("LeftHandIndex1", vectors["lhand"], "ZYX", tip=np.ones(3))
    nodes["lhand"].children, nodes["lhand"].tip = [fingers], None
    nodes["lwrist"].children.append(Node("LThumb", np.zeros(3), "ZYX", tip=np.ones(3)))
    return nodes["root"], nodes


def in_order(node: Node) -> list[Node]:
    return [node, *(below for child in node.children for below in in_order(child))]


def spaced(values: Array) -> str:
    return " ".join(f"{value:.5f}" for value in values)


def hierarchy(node: Node, word: str = "ROOT") -> str:
    channels = " ".join(f"{axis}rotation" for axis in node.order)
    channels = f"6 Xposition Yposition Zposition {channels}" if word == "ROOT" else f"3 {channels}"
    inside = "".join(hierarchy(child, "JOINT") for child in node.children)
    if node.tip is not None:
        inside += f"End Site\n{{\nOFFSET {spaced(node.tip)}\n}}\n"
    return f"{word} {node.name}\n{{\nOFFSET {spaced(node.offset)}\nCHANNELS {channels}\n{inside}}}\n"


def written(folder: Path, root: Node, values: Array) -> Path:
    motion = "\n".join(spaced(row) for row in values)
    head = f"HIERARCHY\n{hierarchy(root)}MOTION\nFrames: {len(values)}\nFrame Time: 0.0083333\n"
    (folder / "x.bvh").write_text(f"{head}{motion}\n")
    return folder / "x.bvh"


def tips(root: Node, nodes: dict[str, Node], row: Array) -> Array:
    """Return where each of the 27 bones ends, from the definition of BVH. End bones do not turn by themselves."""
    values = {id(node): row[3 + 3 * k : 6 + 3 * k] for k, node in enumerate(in_order(root))}
    starts: dict[int, Array] = {}
    frames: dict[int, Array] = {}

    def visit(node: Node, start: Array, frame: Array) -> None:
        starts[id(node)] = start
        turning = frame
        for axis, degrees in zip(node.order, values[id(node)], strict=True):
            turning = turning @ about("XYZ".index(axis), np.radians(degrees))
        ends = ("ltoes", "rtoes", "head", "lhand", "rhand")
        frames[id(node)] = frame if any(node is nodes[bone] for bone in ends) else turning
        for child in node.children:
            visit(child, start + turning @ child.offset, turning)

    visit(root, row[:3], np.eye(3))
    joints = [row[:3]]
    for bone, _, _ in TREE[1:]:
        node = nodes[bone]
        vector = node.tip if node.tip is not None else node.children[0].offset
        joints.append(starts[id(node)] + frames[id(node)] @ vector)
    return np.array(joints)


def random_values(root: Node, frames: int = 6) -> Array:
    rng = np.random.default_rng(8)
    return np.round(rng.uniform(-80.0, 80.0, (frames, 3 + 3 * len(in_order(root)))), 5)


@each("names", ["cgspeed", "acclaim"])
def test_joints_are_where_the_file_puts_them(tmp_path: Path, names: str) -> None:
    root, nodes = build(names)
    values = random_values(root)
    motion = read_bvh(written(tmp_path, root, values), metres_per_unit=0.01)
    expected = 0.01 * np.array([tips(root, nodes, row) for row in values])
    np.testing.assert_allclose(motion.skeleton.joints(motion.poses, motion.translations), expected, atol=1e-9)
    assert (motion.name, len(motion)) == ("x", 6)
    assert motion.fps == pytest.approx(120.0, rel=1e-5)


@each(
    ("before", "after", "message"),
    [
        ("JOINT LeftLeg", "JOINT Knee", r"with all 27 joints, got one without ltibia \(LeftLeg\)"),
        ("ROOT Hips", "ROOT Hip", r"without root \(Hips\)"),
        ("Frames: 6", "Frames: 7", "cannot read: BVH declares 7 frames"),
        ("Frame Time: 0.0083333", "Frame Time: -1", "cannot read: frame_time must be >= 0"),
        ("Frame Time: 0.0083333", "Frame Time: nan", "x.bvh: expected"),
        ("OFFSET", "OFFSET nan", "x.bvh: expected"),
    ],
)
def test_mistakes_name_the_file(tmp_path: Path, before: str, after: str, message: str) -> None:
    root, _ = build("cgspeed")
    path = written(tmp_path, root, random_values(root))
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after, 1))
    with pytest.raises(ValueError, match=message) as caught:
        read_bvh(path)
    assert str(path) in str(caught.value)


def test_a_tree_of_another_kind_is_refused(tmp_path: Path) -> None:
    root, nodes = build("cgspeed")
    nodes["rclavicle"].offset = nodes["rclavicle"].offset + [0.0, 0.1, 0.0]
    with pytest.raises(ValueError, match=r"x\.bvh: expected joint 'RightShoulder' at OFFSET"):
        read_bvh(written(tmp_path, root, random_values(root)))
    nodes["rclavicle"].name, nodes["lfemur"].name = "LeftUpLeg", "RightShoulder"
    with pytest.raises(ValueError, match="expected joint 'LeftUpLeg' right under 'LHipJoint', got it under 'Spine1'"):
        read_bvh(written(tmp_path, root, random_values(root)))


def test_without_the_library_the_way_out_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "pybvh", None)
    with pytest.raises(ImportError, match=r"pip install posefit\[bvh\]"):
        read_bvh(tmp_path / "x.bvh")


def test_what_comes_out_of_a_file_has_a_limit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.bvh"
    write_bvh(path, built_in.motion("walk", frames=6))
    text = path.read_text()
    # 30 frames of 70,000,000 s were 2.1e9 at 30 a second
    path.write_text(re.sub("Frame Time: .*", "Frame Time: 70000000", text))
    with pytest.raises(ValueError, match=r"a.bvh: expected a positive frame time, 0.0001 to 10 s, got 7e\+07"):
        read_bvh(path)
    path.write_text(text)
    monkeypatch.setattr(bvh, "LONGEST", 5)
    with pytest.raises(ValueError, match="a.bvh:.*: expected at most 5 frames and 20000000 numbers, got more"):
        read_bvh(path)
    monkeypatch.setattr(bvh, "NODES", 20)
    with pytest.raises(ValueError, match="a.bvh:.*: expected at most 20 joints and ends, got more"):
        read_bvh(path)
