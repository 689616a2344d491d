// The stage: renderer, two cameras of which one is used, the mouse.  It draws when something has changed, not before.

import * as three from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";

export class NoWebGL extends Error {}

/** How the eye looks: at what, from where (unit vector), upwards, how much is seen (height of the picture). */
export interface Look {
  target: [number, number, number];
  from: [number, number, number];
  up: [number, number, number];
  height: number;
}

const ANGLE = (2 * Math.atan(0.25) * 180) / Math.PI; // the eye is two heights of the picture away

const NO_WEBGL =
  "This browser cannot draw in 3-D: WebGL 2 is missing or switched off. Try another browser, or switch on hardware " +
  "acceleration in its settings; `sand plot` makes pictures without a browser.";

/** Whether the browser draws without a graphics card. */
function drawsSlowly(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const named = context?.getExtension("WEBGL_debug_renderer_info");
  const name = named ? String(context?.getParameter(named.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

export class Stage {
  readonly scene = new three.Scene();
  readonly renderer: three.WebGLRenderer;
  readonly perspective = new three.PerspectiveCamera(ANGLE, 1, 0.1, 1000);
  readonly orthographic = new three.OrthographicCamera(-1, 1, 1, -1, 0.1, 1000);
  readonly controls: OrbitControls;
  /** Whether the machine draws without a graphics card. */
  readonly slow: boolean;
  camera: three.PerspectiveCamera | three.OrthographicCamera = this.perspective;
  width = 1;
  height = 1;
  reach = 10; // radius of all there is, about the target
  onLook: () => void = () => undefined;
  onDraw: () => void = () => undefined;
  onLost: (lost: boolean) => void = () => undefined;
  private asked = false;
  private disposed = false;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.slow = drawsSlowly();
    const context = canvas.getContext("webgl2", { antialias: !this.slow, alpha: true, preserveDrawingBuffer: true });
    if (!context) throw new NoWebGL(NO_WEBGL);
    this.renderer = new three.WebGLRenderer({ canvas, context });
    this.renderer.setPixelRatio(this.slow ? 1 : Math.min(window.devicePixelRatio, 2));
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0, -10, 0);
    this.controls = this.newControls();
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.onLost(true);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.onLost(false);
      this.redraw();
    });
  }

  private newControls(): OrbitControls {
    const controls = new OrbitControls(this.camera, this.canvas);
    controls.enableDamping = false;
    controls.zoomToCursor = true;
    controls.addEventListener("change", () => {
      this.redraw();
      this.onLook();
    });
    return controls;
  }

  get isOrthographic(): boolean {
    return this.camera === this.orthographic;
  }

  setOrthographic(on: boolean): void {
    if (on === this.isOrthographic) return;
    const look = this.look;
    this.camera = on ? this.orthographic : this.perspective;
    this.controls.object = this.camera;
    this.look = look;
  }

  get look(): Look {
    const target = this.controls.target;
    const away = this.camera.position.clone().sub(target);
    const height = this.isOrthographic
      ? (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom
      : 2 * away.length() * Math.tan((ANGLE * Math.PI) / 360);
    return {
      target: target.toArray(), from: away.normalize().toArray(), up: this.camera.up.toArray() as Look["up"], height,
    };
  }

  set look(look: Look) {
    const distance = look.height / (2 * Math.tan((ANGLE * Math.PI) / 360));
    const target = new three.Vector3(...look.target);
    for (const camera of [this.perspective, this.orthographic]) {
      camera.up.set(...look.up);
      camera.position.copy(target).addScaledVector(new three.Vector3(...look.from).normalize(), distance);
    }
    this.controls.target.copy(target);
    this.orthographic.zoom = 1;
    this.orthographic.top = look.height / 2;
    this.orthographic.bottom = -look.height / 2;
    this.fit();
    this.controls.update();
    this.redraw();
    this.onLook();
  }

  resize(width: number, height: number): void {
    if (width < 1 || height < 1) return;
    [this.width, this.height] = [width, height];
    this.renderer.setSize(width, height, false);
    this.fit();
    this.redraw();
  }

  get aspect(): number {
    return this.width / this.height;
  }

  /** Cameras suit the picture's shape and hold all there is. */
  fit(aspect = this.aspect): void {
    this.perspective.aspect = aspect;
    this.orthographic.left = this.orthographic.bottom * aspect;
    this.orthographic.right = this.orthographic.top * aspect;
    const distance = this.camera.position.distanceTo(this.controls.target);
    this.perspective.near = Math.max(distance - 1.1 * this.reach, distance * 1e-3);
    this.perspective.far = distance + 1.1 * this.reach;
    this.orthographic.near = distance - 1.1 * this.reach;
    this.orthographic.far = distance + 1.1 * this.reach;
    this.perspective.updateProjectionMatrix();
    this.orthographic.updateProjectionMatrix();
    this.camera.updateMatrixWorld();
  }

  /** Draw soon, once for however many wishes. */
  redraw(): void {
    if (this.asked) return;
    this.asked = true;
    requestAnimationFrame(() => this.asked && this.draw());
  }

  draw(): void {
    if (this.disposed) return;
    this.asked = false;
    this.fit();
    this.onDraw();
    this.renderer.render(this.scene, this.camera);
  }

  /** Where a place is on the canvas: pixels from its upper left, and depth; null behind the eye. */
  screenOf(place: ArrayLike<number>): [number, number, number] | null {
    this.camera.updateMatrixWorld();
    const v = new three.Vector3(place[0], place[1], place[2]).project(this.camera);
    if (v.z > 1 || v.z < -1) return null;
    return [(0.5 + 0.5 * v.x) * this.width, (0.5 - 0.5 * v.y) * this.height, v.z];
  }

  /** The ray through a pixel of the canvas. */
  rayAt(x: number, y: number): three.Ray {
    this.camera.updateMatrixWorld();
    const caster = new three.Raycaster();
    caster.setFromCamera(new three.Vector2((2 * x) / this.width - 1, 1 - (2 * y) / this.height), this.camera);
    // with parallel rays there is no eye: what lies in front of it is seen, too
    if (this.isOrthographic) caster.ray.origin.addScaledVector(caster.ray.direction, -this.orthographic.far);
    return caster.ray;
  }

  /** Pixels of the canvas for a length of one at the target. */
  get pixelsPerLength(): number {
    return this.height / this.look.height;
  }

  dispose(): void {
    this.disposed = true;
    this.controls.dispose();
    this.renderer.dispose();
  }
}
