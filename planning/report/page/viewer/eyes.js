// What a device sees, or shines on: its own camera matrix, lens shift and distortion.

import * as THREE from "three";

import { matrix, panelCorners } from "./devices.js";
import { bent, lensOf, straight } from "./lens.js";

// OpenCV looks along +z with y down, this library along -z with y up.
const FLIP = new THREE.Matrix4().makeScale(1, -1, -1);

export class Eye {
  constructor(device, near, far, centre) {
    this.device = device;
    this.lens = lensOf(device);
    const [wide, high] = device.resolution;
    this.aspect = wide / high;
    const corners = panelCorners(device);
    const [left, right] = [corners[0].x, corners[1].x];
    const [top, bottom] = [-corners[0].y, -corners[2].y];
    this.camera = device.K ? new THREE.PerspectiveCamera() : new THREE.OrthographicCamera();
    this.camera.matrixAutoUpdate = false;
    this.camera.matrix.copy(matrix(device.pose)).multiply(FLIP);
    this.camera.updateMatrixWorld(true);
    const whole = this.camera.projectionMatrix;
    if (device.K) whole.makePerspective(left * near, right * near, top * near, bottom * near, near, far);
    else whole.makeOrthographic(left, right, top, bottom, 0, far);
    this.whole = whole.clone();
    this.camera.projectionMatrixInverse.copy(whole).invert();
    this.scale = 1;
    // The picture grows about the middle of the object, which comes to its own middle.
    this.about = this.project(centre);
    this.zoom(1);
  }

  // A point of the world in the picture, as the shaders draw it.
  project(point) {
    const at = point.clone().applyMatrix4(this.camera.matrixWorldInverse);
    if (this.lens && at.z < 0) {
      const [x, y] = bent(this.lens, [at.x / -at.z, at.y / at.z]);
      at.set(x * -at.z, y * at.z, at.z);
    }
    return at.applyMatrix4(this.camera.projectionMatrix);
  }

  // The way to a place of the picture, in the device's axes as the library has them.
  unproject(x, y, z) {
    const at = new THREE.Vector3(x, y, z).applyMatrix4(this.camera.projectionMatrixInverse);
    if (!this.lens) return at;
    const [a, b] = straight(this.lens, [at.x / -at.z, at.y / at.z]);
    return at.set(a * -at.z, b * at.z, at.z);
  }

  zoom(factor) {
    this.scale = Math.min(Math.max(this.scale * factor, 1), 60);
    const { x, y } = this.about;
    const grown = new THREE.Matrix4().makeScale(this.scale, this.scale, 1);
    const to = new THREE.Matrix4().makeTranslation(-x, -y, 0);
    const back = new THREE.Matrix4().makeTranslation(x / this.scale, y / this.scale, 0);
    this.camera.projectionMatrix.copy(this.whole).premultiply(to).premultiply(grown).premultiply(back);
    this.camera.projectionMatrixInverse.copy(this.camera.projectionMatrix).invert();
  }
}
