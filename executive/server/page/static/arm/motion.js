/** Draws around the arm: the path of the tool, the frames on it, and bodies. */

import { loadMesh, primitive } from "./model.js";

/** @typedef {import("../libraries/load.js").Libraries} Libraries */
/** @typedef {import("./model.js").ArmModel} ArmModel */
/** @typedef {import("../model/run.js").Schedule} Schedule */
/** @typedef {import("../model/run.js").Body} Body */

const MAX_POINTS = 400; // largest number of points of a path

/**
 * Return the path of the tool, with a dot for each frame.
 * @param {Libraries} three
 * @param {ArmModel} model moved to the end of the path
 * @param {Schedule} schedule
 * @param {string} color
 */
export function pathOf(three, model, schedule, color) {
  const joints = Object.keys(schedule.start);
  const step = Math.max(1, Math.ceil(schedule.samples.length / MAX_POINTS));
  const rows = schedule.samples.filter((_, row) => row % step === 0 || row === schedule.samples.length - 1);
  const frames = schedule.times.map((time) => rowAt(schedule, time));
  const dots = points(three, model, joints, thinned(frames));
  const path = points(three, model, joints, rows);
  const group = new three.Group();
  const dot = new three.PointsMaterial({ color, size: 4, sizeAttenuation: false });
  group.add(new three.Line(path, new three.LineBasicMaterial({ color })), new three.Points(dots, dot));
  return group;
}

/**
 * Return the bodies around the arm and in its gripper, each added to its link.
 * @param {Libraries} three
 * @param {ArmModel} model
 * @param {Body[]} world
 * @param {() => void} changed called when a mesh was loaded
 * @returns {import("three").Object3D[]}
 */
export function addBodies(three, model, world, changed) {
  const found = [];
  for (const body of world) {
    const parent = body.link ? model.links.get(body.link) : model.root;
    if (!parent) continue;
    const material = new three.MeshStandardMaterial({ color: 0x7a8791, transparent: true, opacity: 0.55 });
    const mesh = new three.Mesh(undefined, material);
    const { path, scale = [1, 1, 1] } = body.mesh ?? {};
    const geometry = geometryOf(three, body);
    if (geometry) mesh.geometry = geometry;
    else if (path)
      loadMesh(three, path).then((loaded) => {
        if (!loaded) return;
        mesh.geometry = loaded;
        mesh.scale.set(scale[0], scale[1], scale[2]);
        changed();
      });
    mesh.name = body.name;
    mesh.castShadow = true;
    mesh.position.set(...body.position);
    mesh.quaternion.set(...body.rotation);
    parent.add(mesh);
    found.push(mesh);
  }
  return found;
}

/**
 * Return the geometry of a simple shape, or null for a mesh.
 * @param {Libraries} three
 * @param {Body} body
 */
function geometryOf(three, body) {
  if (body.box) return primitive(three, "box", body.box.size);
  if (body.sphere) return primitive(three, "sphere", [body.sphere.radius]);
  if (body.cylinder) return primitive(three, "cylinder", [body.cylinder.radius, body.cylinder.length]);
  return null;
}

/**
 * @param {Libraries} three
 * @param {ArmModel} model
 * @param {string[]} joints
 * @param {number[][]} rows positions by joint
 */
function points(three, model, joints, rows) {
  const found = rows.flatMap((row) =>
    model.toolAt(Object.fromEntries(joints.map((name, index) => [name, row[index]]))).toArray(),
  );
  return new three.BufferGeometry().setAttribute("position", new three.Float32BufferAttribute(found, 3));
}

/**
 * Return the positions at a time.
 * @param {Schedule} schedule
 * @param {number} time from the start of the motion [s]
 */
function rowAt({ sample_times: times, samples }, time) {
  const after = times.findIndex((each) => each >= time);
  if (after <= 0) return samples[after === 0 ? 0 : samples.length - 1];
  const share = (time - times[after - 1]) / (times[after] - times[after - 1]);
  return samples[after].map((value, index) => samples[after - 1][index] * (1 - share) + value * share);
}

/** @param {number[][]} rows @returns {number[][]} at most MAX_POINTS of them */
function thinned(rows) {
  const step = Math.max(1, Math.ceil(rows.length / MAX_POINTS));
  return rows.filter((_, row) => row % step === 0);
}
