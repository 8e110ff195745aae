// Triangles of the shapes of MuJoCo: positions and normals, in the frame of the geom.

const Shapes = {
  // rows of points => triangles between neighbouring rows
  grid(rows, columns, point) {
    const positions = [];
    const normals = [];
    const triangles = [];
    for (let i = 0; i <= rows; ++i) {
      for (let j = 0; j <= columns; ++j) {
        const [position, normal] = point(i / rows, (2 * Math.PI * j) / columns);
        positions.push(...position);
        normals.push(...Vec.unit(normal));
      }
    }
    for (let i = 0; i < rows; ++i) {
      for (let j = 0; j < columns; ++j) {
        const a = i * (columns + 1) + j;
        const b = a + columns + 1;
        triangles.push(a, b, a + 1, a + 1, b, b + 1);
      }
    }
    return { positions, normals, triangles };
  },

  join(parts) {
    const whole = { positions: [], normals: [], triangles: [] };
    for (const part of parts) {
      const first = whole.positions.length / 3;
      whole.positions.push(...part.positions);
      whole.normals.push(...part.normals);
      for (const index of part.triangles) whole.triangles.push(first + index);
    }
    return whole;
  },

  ellipsoid([a, b, c]) {
    return Shapes.grid(16, 28, (share, turn) => {
      const polar = Math.PI * share;
      const [x, y, z] = [Math.sin(polar) * Math.cos(turn), Math.sin(polar) * Math.sin(turn), Math.cos(polar)];
      return [[a * x, b * y, c * z], [x / a, y / b, z / c]];
    });
  },

  sphere: ([radius]) => Shapes.ellipsoid([radius, radius, radius]),

  capsule([radius, half]) {
    const rows = 17;
    return Shapes.grid(rows, 24, (share, turn) => {
      const polar = Math.PI * (share < 0.5 ? (share * rows) / (rows - 1) : (share * rows - 1) / (rows - 1));
      const normal = [Math.sin(polar) * Math.cos(turn), Math.sin(polar) * Math.sin(turn), Math.cos(polar)];
      const end = share < 0.5 ? half : -half;
      return [[radius * normal[0], radius * normal[1], radius * normal[2] + end], normal];
    });
  },

  cylinder([radius, half]) {
    const side = Shapes.grid(1, 32, (share, turn) => [
      [radius * Math.cos(turn), radius * Math.sin(turn), half * (1 - 2 * share)],
      [Math.cos(turn), Math.sin(turn), 0],
    ]);
    const cap = (up) => Shapes.grid(1, 32, (share, turn) => [
      [radius * share * Math.cos(turn), radius * share * Math.sin(turn), up * half],
      [0, 0, up],
    ]);
    return Shapes.join([cap(1), side, cap(-1)]);
  },

  box(half) {
    const faces = [];
    for (let axis = 0; axis < 3; ++axis) {
      for (const sign of [1, -1]) {
        const normal = [0, 0, 0];
        normal[axis] = sign;
        const [u, v] = [(axis + 1) % 3, (axis + 2) % 3];
        const positions = [];
        for (const [s, t] of [[-1, -1], [1, -1], [1, 1], [-1, 1]]) {
          const corner = [0, 0, 0];
          corner[axis] = sign * half[axis];
          corner[u] = s * half[u];
          corner[v] = t * half[v];
          positions.push(...corner);
        }
        faces.push({ positions, normals: [normal, normal, normal, normal].flat(), triangles: [0, 1, 2, 0, 2, 3] });
      }
    }
    return Shapes.join(faces);
  },

  plane([x, y], extent) {
    const [a, b] = [x > 0 ? x : 20 * extent, y > 0 ? y : 20 * extent];
    return {
      positions: [-a, -b, 0, a, -b, 0, a, b, 0, -a, b, 0],
      normals: [0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1],
      triangles: [0, 1, 2, 0, 2, 3],
    };
  },

  // each triangle has corners of its own, so that edges stay sharp
  mesh({ vertices, faces }) {
    const points = floats(vertices);
    const corners = indices(faces);
    const positions = [];
    const normals = [];
    const at = (i) => [points[3 * i], points[3 * i + 1], points[3 * i + 2]];
    for (let i = 0; i < corners.length; i += 3) {
      const [a, b, c] = [at(corners[i]), at(corners[i + 1]), at(corners[i + 2])];
      const normal = Vec.unit(Vec.cross(Vec.add(b, a, -1), Vec.add(c, a, -1)));
      for (const corner of [a, b, c]) {
        positions.push(...corner);
        normals.push(...normal);
      }
    }
    return { positions, normals, triangles: positions.slice(0, positions.length / 3).map((_, i) => i) };
  },

  of(geom, meshes, extent) {
    if (geom.shape === "mesh") return Shapes.mesh(meshes[geom.mesh]);
    return Shapes[geom.shape](geom.size, extent);
  },
};
