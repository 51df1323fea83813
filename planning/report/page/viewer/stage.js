// The canvas: renderer, the free camera that orbits, and drawing when something changed.

import * as THREE from "three";

// Colours go to the screen as they are written.
THREE.ColorManagement.enabled = false;

const TURN = 0.006;
const STEP = 0.08;
// Of the rig's reach: how near the free camera comes.
const NEAREST = 0.02;

export class Stage {
  constructor(canvas, antialias, centre, up, places) {
    const reach = Math.max(...places.map((p) => p.distanceTo(centre)));
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias });
    this.renderer.outputColorSpace = THREE.LinearSRGBColorSpace;
    this.scene = new THREE.Scene();
    this.free = new THREE.PerspectiveCamera(35, 1, 0.01 * reach, 60 * reach);
    this.free.up.copy(up);
    this.centre = centre.clone();
    this.up = up;
    this.reach = reach;
    this.places = places;
    this.eye = null; // A device's view, in the place of the free camera.
    this.onDraw = [];
    this.frame();
    this.waiting = false;
    new ResizeObserver(() => this.redraw()).observe(canvas);
    this.listen();
  }

  get camera() {
    return this.eye ? this.eye.camera : this.free;
  }

  // Looks at points of the world, from a turn about up and a height in radians.
  frame({ turn = this.turn ?? 0, height = 0.35, places = this.places } = {}) {
    this.turn = turn;
    this.height = height;
    const around = new THREE.Box3().setFromPoints(places);
    this.target = around.getCenter(new THREE.Vector3());
    this.distance = 1;
    this.place();
    // As near as leaves all of them in the picture.
    const tall = Math.tan((0.5 * Math.PI * this.free.fov) / 180);
    const wide = tall * Math.max(this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1), 0.2);
    const [x, y, z] = [0, 1, 2].map((k) => new THREE.Vector3().setFromMatrixColumn(this.free.matrix, k));
    const needs = places.map((point) => {
      const off = point.clone().sub(this.target);
      return off.dot(z) + 1.18 * Math.max(Math.abs(off.dot(x)) / wide, Math.abs(off.dot(y)) / tall);
    });
    this.distance = Math.max(...needs);
    this.place();
  }

  // Two directions across up, from which turns count.
  get level() {
    const across = new THREE.Vector3(1, 0, 0);
    if (Math.abs(across.dot(this.up)) > 0.7) across.set(0, 1, 0);
    across.addScaledVector(this.up, -across.dot(this.up)).normalize();
    return [across, new THREE.Vector3().crossVectors(this.up, across)];
  }

  place() {
    const [across, ahead] = this.level;
    const flat = across.multiplyScalar(Math.cos(this.turn));
    flat.addScaledVector(ahead, Math.sin(this.turn));
    const back = flat.multiplyScalar(Math.cos(this.height));
    back.addScaledVector(this.up, Math.sin(this.height));
    this.free.position.copy(this.target).addScaledVector(back, this.distance);
    this.free.near = Math.max(0.002 * this.distance, 1e-4 * this.reach);
    this.free.lookAt(this.target);
    this.free.updateMatrix();
    this.redraw();
  }

  rotate(dx, dy) {
    this.turn -= dx;
    this.height = Math.min(Math.max(this.height + dy, -1.57), 1.57);
    this.place();
  }

  // Goes on towards a place of the canvas, from its middle in parts of its height, as
  // the object is near: what lies there stays there, and turning is about it.
  zoom(factor, [x, y] = [0, 0]) {
    if (this.eye) {
      this.eye.zoom(1 / factor);
      return this.redraw();
    }
    const back = new THREE.Vector3().setFromMatrixColumn(this.free.matrix, 2);
    const depth = this.free.position.clone().sub(this.centre).dot(back);
    const before = depth > NEAREST * this.reach ? depth : this.distance;
    const after = Math.min(Math.max(before * factor, NEAREST * this.reach), 30 * this.reach);
    this.target.copy(this.free.position).addScaledVector(back, -before);
    this.distance = after;
    this.pan((1 - before / after) * x, (1 - before / after) * y);
  }

  pan(dx, dy) {
    const scale = 2 * Math.tan((0.5 * Math.PI * this.free.fov) / 180) * this.distance;
    this.target.addScaledVector(new THREE.Vector3().setFromMatrixColumn(this.free.matrix, 0), -dx * scale);
    this.target.addScaledVector(new THREE.Vector3().setFromMatrixColumn(this.free.matrix, 1), dy * scale);
    this.place();
  }

  listen() {
    const { canvas } = this;
    let last = null;
    let moved = 0;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      last = event;
      moved = 0;
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const dx = event.clientX - last.clientX;
      const dy = event.clientY - last.clientY;
      moved += Math.abs(dx) + Math.abs(dy);
      const pans = event.shiftKey || event.buttons & 6;
      const high = canvas.clientHeight;
      if (!this.eye && moved > 3) {
        if (pans) this.pan(dx / high, dy / high);
        else this.rotate(TURN * dx, TURN * dy);
      }
      last = event;
    });
    canvas.addEventListener("pointerup", (event) => {
      const still = last && moved <= 3 && event.button === 0;
      last = null;
      if (still) this.onClick?.(event.offsetX, event.offsetY);
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener(
      "wheel",
      (event) => {
        event.preventDefault();
        const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
        const place = [(event.offsetX - wide / 2) / high, (event.offsetY - high / 2) / high];
        this.zoom(Math.exp(0.0012 * event.deltaY), place);
      },
      { passive: false },
    );
    canvas.addEventListener("keydown", (event) => this.key(event));
  }

  key(event) {
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (move && !this.eye) {
      const [dx, dy] = move.map((way) => way * STEP);
      if (event.shiftKey) this.pan(dx, dy);
      else this.rotate(-dx, -dy);
    } else if (event.key === "+" || event.key === "=") this.zoom(0.85);
    else if (event.key === "-") this.zoom(1 / 0.85);
    else if (event.key === "Home") this.onHome?.();
    else if (event.key === "Enter") this.onClick?.(this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
    else return;
    event.preventDefault();
  }

  // Of the picture, and of what lies beside a device's image.
  setBackground(colour, beside) {
    this.background = new THREE.Color(colour);
    this.beside = new THREE.Color(beside);
    this.restoreClear();
    this.redraw();
  }

  restoreClear() {
    this.renderer.setClearColor(this.background ?? 0xffffff, 1);
  }

  redraw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      this.draw();
    });
  }

  // Where the picture is on the canvas: a device's image keeps its shape.
  get window() {
    const [wide, high] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!this.eye) return { left: 0, top: 0, wide, high };
    const scale = Math.min(wide / this.eye.aspect, high);
    const [w, h] = [scale * this.eye.aspect, scale];
    return { left: (wide - w) / 2, top: (high - h) / 2, wide: w, high: h };
  }

  draw() {
    const [wide, high] = [this.canvas.clientWidth, this.canvas.clientHeight];
    if (!wide || !high) return;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    this.renderer.setPixelRatio(ratio);
    const size = this.renderer.getSize(new THREE.Vector2());
    if (size.x !== wide || size.y !== high) this.renderer.setSize(wide, high, false);
    const view = this.window;
    this.free.aspect = wide / high;
    this.free.updateProjectionMatrix();
    this.renderer.setScissorTest(false);
    this.renderer.setViewport(0, 0, wide, high);
    if (this.beside) this.renderer.setClearColor(this.beside, 1);
    this.renderer.clear();
    this.restoreClear();
    this.renderer.setScissorTest(true);
    const from = high - view.top - view.high;
    this.renderer.setScissor(view.left, from, view.wide, view.high);
    this.renderer.setViewport(view.left, from, view.wide, view.high);
    this.renderer.render(this.scene, this.camera);
    for (const told of this.onDraw) told();
  }

  // A point of the world on the canvas in pixels; null behind the camera.
  spot(point) {
    const at = this.eye ? this.eye.project(point) : point.clone().project(this.camera);
    if (at.z > 1 || at.z < -1) return null;
    const view = this.window;
    return [view.left + (0.5 + 0.5 * at.x) * view.wide, view.top + (0.5 - 0.5 * at.y) * view.high];
  }
}
