/** The robot as objects of three.js: one group per link, moved by joint positions. */

import { get } from "../api.js";

/** @typedef {import("../libraries/load.js").Libraries} Libraries */
/** @typedef {import("three").Object3D} Object3D */
/** @typedef {import("three").Mesh} Mesh */
/** @typedef {[number, number, number]} Vector */

/**
 * @typedef {object} Joint
 * @property {string} name
 * @property {"revolute" | "continuous" | "prismatic" | "fixed"} type
 * @property {"rad" | "m"} unit
 * @property {string} parent
 * @property {string} child
 * @property {Vector} xyz
 * @property {Vector} rpy
 * @property {Vector} axis
 * @property {number[]} limits smallest and largest position, without infinite ones [rad or m]
 * @property {[string, number, number] | null} mimic joint, factor and offset
 */

/**
 * @typedef {object} Shape
 * @property {string} link
 * @property {"box" | "sphere" | "cylinder" | "mesh"} kind
 * @property {number[]} sizes
 * @property {string} mesh digest
 * @property {Vector} xyz
 * @property {Vector} rpy
 * @property {[number, number, number, number] | null} color
 */

/**
 * @typedef {object} Robot What the server answers at `/api/robot`.
 * @property {string} name
 * @property {string[]} links
 * @property {Joint[]} joints
 * @property {Shape[]} shapes
 * @property {Record<string, string[]>} groups joints by group
 * @property {{ link: string, offset: Vector } | null} tool
 */

const FAILURE = 0xc8281e;
const FAILURE_EDGE = 0x4d0a06;
const BESIDE_FAILURE = 0xa8aeb4; // colour of unmarked links, so that the red ones stand out
const SHARPEST = 25; // largest angle between two faces without a drawn edge [deg]
const DEFAULT_COLOR = /** @type {const} */ ([0.7, 0.72, 0.75, 1]);

/** A robot that can be posed. */
export class ArmModel {
  /** @type {Object3D} */
  root;
  /** @type {Map<string, Object3D>} by name of the link */
  links = new Map();
  /** @type {{ link: string, material: import("three").MeshStandardMaterial, mesh: Mesh | null }[]} */
  #parts = [];
  /** @type {Set<string>} links in the colour of failure */
  #marked = new Set();
  /** @type {{ joint: Joint, object: Object3D }[]} */
  #joints = [];
  #three;
  #robot;
  #opacity;

  /**
   * @param {Libraries} three
   * @param {Robot} robot
   * @param {() => void} changed called when a mesh was loaded
   * @param {number} [opacity]
   */
  constructor(three, robot, changed, opacity = 1) {
    this.#three = three;
    this.#robot = robot;
    this.#opacity = opacity;
    this.root = new three.Group();
    for (const link of robot.links) this.links.set(link, new three.Group());
    for (const joint of robot.joints) this.#addJoint(joint);
    for (const link of this.links.values()) if (!link.parent) this.root.add(link);
    for (const shape of robot.shapes) this.#addShape(shape, changed);
  }

  /**
   * Move the joints.
   * @param {Record<string, number>} positions by joint [rad or m]; all other joints are at 0
   */
  setPose(positions) {
    for (const { joint, object } of this.#joints) {
      const [leader, factor, offset] = joint.mimic ?? [joint.name, 1, 0];
      const value = factor * (positions[leader] ?? 0) + offset;
      const axis = new this.#three.Vector3(...joint.axis).normalize();
      if (joint.type === "prismatic") object.position.copy(axis).multiplyScalar(value);
      else object.quaternion.setFromAxisAngle(axis, value);
    }
    this.root.updateMatrixWorld(true);
  }

  /**
   * Return the position of the tool in a pose, or of the last link if the robot has no tool [m].
   * @param {Record<string, number>} positions
   * @returns {import("three").Vector3}
   */
  toolAt(positions) {
    this.setPose(positions);
    const link = this.#robot.tool?.link ?? this.#robot.links.at(-1) ?? "";
    const offset = new this.#three.Vector3(...(this.#robot.tool?.offset ?? [0, 0, 0]));
    return this.links.get(link)?.localToWorld(offset) ?? offset;
  }

  /**
   * Draw some links in the colour of failure with their edges, and the others grey.
   * @param {Set<string>} links empty to restore the robot's own colours
   */
  mark(links) {
    this.#marked = links;
    for (const { link, material, mesh } of this.#parts) {
      const marked = links.has(link);
      if (links.size) material.color.set(marked ? FAILURE : BESIDE_FAILURE);
      else material.color.copy(material.userData.color);
      const [edges] = mesh?.children ?? [];
      if (edges) edges.visible = marked;
      else if (marked && mesh) mesh.add(this.#edgesOf(mesh));
    }
  }

  /** @param {Mesh} mesh */
  #edgesOf({ geometry }) {
    const three = this.#three;
    const line = new three.LineBasicMaterial({ color: FAILURE_EDGE, depthTest: false }); // shows edges behind other links
    return new three.LineSegments(new three.EdgesGeometry(geometry, SHARPEST), line);
  }

  /** @param {Joint} joint */
  #addJoint(joint) {
    const frame = new this.#three.Group();
    place(frame, joint);
    const moved = new this.#three.Group();
    frame.add(moved);
    this.links.get(joint.parent)?.add(frame);
    const child = this.links.get(joint.child);
    if (child) moved.add(child);
    if (joint.type !== "fixed") this.#joints.push({ joint, object: moved });
  }

  /**
   * @param {Shape} shape
   * @param {() => void} changed
   */
  #addShape(shape, changed) {
    const [r, g, b, a] = shape.color ?? DEFAULT_COLOR;
    const opacity = a * this.#opacity;
    const material = new this.#three.MeshStandardMaterial({
      color: new this.#three.Color().setRGB(r, g, b, "srgb"),
      opacity,
      transparent: opacity < 1,
      roughness: 0.75,
      // At the same place as the arm, a faint ghost is drawn behind it, and a refused goal in front.
      polygonOffset: this.#opacity < 1,
      polygonOffsetFactor: this.#opacity < 0.5 ? 2 : -2,
      polygonOffsetUnits: this.#opacity < 0.5 ? 2 : -2,
    });
    material.userData.color = material.color.clone();
    const part = { link: shape.link, material, mesh: /** @type {Mesh | null} */ (null) };
    this.#parts.push(part);
    /** @param {import("three").BufferGeometry} geometry */
    const add = (geometry) => {
      const mesh = new this.#three.Mesh(geometry, material);
      mesh.castShadow = mesh.receiveShadow = this.#opacity === 1;
      if (shape.kind === "mesh") mesh.scale.set(shape.sizes[0], shape.sizes[1], shape.sizes[2]);
      const frame = new this.#three.Group();
      place(frame, shape);
      frame.add(mesh);
      this.links.get(shape.link)?.add(frame);
      part.mesh = mesh;
      this.mark(this.#marked);
    };
    if (shape.kind !== "mesh") return add(primitive(this.#three, shape.kind, shape.sizes));
    loadMesh(this.#three, shape.mesh).then((geometry) => {
      if (geometry) add(geometry);
      changed();
    });
  }
}

/**
 * Return the geometry of a simple shape, with cylinders along z as in a URDF.
 * @param {Libraries} three
 * @param {"box" | "sphere" | "cylinder"} kind
 * @param {number[]} sizes
 */
export function primitive(three, kind, sizes) {
  if (kind === "box") return new three.BoxGeometry(sizes[0], sizes[1], sizes[2]);
  if (kind === "sphere") return new three.SphereGeometry(sizes[0], 32, 16);
  return new three.CylinderGeometry(sizes[0], sizes[0], sizes[1], 40).rotateX(Math.PI / 2);
}

/** @type {Map<string, Promise<import("three").BufferGeometry | null>>} */
const meshes = new Map();

/**
 * @param {Libraries} three
 * @param {string} digest
 * @returns {Promise<import("three").BufferGeometry | null>} null if it is not an STL file
 */
export function loadMesh(three, digest) {
  const known = meshes.get(digest);
  if (known) return known;
  const loaded = get(`api/meshes/${encodeURIComponent(digest)}`, null, "arrayBuffer")
    .then((data) => (isStl(data) ? new three.STLLoader().parse(data) : null))
    .catch(() => null);
  meshes.set(digest, loaded);
  return loaded;
}

/**
 * Return true for binary STL data of the right length, and for data that begins like a text STL file.
 * @param {ArrayBuffer} data
 */
function isStl(data) {
  if (data.byteLength >= 84 && new DataView(data).getUint32(80, true) * 50 + 84 === data.byteLength) return true;
  return new TextDecoder().decode(data.slice(0, 5)) === "solid";
}

/**
 * Place an object as a URDF does: rotations about fixed x, y and z, in this order.
 * @param {Object3D} object
 * @param {{ xyz: Vector, rpy: Vector }} origin
 */
function place(object, { xyz, rpy }) {
  object.position.set(...xyz);
  object.rotation.set(...rpy, "ZYX");
}
