// Draws bodies with WebGL. Drag: turn; drag with the right button or shift: move; wheel: zoom.

const LIGHT = Vec.unit([-0.35, -0.45, -1]);
const VERTEX = `#version 300 es
uniform mat4 view, model;
in vec3 position, normal;
out vec3 world, facing;
void main() {
  vec4 at = model * vec4(position, 1.0);
  world = at.xyz;
  facing = mat3(model) * normal;
  gl_Position = view * at;
}`;
const FRAGMENT = `#version 300 es
precision highp float;
uniform vec4 colour;
uniform vec3 eye, light;
uniform float tile, reach;
uniform vec3 centre;
in vec3 world, facing;
out vec4 pixel;
void main() {
  if (tile < 0.0) { pixel = colour; return; }
  vec3 n = normalize(facing), to = normalize(eye - world);
  if (dot(n, to) < 0.0) n = -n;
  float sun = max(dot(n, -light), 0.0), sky = 0.5 + 0.5 * n.z;
  vec3 lit = colour.rgb * (0.38 + 0.26 * sky + 0.52 * sun);
  lit += 0.16 * pow(max(dot(reflect(light, n), to), 0.0), 24.0);
  float alpha = colour.a;
  if (tile > 0.0) {
    vec2 cell = floor(world.xy / tile);
    float soft = clamp(1.5 - 1.5 * length(fwidth(world.xy)) / tile, 0.0, 1.0);
    lit *= 1.0 + soft * (mod(cell.x + cell.y, 2.0) > 0.5 ? 0.035 : -0.035);
    alpha *= 1.0 - smoothstep(0.5 * reach, reach, length(world.xy - centre.xy));
  }
  pixel = vec4(lit * alpha, alpha);
}`;

class Scene {
  constructor(canvas) {
    this.canvas = canvas;
    this.gl = canvas.getContext("webgl2", { antialias: true, stencil: true, alpha: true });
    this.robots = new Map(); // by name of the source
    this.chosen = null; // name of the one with a ghost
    this.geoms = []; // what is drawn, of all
    this.frames = 0;
    if (this.gl) this.prepare();
    this.listen();
  }

  prepare() {
    const gl = this.gl;
    const program = gl.createProgram();
    for (const [kind, source] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, source);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    this.program = program;
    this.place = {};
    for (const name of ["view", "model", "colour", "eye", "light", "tile", "reach", "centre"]) {
      this.place[name] = gl.getUniformLocation(program, name);
    }
    gl.enable(gl.DEPTH_TEST);
    gl.polygonOffset(1, 4);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
  }

  get pose() {
    return this.robots.get(this.chosen)?.pose;
  }

  // the robot with the ghost, whose surfaces lie before those that others share with it
  choose(name) {
    if (name === this.chosen) return;
    this.chosen = name;
    this.arrange();
  }

  // the only robots that are drawn
  keep(names) {
    const gone = [...this.robots.keys()].filter((name) => !names.includes(name));
    for (const name of gone) this.remove(name);
  }

  remove(name) {
    for (const geom of this.robots.get(name)?.geoms ?? []) this.gl.deleteVertexArray(geom.array);
    if (this.robots.delete(name)) this.arrange();
  }

  // the model of a robot, which has no pose yet
  load(name, geometry, key) {
    this.remove(name);
    if (!geometry || !this.gl) return this.arrange();
    const moves = new Set(geometry.moving);
    const bodies = floats(geometry.bodies);
    const robot = { key, moving: geometry.moving, extent: Math.max(geometry.extent, 1e-3), centre: geometry.centre, pose: null, ghost: null };
    robot.bodies = Array.from({ length: bodies.length / 7 }, (_, i) => this.bodyMatrix(bodies, i));
    robot.geoms = geometry.geoms.map((geom) => ({
      ...geom,
      ...this.upload(Shapes.of(geom, geometry.meshes, robot.extent)),
      local: Mat.rigid(geom.pos, geom.quat),
      moves: moves.has(geom.body),
      robot,
    }));
    this.robots.set(name, robot);
    this.arrange();
  }

  // what is drawn: what stands in several models is drawn once, and of floors of one height the largest
  arrange() {
    const first = this.robots.get(this.chosen);
    const robots = [...this.robots.values()].sort((a, b) => (b === first) - (a === first));
    const area = ({ size: [x, y] }) => (x > 0 && y > 0 ? x * y : Infinity);
    const found = new Map();
    for (const geom of robots.flatMap((robot) => robot.geoms)) {
      const place = geom.moves ? [] : Mat.multiply(geom.robot.bodies[geom.body], geom.local).map((number) => number.toFixed(3));
      const plane = geom.shape === "plane";
      const same = plane ? [place.slice(8, 11), place[14]] : [geom.shape, geom.size.map((number) => number.toFixed(4)), place];
      const key = geom.moves || geom.shape === "mesh" ? geom : JSON.stringify(same);
      const other = found.get(key);
      if (!other || (plane && area(geom) > area(other))) found.set(key, geom);
    }
    this.geoms = [...found.values()];
    this.canvas.hidden = !this.geoms.length;
    this.dirty = true;
    if (robots.length) this.fit(robots.reduce((a, b) => (b.extent > a.extent ? b : a)));
    else this.moved = false;
    const floor = this.geoms.find((geom) => geom.shape === "plane" && !geom.moves);
    this.floor = floor && Math.abs(floor.quat[0]) > 0.999 ? floor.robot.bodies[floor.body][14] + floor.pos[2] : null;
  }

  // the camera looks at the largest robot, until the user turns or moves it
  fit({ extent, centre }) {
    this.extent = extent;
    if (this.moved) return;
    this.target = centre.slice();
    const shape = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
    this.distance = 2.1 * extent * Math.max(1, 1.2 / (shape || 1.2));
    this.azimuth = -0.9;
    this.elevation = 0.38;
  }

  bodyMatrix(numbers, i) {
    return Mat.rigid(numbers.subarray(7 * i, 7 * i + 3), numbers.subarray(7 * i + 3, 7 * i + 7));
  }

  upload({ positions, normals, triangles }) {
    const gl = this.gl;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    for (const [name, numbers] of [["position", positions], ["normal", normals]]) {
      const place = gl.getAttribLocation(this.program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(numbers), gl.STATIC_DRAW);
      gl.enableVertexAttribArray(place);
      gl.vertexAttribPointer(place, 3, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(triangles), gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return { array, count: triangles.length };
  }

  // poses as the server packs them; null: none
  show(name, pose, ghost) {
    const robot = this.robots.get(name);
    if (!robot || !pose) return;
    robot.pose = floats(pose);
    robot.ghost = ghost && floats(ghost);
    robot.moving.forEach((body, i) => {
      robot.bodies[body] = this.bodyMatrix(robot.pose, i);
    });
    this.dirty = true;
  }

  // moving bodies of the chosen robot whose desired pose differs visibly from the observed one
  ghosts() {
    const robot = this.robots.get(this.chosen);
    if (!robot?.ghost) return new Map();
    const found = new Map();
    robot.moving.forEach((body, i) => {
      let difference = 0;
      let turn = 0;
      for (let k = 0; k < 3; ++k) difference += (robot.ghost[7 * i + k] - robot.pose[7 * i + k]) ** 2;
      for (let k = 3; k < 7; ++k) turn += robot.ghost[7 * i + k] * robot.pose[7 * i + k];
      if (Math.sqrt(difference) > 0.002 * robot.extent || Math.abs(turn) < 0.9999) {
        found.set(body, this.bodyMatrix(robot.ghost, i));
      }
    });
    return found;
  }

  eye() {
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    const direction = [ce * Math.cos(this.azimuth), ce * Math.sin(this.azimuth), se];
    return Vec.add(this.target, direction, this.distance);
  }

  draw() {
    const gl = this.gl;
    const scale = window.devicePixelRatio || 1;
    const [width, height] = [Math.round(this.canvas.clientWidth * scale), Math.round(this.canvas.clientHeight * scale)];
    if (!gl || !width || !height || !this.geoms.length) return;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      this.canvas.width = width;
      this.canvas.height = height;
      this.dirty = true;
    }
    if (!this.dirty) return;
    this.dirty = false;
    ++this.frames;
    const eye = this.eye();
    const near = 0.02 * this.distance;
    const lens = Mat.perspective(0.75, width / height, near, 60 * this.extent + 4 * this.distance);
    gl.viewport(0, 0, width, height);
    gl.clearColor(0, 0, 0, 0);
    gl.clearStencil(0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    gl.uniformMatrix4fv(this.place.view, false, Mat.multiply(lens, Mat.lookAt(eye, this.target, [0, 0, 1])));
    gl.uniform3fv(this.place.eye, eye);
    gl.uniform3fv(this.place.light, LIGHT);
    gl.uniform3fv(this.place.centre, this.target);
    gl.uniform1f(this.place.reach, 8 * this.extent);
    const planes = this.geoms.filter((geom) => geom.shape === "plane");
    const solid = this.geoms.filter((geom) => geom.shape !== "plane");
    for (const geom of planes) this.drawGeom(geom, this.bodyOf(geom), geom.colour, this.extent / 6);
    this.drawShadows(solid);
    for (const geom of solid) if (geom.colour[3] >= 1) this.drawGeom(geom, this.bodyOf(geom), geom.colour, 0);
    gl.depthMask(false);
    for (const geom of solid) if (geom.colour[3] < 1) this.drawGeom(geom, this.bodyOf(geom), geom.colour, 0);
    gl.depthMask(true);
    this.drawGhosts(solid);
  }

  bodyOf(geom) {
    return geom.robot.bodies[geom.body];
  }

  // flat shadows on the floor; the stencil lets each pixel be darkened once
  drawShadows(solid) {
    if (this.floor === null) return;
    const gl = this.gl;
    const flat = Mat.shadow(LIGHT, this.floor + 0.0015 * this.extent);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    for (const geom of solid) {
      this.drawGeom(geom, Mat.multiply(flat, this.bodyOf(geom)), [0, 0, 0, 0.16 * geom.colour[3]], -1);
    }
    gl.disable(gl.STENCIL_TEST);
  }

  // depth first, then colour: a ghost does not shine through itself
  drawGhosts(solid) {
    const gl = this.gl;
    const ghosts = this.ghosts();
    gl.enable(gl.POLYGON_OFFSET_FILL); // behind the surfaces that it shares with the robot
    for (const pass of [false, true]) {
      gl.colorMask(pass, pass, pass, pass);
      gl.depthFunc(pass ? gl.LEQUAL : gl.LESS);
      for (const geom of solid) {
        const pose = geom.robot === this.robots.get(this.chosen) && ghosts.get(geom.body);
        if (pose) this.drawGeom(geom, pose, [0.91, 0.45, 0.05, 0.42], 0);
      }
    }
    gl.disable(gl.POLYGON_OFFSET_FILL);
    gl.depthFunc(gl.LESS);
  }

  drawGeom(geom, body, colour, tile) {
    if (Number.isNaN(body[12])) return; // not seen, as a ball that no camera sees
    const gl = this.gl;
    if (geom.robot !== this.robots.get(this.chosen)) gl.enable(gl.POLYGON_OFFSET_FILL); // behind what it shares with the chosen one
    gl.uniformMatrix4fv(this.place.model, false, Mat.multiply(body, geom.local));
    gl.uniform4fv(this.place.colour, colour);
    gl.uniform1f(this.place.tile, tile);
    gl.bindVertexArray(geom.array);
    gl.drawElements(gl.TRIANGLES, geom.count, gl.UNSIGNED_INT, 0);
    if (geom.robot !== this.robots.get(this.chosen)) gl.disable(gl.POLYGON_OFFSET_FILL);
  }

  listen() {
    const canvas = this.canvas;
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      if (!event.buttons || !this.target) return;
      if (event.buttons === 2 || event.shiftKey) this.move(event.movementX, event.movementY);
      else {
        this.azimuth -= 0.006 * event.movementX;
        this.elevation = Math.min(1.55, Math.max(-1.5, this.elevation + 0.006 * event.movementY));
      }
      this.dirty = this.moved = true;
    });
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      if (!this.target) return;
      this.distance *= Math.exp(0.001 * event.deltaY);
      this.dirty = this.moved = true;
    }, { passive: false });
  }

  move(x, y) {
    const back = Vec.unit(Vec.add(this.eye(), this.target, -1));
    const right = Vec.unit(Vec.cross([0, 0, 1], back));
    const step = (0.8 * this.distance) / this.canvas.clientHeight;
    this.target = Vec.add(this.target, right, -x * step);
    this.target = Vec.add(this.target, Vec.cross(back, right), y * step);
  }
}
