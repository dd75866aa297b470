// Positions of all joints and end sites of a BVH file as three.js has them, as JSON.
// usage: node read_with_three.mjs MODULES file.bvh out.json, MODULES the folder that three is installed in
import { readFileSync, writeFileSync } from "node:fs";
import { resolve } from "node:path";
import { pathToFileURL } from "node:url";

const load = (file) => import(pathToFileURL(resolve(process.argv[2], "node_modules/three", file)).href);
const THREE = await load("build/three.module.js");
const { BVHLoader } = await load("examples/jsm/loaders/BVHLoader.js");

const { skeleton, clip } = new BVHLoader().parse(readFileSync(process.argv[3], "utf-8"));
const mixer = new THREE.AnimationMixer(skeleton.bones[0]);
mixer.clipAction(clip).play();
const times = clip.tracks[0].times;
const found = { frame_time_s: times.length > 1 ? times[1] - times[0] : 0, joints: {}, ends: {} };
const place = new THREE.Vector3();
times.forEach((time, frame) => {
  // a clip loops at its end, so the last frame is taken just before it
  mixer.setTime(frame === times.length - 1 ? Math.max(time - 1e-9, 0) : time);
  skeleton.bones[0].updateMatrixWorld(true);
  for (const bone of skeleton.bones) {
    bone.getWorldPosition(place);
    const end = bone.name === "ENDSITE";
    const series = end ? found.ends : found.joints;
    (series[end ? bone.parent.name : bone.name] ??= []).push([place.x, place.y, place.z]);
  }
});
writeFileSync(process.argv[4], JSON.stringify(found));
