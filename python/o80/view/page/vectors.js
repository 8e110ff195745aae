// Vectors, quaternions (w, x, y, z) and 4 x 4 matrices in the order of WebGL.

const Vec = {
  add: (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]],
  dot: (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2],
  cross: (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
  unit: (a) => {
    const length = Math.hypot(a[0], a[1], a[2]) || 1;
    return [a[0] / length, a[1] / length, a[2] / length];
  },
};

const Mat = {
  // position and quaternion => rigid transformation
  rigid(p, q) {
    const [w, x, y, z] = q;
    return [
      1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y), 0,
      2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x), 0,
      2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y), 0,
      p[0], p[1], p[2], 1,
    ];
  },
  multiply(a, b) {
    return a.map((_, i) => {
      const [row, column] = [i % 4, i - (i % 4)];
      return a[row] * b[column] + a[row + 4] * b[column + 1] + a[row + 8] * b[column + 2] + a[row + 12] * b[column + 3];
    });
  },
  perspective(angle, aspect, near, far) {
    const f = 1 / Math.tan(angle / 2);
    const d = near - far;
    return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / d, -1, 0, 0, (2 * far * near) / d, 0];
  },
  lookAt(eye, target, up) {
    const back = Vec.unit(Vec.add(eye, target, -1));
    const right = Vec.unit(Vec.cross(up, back));
    const above = Vec.cross(back, right);
    return [
      right[0], above[0], back[0], 0, right[1], above[1], back[1], 0, right[2], above[2], back[2], 0,
      -Vec.dot(right, eye), -Vec.dot(above, eye), -Vec.dot(back, eye), 1,
    ];
  },
  // flattens along `light` onto the plane z = height
  shadow(light, height) {
    const [x, y, z] = light;
    return [1, 0, 0, 0, 0, 1, 0, 0, -x / z, -y / z, 0, 0, (x / z) * height, (y / z) * height, height, 1];
  },
};

function bytesOf(text) {
  const binary = atob(text);
  const bytes = new Uint8Array(binary.length);
  for (let i = 0; i < binary.length; ++i) bytes[i] = binary.charCodeAt(i);
  return bytes;
}
const floats = (text) => (typeof text === "string" ? new Float32Array(bytesOf(text).buffer) : text);
const indices = (text) => new Uint32Array(bytesOf(text).buffer);
