// Renderer, perspective and orthographic camera, and mouse controls. It draws only when something has changed.

import * as three from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import type { Look } from "./look";

/** Vertical field of view [degrees]: the eye is two heights of the view away from the target. */
const FIELD_OF_VIEW = (2 * Math.atan(0.25) * 180) / Math.PI;

const NO_WEBGL =
  "This browser cannot draw in 3D: WebGL 2 is not available. Try another browser, or enable hardware acceleration in " +
  "its settings; `sand plot` makes pictures without a browser.";

/** Whether the browser renders in software, without a graphics card. */
function rendersInSoftware(): boolean {
  const context = document.createElement("canvas").getContext("webgl2");
  const extension = context?.getExtension("WEBGL_debug_renderer_info");
  const name = extension ? String(context?.getParameter(extension.UNMASKED_RENDERER_WEBGL)) : "";
  context?.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|software|basic render/i.test(name);
}

export class Stage {
  readonly scene = new three.Scene();
  readonly renderer: three.WebGLRenderer;
  readonly perspective = new three.PerspectiveCamera(FIELD_OF_VIEW, 1, 0.1, 1000);
  readonly orthographic = new three.OrthographicCamera(-1, 1, 1, -1, 0.1, 1000);
  readonly controls: OrbitControls;
  /** Whether the browser renders in software. */
  readonly slow: boolean;
  camera: three.PerspectiveCamera | three.OrthographicCamera = this.perspective;
  width = 1;
  height = 1;
  reach = 10; // radius of the sphere about the target that contains everything
  onLook: () => void = () => undefined;
  onDraw: () => void = () => undefined;
  /** Called when the WebGL context is lost (true) or restored (false). */
  onContextChange: (lost: boolean) => void = () => undefined;
  private scheduled = false;
  private disposed = false;

  constructor(readonly canvas: HTMLCanvasElement) {
    this.slow = rendersInSoftware();
    const context = canvas.getContext("webgl2", { antialias: !this.slow, alpha: true, preserveDrawingBuffer: true });
    if (!context) throw new Error(NO_WEBGL);
    this.renderer = new three.WebGLRenderer({ canvas, context });
    this.renderer.setPixelRatio(this.slow ? 1 : Math.min(window.devicePixelRatio, 2));
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0, -10, 0);
    this.controls = this.newControls();
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault();
      this.onContextChange(true);
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this.onContextChange(false);
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
    const offset = this.camera.position.clone().sub(target);
    const height = this.isOrthographic
      ? (this.orthographic.top - this.orthographic.bottom) / this.orthographic.zoom
      : 2 * offset.length() * Math.tan((FIELD_OF_VIEW * Math.PI) / 360);
    return {
      target: target.toArray(), from: offset.normalize().toArray(), up: this.camera.up.toArray() as Look["up"], height,
    };
  }

  set look(look: Look) {
    const distance = look.height / (2 * Math.tan((FIELD_OF_VIEW * Math.PI) / 360));
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

  /** Have the size of an element, also when it changes. */
  fill(element: HTMLElement): void {
    const resize = (): void => this.resize(element.clientWidth, element.clientHeight);
    new ResizeObserver(resize).observe(element);
    resize();
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

  /** Adjust both cameras to the aspect ratio of the canvas, and their near and far planes to the content. */
  private fit(): void {
    const { aspect } = this;
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

  /** Schedule a drawing with the next animation frame. */
  redraw(): void {
    if (this.scheduled) return;
    this.scheduled = true;
    requestAnimationFrame(() => this.scheduled && this.draw());
  }

  draw(): void {
    if (this.disposed) return;
    this.scheduled = false;
    this.fit();
    this.onDraw();
    this.renderer.render(this.scene, this.camera);
  }

  /** Projection of a position: pixels from the upper left corner of the canvas, and depth; null behind the eye. */
  screenOf(position: ArrayLike<number>): [number, number, number] | null {
    this.camera.updateMatrixWorld();
    const v = new three.Vector3(position[0], position[1], position[2]).project(this.camera);
    if (v.z > 1 || v.z < -1) return null;
    return [(0.5 + 0.5 * v.x) * this.width, (0.5 - 0.5 * v.y) * this.height, v.z];
  }

  /** The ray through a pixel of the canvas. */
  rayAt(x: number, y: number): three.Ray {
    this.camera.updateMatrixWorld();
    const caster = new three.Raycaster();
    caster.setFromCamera(new three.Vector2((2 * x) / this.width - 1, 1 - (2 * y) / this.height), this.camera);
    // the orthographic camera also shows what is behind its position
    if (this.isOrthographic) caster.ray.origin.addScaledVector(caster.ray.direction, -this.orthographic.far);
    return caster.ray;
  }

  /** Pixels of the canvas per unit length at the target. */
  get pixelsPerLength(): number {
    return this.height / this.look.height;
  }

  dispose(): void {
    this.disposed = true;
    this.controls.dispose();
    this.renderer.dispose();
  }
}
