// Reads the files of a track in JavaScript, for programs.py.
//
//     node programs_read.mjs PROGRAM FOLDER
//
// It prints the lines of programs_read.py. The program's packages are in node_modules
// in the script's folder.

import fs from "node:fs";
import path from "node:path";

const METRES = 1e-4;
const SECONDS = 1e-5;

const [program, folder] = process.argv.slice(2);
const file = (name) => path.join(folder, name);
const expected = JSON.parse(fs.readFileSync(file("expected.json"), "utf8"));

/** Throw an error if numbers differ from the expected ones. */
function same(name, values, wanted, tolerance) {
  if (values.length !== wanted.length) {
    throw new Error(`${name}: ${values.length}, not ${wanted.length}`);
  }
  const off = Math.max(...values.map((value, k) => Math.abs(value - wanted[k])));
  if (!(off <= tolerance)) {
    throw new Error(`${name}: ${off} off`);
  }
}

/** Read a .glb or .bvh file, and return its root, its animation and their library. */
async function read(name) {
  const THREE = await import("three");
  if (name.endsWith(".bvh")) {
    const { BVHLoader } = await import("three/examples/jsm/loaders/BVHLoader.js");
    const text = fs.readFileSync(file(name), "utf8");
    const { skeleton, clip } = new BVHLoader().parse(text);
    return { THREE, root: skeleton.bones[0], clip };
  }
  // the loader is made for browsers
  globalThis.self = globalThis;
  const { GLTFLoader } = await import("three/examples/jsm/loaders/GLTFLoader.js");
  const bytes = new Uint8Array(fs.readFileSync(file(name)));
  const { scene, animations } = await new GLTFLoader().parseAsync(bytes.buffer, "");
  return { THREE, root: scene, clip: animations[0] };
}

/** Compare the left knee in each frame of an animation, which starts at some time. */
function sameKnees(THREE, root, clip, start) {
  const mixer = new THREE.AnimationMixer(root);
  const action = mixer.clipAction(clip);
  action.setLoop(THREE.LoopOnce);
  action.clampWhenFinished = true;
  action.play();
  const knee = root.getObjectByName("LeftLeg");
  const number = expected.places.indexOf("left_knee");
  expected.times.forEach((seconds, k) => {
    mixer.setTime(seconds - start);
    root.updateMatrixWorld(true);
    const place = knee.getWorldPosition(new THREE.Vector3());
    same(`knee in row ${k}`, place.toArray(), expected.joints[k][number], METRES);
  });
}

async function validatorFindsNothing() {
  const { default: validator } = await import("gltf-validator");
  const bytes = new Uint8Array(fs.readFileSync(file("track.glb")));
  const { issues } = await validator.validateBytes(bytes);
  if (issues.messages.length) {
    throw new Error(JSON.stringify(issues.messages));
  }
}

async function threeBody() {
  const { THREE, root, clip } = await read("track.glb");
  same("times", [...clip.tracks[0].times], expected.times, SECONDS);
  sameKnees(THREE, root, clip, 0.0);
}

async function threeJoints() {
  const { THREE, root, clip } = await read("track.bvh");
  // the file does not say when the motion starts
  const start = expected.times[0];
  same("times", [...clip.tracks[0].times], expected.times.map((t) => t - start), SECONDS);
  sameKnees(THREE, root, clip, start);
}

async function threeRetargeted() {
  const { clip } = await read("track.glb");
  const { THREE, root } = await read("track.bvh");
  sameKnees(THREE, root, clip, 0.0);
}

const PROGRAMS = {
  "gltf-validator": { "track.glb": validatorFindsNothing },
  three: {
    "track.glb": threeBody,
    "track.bvh": threeJoints,
    "track.glb on the joints of track.bvh": threeRetargeted,
  },
};

for (const [name, check] of Object.entries(PROGRAMS[program])) {
  let wrong = "";
  try {
    await check();
  } catch (error) {
    wrong = String(error).slice(0, 200);
  }
  console.log("\n" + JSON.stringify(["result", name, wrong]));
}
