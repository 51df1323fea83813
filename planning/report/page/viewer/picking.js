// Which triangle is under a pixel: each is drawn once in the colour of its number.

import * as THREE from "three";

export class Picking {
  constructor(stage, surface) {
    this.stage = stage;
    this.surface = surface;
    this.target = new THREE.WebGLRenderTarget(1, 1);
    this.scene = new THREE.Scene();
  }

  // Returns the face and the point of it at a place on the canvas, or null.
  at(x, y) {
    const { stage, surface } = this;
    const view = stage.window;
    const ndc = [(2 * (x - view.left)) / view.wide - 1, 1 - (2 * (y - view.top)) / view.high];
    if (Math.max(...ndc.map(Math.abs)) > 1) return null;
    const ray = rayThrough(stage, ndc);
    const face = this.number(ndc, view);
    if (face < 0) return null;
    const [a] = surface.triangle(face);
    const plane = new THREE.Plane().setFromNormalAndCoplanarPoint(surface.normal(face), a);
    const point = ray.intersectPlane(plane, new THREE.Vector3());
    return { face, point: point ?? surface.centroid(face) };
  }

  number(ndc, view) {
    const { stage, surface, target } = this;
    const camera = stage.camera;
    const whole = camera.projectionMatrix.clone();
    // One pixel about the place fills the picture.
    const zoom = new THREE.Matrix4().makeScale(view.wide, view.high, 1);
    const shift = new THREE.Matrix4().makeTranslation(-ndc[0], -ndc[1], 0);
    camera.projectionMatrix.premultiply(shift).premultiply(zoom);
    const { mesh } = surface;
    const parent = mesh.parent;
    mesh.material = surface.numbers;
    this.scene.add(mesh);
    const { renderer } = stage;
    renderer.setScissorTest(false);
    renderer.setRenderTarget(target);
    renderer.setClearColor(0x000000, 0);
    renderer.clear();
    renderer.render(this.scene, camera);
    const pixel = new Uint8Array(4);
    renderer.readRenderTargetPixels(target, 0, 0, 1, 1, pixel);
    renderer.setRenderTarget(null);
    mesh.material = surface.material;
    parent.add(mesh);
    camera.projectionMatrix.copy(whole);
    stage.restoreClear();
    return pixel[0] + 256 * pixel[1] + 65536 * pixel[2] + 16777216 * pixel[3] - 1;
  }
}

function rayThrough({ camera, eye }, [x, y]) {
  camera.updateMatrixWorld();
  const unproject = new THREE.Matrix4().copy(camera.projectionMatrix).invert();
  const [near, far] = [-1, 0.5].map((z) =>
    (eye ? eye.unproject(x, y, z) : new THREE.Vector3(x, y, z).applyMatrix4(unproject))
      .applyMatrix4(camera.matrixWorld),
  );
  return new THREE.Ray(near, far.sub(near).normalize());
}
