// What three.js makes of a GLB file, as JSON on stdout.
// usage: node read_glb.mjs MODULES FILE.glb, MODULES the folder with three and gltf-validator
//
// { clips: { NAME: { times, joints: { HAND: { JOINT: [[x, y, z], ... a key] } } } },
//   bodies: { NAME: [[x, y, z], ... a vertex] at the last key of the last clip }, errors, warnings, infos }
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join, resolve } from "node:path";
import { pathToFileURL } from "node:url";

globalThis.self = globalThis; // the loader expects a browser's name for it
const [modules, file] = process.argv.slice(2).map((path) => resolve(path));
const load = (path) => import(pathToFileURL(join(modules, "three", path)).href);
const THREE = await load("build/three.module.js");
const { GLTFLoader } = await load("examples/jsm/loaders/GLTFLoader.js");
const validator = createRequire(import.meta.url)(join(modules, "gltf-validator"));

const bytes = readFileSync(file);
const { issues } = await validator.validateBytes(new Uint8Array(bytes), { maxIssues: 0 });
const buffer = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
const { scene, animations } = await new GLTFLoader().parseAsync(buffer, "");

const name = (object) => object.userData.name; // as in the file; object.name is made unique
const roots = scene.children.filter((child) => !child.isMesh && child.children.some((below) => below.isBone));
const place = new THREE.Vector3();
const clips = {};
for (const clip of animations) {
  const mixer = new THREE.AnimationMixer(scene);
  const action = mixer.clipAction(clip).setLoop(THREE.LoopOnce);
  action.clampWhenFinished = true;
  action.play();
  const times = [...new Set(clip.tracks.flatMap((track) => [...track.times]))].sort((a, b) => a - b);
  const joints = Object.fromEntries(roots.map((root) => [name(root), {}]));
  for (const time of times) {
    mixer.setTime(time);
    scene.updateMatrixWorld(true);
    for (const root of roots) {
      root.traverse((bone) => {
        if (bone.isBone) {
          bone.getWorldPosition(place);
          (joints[name(root)][name(bone)] ??= []).push(place.toArray());
        }
      });
    }
  }
  clips[clip.name] = { times, joints };
}
const bodies = {};
scene.traverse((mesh) => {
  if (!mesh.isSkinnedMesh) return;
  const found = [];
  for (let vertex = 0; vertex < mesh.geometry.attributes.position.count; vertex++) {
    found.push(mesh.localToWorld(mesh.getVertexPosition(vertex, place)).toArray());
  }
  bodies[mesh.name] = found;
});
const { numErrors, numWarnings, numInfos, messages } = issues;
process.stdout.write(
  JSON.stringify({ clips, bodies, errors: numErrors, warnings: numWarnings, infos: numInfos, messages }),
);
