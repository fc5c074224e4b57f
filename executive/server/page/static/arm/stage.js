/** Camera, light, floor and canvas. It draws only when something has changed. */

import { oncePerFrame } from "../dom.js";

/** @typedef {import("../libraries/load.js").Libraries} Libraries */

/** Directions of the camera from the middle of the arm, by the name of the view. */
export const VIEWS = /** @type {Record<string, [number, number, number]>} */ ({
  free: [1, -1.2, 0.8],
  front: [1, 0, 0],
  side: [0, -1, 0],
  top: [0, -0.001, 1],
});

const SOFTWARE = /swiftshader|llvmpipe|software|basic render/i;
const PERIOD = 60; // shortest time between two pictures without a graphics card [ms]
const STEEPEST = Math.PI / 2 - 0.001; // largest elevation of the camera [rad]
const MARGIN = 1.1; // factor of the smallest distance that shows everything

/** Shows objects in a canvas. */
export class Stage {
  scene;
  /** Shortest time between two pictures [ms]; 0 with a graphics card. */
  period;
  /** Draw soon. */
  draw = oncePerFrame(
    () => this.#draw(),
    () => this.period,
  );
  #three;
  #box;
  #renderer;
  #camera;
  #controls;
  #floor;
  #size;
  #view = "free";
  #turned = false; // True if the user has turned the camera
  #bounds; // box around all included objects

  /**
   * @param {Libraries} three
   * @param {HTMLElement} box holds the canvas
   * @param {number} size of the robot [m]
   */
  constructor(three, box, size) {
    this.#three = three;
    this.#box = box;
    this.#size = size;
    this.#bounds = new three.Box3();
    this.scene = new three.Scene();
    this.#renderer = new three.WebGLRenderer({ antialias: true, alpha: true });
    // Without a graphics card, 3D would take the processor from the rest of the page, and from the arm.
    const slow = SOFTWARE.test(nameOfRenderer(this.#renderer.getContext()));
    this.period = slow ? PERIOD : 0;
    this.#renderer.setPixelRatio(slow ? 1 : Math.min(window.devicePixelRatio, 2));
    this.#renderer.shadowMap.enabled = !slow;
    this.#renderer.debug.checkShaderErrors = false; // the check would wait for the compiler
    box.prepend(this.#renderer.domElement);
    this.#camera = new three.PerspectiveCamera(35, 1, size / 50, size * 50);
    this.#camera.up.set(0, 0, 1);
    this.#controls = new three.OrbitControls(this.#camera, this.#renderer.domElement);
    this.#controls.addEventListener("change", this.draw);
    this.#controls.addEventListener("start", () => (this.#turned = true));
    this.#addLight();
    this.#floor = new three.Group();
    this.scene.add(this.#floor);
    this.setColors();
    new ResizeObserver(() => this.#resize()).observe(box);
  }

  /**
   * Show objects completely, and all objects that were included before. The camera does not move if
   * the user has turned it.
   * @param {...import("three").Object3D} objects
   */
  include(...objects) {
    const before = this.#bounds.clone();
    for (const object of objects) {
      object.updateMatrixWorld(); // its position in the next picture
      this.#bounds.expandByObject(object);
    }
    if (!this.#turned && !this.#bounds.equals(before)) this.look(this.#view);
  }

  /** Forget all included objects. */
  forget() {
    this.#bounds.makeEmpty();
    this.#turned = false;
  }

  /** @param {string} view one of VIEWS */
  look(view) {
    this.#view = view;
    this.#turned = false;
    const middle = this.#bounds.getCenter(new this.#three.Vector3());
    const direction = new this.#three.Vector3(...VIEWS[view]).normalize();
    this.#controls.target.copy(middle);
    this.#camera.position.copy(middle).add(direction);
    this.#controls.update();
    const distance = MARGIN * this.#distance();
    this.#camera.position.copy(middle).addScaledVector(direction, distance);
    this.#controls.update();
    this.draw();
  }

  /**
   * Turn the camera around the middle, and move it nearer, as the mouse does.
   * @param {number} left [rad]
   * @param {number} up [rad]
   * @param {number} share new distance / old distance
   */
  turn(left, up, share) {
    const { target } = this.#controls;
    const { x, y, z } = this.#camera.position.clone().sub(target);
    const distance = Math.hypot(x, y, z);
    const azimuth = Math.atan2(y, x) - left;
    const elevation = Math.min(Math.max(Math.asin(z / distance) + up, -STEEPEST), STEEPEST);
    const offset = [Math.cos(azimuth), Math.sin(azimuth)].map((part) => part * Math.cos(elevation));
    const direction = new this.#three.Vector3(offset[0], offset[1], Math.sin(elevation));
    this.#camera.position.copy(target).addScaledVector(direction, distance * share);
    this.#turned = true;
    this.#controls.update();
    this.draw();
  }

  /** Return the distance from the middle at which the camera sees all bounds [m]. It must be at 1 m now. */
  #distance() {
    const { min, max } = this.#bounds;
    const vertical = Math.tan((this.#camera.fov * Math.PI) / 360);
    const horizontal = vertical * this.#camera.aspect;
    const corners = [0, 1, 2, 3, 4, 5, 6, 7].map((corner) => {
      const [x, y, z] = [corner & 1 ? max.x : min.x, corner & 2 ? max.y : min.y, corner & 4 ? max.z : min.z];
      const seen = this.#camera.worldToLocal(new this.#three.Vector3(x, y, z));
      return Math.max(Math.abs(seen.x) / horizontal, Math.abs(seen.y) / vertical) + seen.z + 1;
    });
    return this.#bounds.isEmpty() ? 2.6 * this.#size : Math.max(...corners);
  }

  /** Use the colours of the page, which change if the system switches to dark colours. */
  setColors() {
    const three = this.#three;
    const style = getComputedStyle(this.#box);
    this.#floor.clear();
    const cells = 20;
    const grid = new three.GridHelper(this.#size * 4, cells, style.borderTopColor, style.borderTopColor);
    grid.rotateX(Math.PI / 2);
    const shade = new three.Mesh(
      new three.PlaneGeometry(this.#size * 4, this.#size * 4),
      new three.ShadowMaterial({ opacity: 0.18 }),
    );
    shade.receiveShadow = true;
    shade.position.z = -this.#size / 2000;
    this.#floor.add(grid, shade);
    this.draw();
  }

  #addLight() {
    const three = this.#three;
    const sun = new three.DirectionalLight(0xffffff, 2);
    sun.position.set(this.#size, -this.#size * 1.5, this.#size * 3);
    sun.castShadow = true;
    const { camera } = sun.shadow;
    camera.left = camera.bottom = -this.#size * 1.5;
    camera.right = camera.top = this.#size * 1.5;
    camera.far = this.#size * 8;
    sun.shadow.mapSize.set(1024, 1024);
    sun.shadow.normalBias = this.#size / 300;
    this.scene.add(sun, new three.HemisphereLight(0xffffff, 0x8d8d8d, 1.6));
  }

  #resize() {
    const { clientWidth, clientHeight } = this.#box;
    if (!clientWidth || !clientHeight) return;
    this.#renderer.setSize(clientWidth, clientHeight, false);
    this.#camera.aspect = clientWidth / clientHeight;
    this.#camera.updateProjectionMatrix();
    if (!this.#turned) this.look(this.#view);
    this.#draw();
  }

  #draw() {
    this.#renderer.render(this.scene, this.#camera);
  }
}

/** @param {WebGLRenderingContext | WebGL2RenderingContext} context */
function nameOfRenderer(context) {
  const unmasked = context.getExtension("WEBGL_debug_renderer_info")?.UNMASKED_RENDERER_WEBGL;
  return String(context.getParameter(unmasked ?? context.RENDERER));
}
