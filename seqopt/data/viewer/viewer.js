"use strict";
(async () => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const { structure, builds, responses } = data;
  const byId = (id) => document.getElementById(id);
  const WORDS = {
    F_sup_N: "support force, N", M_sup_Nm: "support moment, N m", F_max_N: "largest tension in an edge, N",
    F_min_N: "largest compression in an edge, N", F_avg_N: "mean force of the edges, N", T_pct: "edges in tension, %",
    "D_max_1e-3mm": "largest displacement", "D_avg_1e-3mm": "mean displacement", "D_std_1e-3mm": "spread of displacements",
    props: "props that hold", F_prop_N: "largest force of a prop, N", prop_excess_N: "more than props may bear, N",
    optimized_robot: "robot whose grip is chosen",
  };
  // numbers as people write them, what is left of rounding as 0; and lengths, which are kept in µm
  const plain = (v) => (Math.abs(v) < 1e-9 ? 0 : Number(v)).toLocaleString("en-US", { maximumSignificantDigits: 6 });
  const length = (v) => (Math.abs(v) >= 1000 ? `${plain(v / 1000)} mm` : `${plain(v)} µm`);
  const shownValue = (name, v) => (Number.isNaN(Number(v)) ? v : name.startsWith("D_") ? length(Number(v)) : plain(v));
  const CLAY = 0xcc8560, PROP = 0x8a8478, NEW = 0xe8b04a, TENSION = 0xc8102e, COMPRESSION = 0x1f5fa8, LARGEST = 32767;

  // fields come as whole numbers, compressed
  function unzip(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Response(stream).arrayBuffer();
  }
  async function unpack(field) {
    if (field) field.values = new Int16Array(await unzip(field.data));
  }
  const value = (field, step, i) => (field ? field.values[step * field.width + i] * field.scale[step] : 0);

  // one view of one build
  class Pane {
    constructor(place) {
      this.box = document.createElement("div");
      this.box.className = "pane";
      this.names = document.createElement("canvas");
      this.names.className = "names";
      this.names.setAttribute("aria-hidden", "true");
      this.tag = document.createElement("div");
      this.tag.className = "tag";
      this.canvas = document.createElement("canvas");
      this.canvas.setAttribute("role", "img");
      this.box.append(this.canvas, this.names, this.tag);
      place.append(this.box);
      this.scene = new THREE.Scene();
      this.scene.background = new THREE.Color(0xfbfaf8);
      this.scene.add(new THREE.HemisphereLight(0xffffff, 0xb8a898, 2.4));
      const sun = new THREE.DirectionalLight(0xffffff, 1.4);
      sun.position.set(-0.6, -1, 1.4);
      this.scene.add(sun);
      this.camera = new THREE.PerspectiveCamera(35, 1, 0.01, 1000);
      this.camera.up.set(...structure.up);
      this.renderer = new THREE.WebGLRenderer({ canvas: this.canvas, antialias: true, preserveDrawingBuffer: true });
      this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
      this.controls = new THREE.OrbitControls(this.camera, this.canvas);
      this.controls.addEventListener("start", () => panes.forEach((pane) => { pane.turned = true; }));
      this.controls.addEventListener("change", () => { this.draw(); mirror(this); });
      this.makeBricks();
      this.makeEdges();
      this.makeGrips();
      this.makeRobots();
      this.look();
      new ResizeObserver(() => this.resize()).observe(this.box);
      this.resize();
    }
    makeBricks() {
      this.bricks = structure.bricks.map((brick) => {
        const places = [], at = new Map();
        const triangles = brick.faces.flatMap((f) => f.slice(2).map((_, k) => [f[0], f[k + 1], f[k + 2]]));
        triangles.flat().forEach((i) => places.push(i));
        const geometry = new THREE.BufferGeometry();
        geometry.setAttribute("position", new THREE.Float32BufferAttribute(new Float32Array(places.length * 3), 3));
        const mesh = new THREE.Mesh(geometry, new THREE.MeshLambertMaterial({ color: CLAY, side: THREE.DoubleSide }));
        // an edge between faces that lie in one plane is none of the block's
        brick.faces.forEach((f) => {
          const normal = flat(brick.corners, f);
          f.forEach((a, k) => {
            const b = f[(k + 1) % f.length], key = [a, b].map((i) => brick.corners[i]).sort().join(";");
            if (!at.has(key)) at.set(key, { ends: [a, b], normals: [] });
            at.get(key).normals.push(normal);
          });
        });
        const rims = [...at.values()].filter(({ normals }) => normals.length !== 2 || normals[0].dot(normals[1]) < 0.9999).flatMap(({ ends }) => ends);
        const lines = new THREE.BufferGeometry();
        lines.setAttribute("position", new THREE.Float32BufferAttribute(new Float32Array(rims.length * 3), 3));
        const outline = new THREE.LineSegments(lines, new THREE.LineBasicMaterial({ color: 0x4a2f22 }));
        this.scene.add(mesh, outline);
        return { brick, mesh, outline, places, rims, here: brick.corners };
      });
    }
    makeEdges() {
      const bar = new THREE.CylinderGeometry(1, 1, 1, 8);
      this.edges = new THREE.InstancedMesh(bar, new THREE.MeshBasicMaterial({ depthTest: false, transparent: true }), structure.edges.length);
      this.edges.renderOrder = 2;
      this.edges.visible = false;
      this.edges.frustumCulled = false;
      this.scene.add(this.edges);
    }
    makeGrips() {
      const size = radius * 0.026;
      this.grips = structure.robots.map((robot) => {
        const ball = new THREE.Mesh(new THREE.SphereGeometry(size, 20, 14), new THREE.MeshBasicMaterial({ color: robot.color, depthTest: false, transparent: true }));
        ball.renderOrder = 3;
        this.scene.add(ball);
        return ball;
      });
      for (const ground of structure.grounds) {
        const foot = new THREE.Mesh(new THREE.ConeGeometry(size * 1.3, size * 2.2, 4), new THREE.MeshLambertMaterial({ color: 0x555555 }));
        foot.position.set(...ground.at);
        foot.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), new THREE.Vector3(...structure.up));
        this.scene.add(foot);
      }
      this.props = structure.props.map(({ line, node }) => {
        const [head, foot] = line.map((place) => new THREE.Vector3(...place)), along = head.clone().sub(foot);
        const pole = new THREE.Mesh(new THREE.CylinderGeometry(size * 0.45, size * 0.45, Math.max(along.length(), 1e-9), 12), new THREE.MeshLambertMaterial({ color: PROP }));
        pole.position.copy(head).add(foot).multiplyScalar(0.5);
        pole.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
        this.scene.add(pole);
        return { pole, brick: structure.nodes[node].brick };
      });
      this.arrows = structure.grounds.map((ground) => {
        const arrow = new THREE.Group(), paint = new THREE.MeshBasicMaterial({ color: 0x222222, depthTest: false, transparent: true });
        const shaft = new THREE.Mesh(new THREE.CylinderGeometry(1, 1, 1, 8), paint), head = new THREE.Mesh(new THREE.ConeGeometry(1, 1, 12), paint);
        arrow.add(shaft, head);
        arrow.position.set(...ground.at);
        arrow.renderOrder = shaft.renderOrder = head.renderOrder = 4;
        arrow.visible = false;
        this.scene.add(arrow);
        return arrow;
      });
    }
    // the ground, and for each robot bars, joints and a base, of which as many are shown as its arm needs
    makeRobots() {
      const ground = new THREE.Mesh(new THREE.CylinderGeometry(yard, yard, radius * 0.004, 64), new THREE.MeshLambertMaterial({ color: 0xe9e4dc }));
      const up = new THREE.Vector3(...structure.up);
      ground.position.copy(middle).addScaledVector(up, structure.level - up.dot(middle) - radius * 0.006);
      ground.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), up);
      this.scene.add(ground);
      const bar = new THREE.CylinderGeometry(1, 1, 1, 12), ball = new THREE.SphereGeometry(1, 16, 12), cone = new THREE.CylinderGeometry(0.35, 1, 1, 12);
      this.reaches = structure.robots.filter(({ reach }) => reach && reach[3] > 0).map(({ reach, color }) => {
        const [x, y, z, wide] = reach, turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), up), ring = [];
        const at = (k) => new THREE.Vector3(Math.cos((k * Math.PI) / 60), 0, Math.sin((k * Math.PI) / 60)).multiplyScalar(wide).applyQuaternion(turn).add(new THREE.Vector3(x, y, z));
        for (let k = 0; k < 120; k += 1) ring.push(...at(k).toArray(), ...at(k + 1).toArray());
        const line = new THREE.BufferGeometry();
        line.setAttribute("position", new THREE.Float32BufferAttribute(new Float32Array(ring), 3));
        const circle = new THREE.LineSegments(line, new THREE.LineBasicMaterial({ color }));
        this.scene.add(circle);
        return circle;
      });
      const most = Math.max(2, ...builds.flatMap((build) => build.arms.lines.map((line) => line.length)));
      this.robots = structure.robots.map((robot) => {
        const paint = new THREE.MeshLambertMaterial({ color: robot.color, emissive: robot.color, emissiveIntensity: 0.4 }), dark = new THREE.MeshLambertMaterial({ color: 0x33312e });
        const group = new THREE.Group(), add = (shape, material) => { const mesh = new THREE.Mesh(shape, material); group.add(mesh); return mesh; };
        const bars = Array.from({ length: most - 1 }, () => add(bar, paint)), joints = Array.from({ length: most - 1 }, () => add(ball, dark));
        const foot = add(bar, dark), tool = add(cone, dark), name = document.createElement("span");
        name.className = "robot";
        name.style.color = robot.color;
        name.textContent = robot.words;
        this.box.append(name);
        this.scene.add(group);
        return { group, bars, joints, foot, tool, name, at: new THREE.Vector3() };
      });
    }
    // arms are drawn where their bricks are: wrist and tip move with what they hold
    showRobots(build, s, options) {
      const up = new THREE.Vector3(...structure.up), upright = new THREE.Vector3(0, 1, 0), thick = radius * 0.017;
      const between = (mesh, from, to, wide) => {
        const along = to.clone().sub(from), long = along.length();
        mesh.visible = long > 1e-6 * radius;
        mesh.position.copy(from).add(to).multiplyScalar(0.5);
        mesh.scale.set(wide, Math.max(long, 1e-9), wide);
        if (mesh.visible) mesh.quaternion.setFromUnitVectors(upright, along.divideScalar(long));
      };
      this.reaches.forEach((circle) => { circle.visible = options.robots; });
      this.robots.forEach(({ group, bars, joints, foot, tool, name, at }, r) => {
        const line = options.robots ? build.arms.lines[build.arms.at[s][r]] : undefined;
        group.visible = line !== undefined;
        name.hidden = !group.visible;
        if (!group.visible) return;
        const places = line.map((place) => new THREE.Vector3(...place)), last = places.length - 1, ball = this.grips[r];
        if (ball.visible) {
          const shift = ball.position.clone().sub(new THREE.Vector3(...structure.nodes[build.steps[s].grips[r]].at));
          places.slice(-2).forEach((place) => place.add(shift));
        }
        bars.forEach((mesh, k) => { mesh.visible = k < last - 1; if (mesh.visible) between(mesh, places[k], places[k + 1], thick * (k === 0 ? 1.5 : 1.1 - 0.15 * Math.min(k, 3))); });
        joints.forEach((mesh, k) => { mesh.visible = k > 0 && k < last; if (mesh.visible) { mesh.position.copy(places[k]); mesh.scale.setScalar(thick * 1.35); } });
        between(tool, places[last], places[last - 1], thick * 0.8);
        foot.visible = last > 1;
        if (foot.visible) between(foot, places[0], places[0].clone().addScaledVector(up, thick), thick * 3.5);
        at.copy(places[last > 1 ? 1 : 0]);
      });
      this.nameRobots();
    }
    nameRobots() {
      const { clientWidth: w, clientHeight: h } = this.box;
      this.robots.forEach(({ name, at }) => {
        if (name.hidden) return;
        const seen = at.clone().project(this.camera);
        name.style.left = `${Math.round((seen.x + 1) * w / 2)}px`;
        name.style.top = `${Math.round((1 - seen.y) * h / 2)}px`;
      });
    }
    // numbers of the bricks whose middles no other brick hides
    numberBricks() {
      const { clientWidth: w, clientHeight: h } = this.box, ratio = Math.min(window.devicePixelRatio, 2), pen = this.names.getContext("2d");
      this.names.width = w * ratio;
      this.names.height = h * ratio;
      Object.assign(this.names.style, { width: `${w}px`, height: `${h}px` });
      const mode = byId("numbers").value, bricks = this.bricks.filter(({ mesh }) => mesh.visible);
      if (!mode || !this.build || bricks.length > SEEN) return;
      pen.scale(ratio, ratio);
      const eye = this.camera.position, bodies = bricks.map(body);
      const taken = [];
      bodies.map((own) => [own.middle.distanceTo(eye), own]).sort((a, b) => a[0] - b[0]).forEach(([, own]) => {
        if (bodies.some((other) => other !== own && hides(other, eye, own.middle))) return;
        const i = structure.bricks.indexOf(own.brick), at = own.middle.clone().project(this.camera);
        const [x, y, words] = [((at.x + 1) * w) / 2, ((1 - at.y) * h) / 2 + 4, String(mode === "order" ? rank(this.build, i) + 1 : own.brick.name)];
        if (taken.some(([a, b]) => Math.abs(a - x) < 7 * words.length && Math.abs(b - y) < 11)) return;
        taken.push([x, y]);
        written(pen, words, x, y, "#222");
      });
    }
    // what is seen, with its names, as one picture
    picture() {
      const out = document.createElement("canvas"), pen = out.getContext("2d"), ratio = this.canvas.width / this.box.clientWidth;
      [out.width, out.height] = [this.canvas.width, this.canvas.height];
      pen.drawImage(this.canvas, 0, 0);
      pen.drawImage(this.names, 0, 0, out.width, out.height);
      pen.scale(ratio, ratio);
      this.robots.forEach(({ name }) => { if (!name.hidden) written(pen, name.textContent, parseFloat(name.style.left), parseFloat(name.style.top) - 18, name.style.color); });
      return out.toDataURL("image/png");
    }
    // an arrow ends where its ground end pushes
    showReactions(build, s, shown) {
      const forces = this.arrows.map((_, g) => new THREE.Vector3(...[0, 1, 2].map((k) => value(build.push, s, 3 * g + k))));
      const most = Math.max(1e-30, ...forces.map((force) => force.length()));
      this.arrows.forEach((arrow, g) => {
        const force = forces[g], long = radius * 0.28 * (force.length() / most), thin = radius * 0.007, tip = radius * 0.06;
        arrow.visible = shown && force.length() > 1e-6 * most;
        if (!arrow.visible) return;
        const [shaft, head] = arrow.children, size = Math.min(tip, long);
        shaft.scale.set(thin, Math.max(long - size, 1e-9), thin);
        shaft.position.set(0, -size - (long - size) / 2, 0);
        head.scale.set(0.45 * size, size, 0.45 * size);
        head.position.set(0, -size / 2, 0);
        arrow.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), force.clone().normalize());
      });
    }
    look() {
      const { center, side, far } = fit(this.camera);
      this.camera.position.copy(center).addScaledVector(side, far);
      this.controls.target.copy(center);
      this.controls.update();
    }
    resize() {
      const { clientWidth: w, clientHeight: h } = this.box;
      if (!w || !h) return;
      this.renderer.setSize(w, h, false);
      this.camera.aspect = w / h;
      this.camera.updateProjectionMatrix();
      if (!this.turned) this.look();
      this.draw();
    }
    moved(build, s, i, point, options, out) {
      const field = build.twist, by = options.magnify;
      const c = structure.bricks[i].center, t = [0, 1, 2, 3, 4, 5].map((k) => by * value(field, s, 6 * i + k));
      const r = [point[0] - c[0], point[1] - c[1], point[2] - c[2]];
      out[0] = point[0] + t[0] + t[4] * r[2] - t[5] * r[1];
      out[1] = point[1] + t[1] + t[5] * r[0] - t[3] * r[2];
      out[2] = point[2] + t[2] + t[3] * r[1] - t[4] * r[0];
      return out;
    }
    show(build, at, options) {
      const s = Math.min(at, build.steps.length - 1), step = build.steps[s], p = [0, 0, 0];
      this.build = build;
      this.tag.textContent = `${build.name}: step ${step.number}, ${happens(build, s)}`;
      this.tag.classList.toggle("over", build.marks[s] !== "");
      if (build.marks[s]) this.tag.append(`; ${build.marks[s]}`);
      this.canvas.setAttribute("aria-label", `${structure.name}, ${this.tag.textContent}, ${step.bricks} bricks`);
      this.bricks.forEach((own, i) => {
        const { brick, mesh, outline, places, rims } = own;
        mesh.visible = outline.visible = rank(build, i) < step.bricks;
        if (rank(build, i) >= step.bricks) return;
        const here = own.here = brick.corners.map((corner) => [...this.moved(build, s, i, corner, options, p)]);
        for (const [object, order] of [[mesh, places], [outline, rims]]) {
          const array = object.geometry.attributes.position.array;
          order.forEach((corner, k) => array.set(here[corner], 3 * k));
          object.geometry.attributes.position.needsUpdate = true;
        }
        mesh.geometry.computeVertexNormals();
        mesh.geometry.computeBoundingSphere();
        outline.geometry.computeBoundingSphere();
        mesh.material.color.set(step.kind === "place" && rank(build, i) === step.bricks - 1 ? NEW : CLAY);
        mesh.material.transparent = options.forces;
        mesh.material.opacity = options.forces ? 0.25 : 1;
      });
      this.edges.visible = options.forces && build.edge !== null;
      if (this.edges.visible) this.showForces(build, s, step, options);
      this.showReactions(build, s, options.forces);
      this.grips.forEach((ball, r) => {
        const node = step.grips[r];
        ball.visible = node !== null && node !== undefined;
        if (!ball.visible) return;
        const { at: place, brick } = structure.nodes[node];
        ball.position.set(...this.moved(build, s, brick, place, options, p));
      });
      const struck = step.bricks === structure.bricks.length && step.grips.every((node) => node === null);
      this.props.forEach(({ pole, brick }) => { pole.visible = !struck && rank(build, brick) < step.bricks; });
      this.showRobots(build, s, options);
      this.draw();
    }
    showForces(build, s, step, options) {
      let largest = 1e-30;
      structure.edges.forEach((_, e) => { largest = Math.max(largest, Math.abs(value(build.edge, s, e))); });
      const p = [0, 0, 0], tint = new THREE.Color(), pale = new THREE.Color(0xd8d8d8);
      const turn = new THREE.Quaternion(), whole = new THREE.Matrix4(), upright = new THREE.Vector3(0, 1, 0);
      structure.edges.forEach(([a, b, since], e) => {
        const [start, end] = [a, b].map((node) => {
          const point = structure.points[node], bricks = structure.carried[node].filter((i) => i < step.bricks);
          const at = new THREE.Vector3();
          bricks.forEach((i) => { this.moved(build, s, i, point, options, p); at.add(new THREE.Vector3(...p)); });
          return bricks.length ? at.divideScalar(bricks.length) : at.set(...point);
        });
        const force = value(build.edge, s, e), share = Math.abs(force) / largest;
        const along = end.clone().sub(start), length = along.length() || 1e-9;
        const thick = since <= step.bricks ? radius * (0.002 + 0.011 * Math.sqrt(share)) : 0;
        turn.setFromUnitVectors(upright, along.divideScalar(length));
        whole.compose(start.add(end).multiplyScalar(0.5), turn, new THREE.Vector3(thick, thick ? length : 0, thick));
        this.edges.setMatrixAt(e, whole);
        tint.set(force >= 0 ? TENSION : COMPRESSION).lerp(pale, 1 - Math.sqrt(share));
        this.edges.setColorAt(e, tint);
      });
      this.edges.instanceMatrix.needsUpdate = true;
      this.edges.instanceColor.needsUpdate = true;
    }
    draw() { this.renderer.render(this.scene, this.camera); if (this.robots) { this.nameRobots(); this.numberBricks(); } }
  }

  // blocks as bodies, and what hides what
  const SEEN = 200;
  const SHORT = 60;
  function flat(corners, face) {
    const [a, b, c] = face.map((i) => new THREE.Vector3(...corners[i]));
    return new THREE.Vector3().crossVectors(b.sub(a), c.sub(a)).normalize();
  }
  function body({ brick, here, places }) {
    const points = here.map((place) => new THREE.Vector3(...place)), middle = points.reduce((sum, p) => sum.add(p), new THREE.Vector3()).divideScalar(points.length);
    return { brick, points, places, middle, size: Math.max(...points.map((p) => p.distanceTo(middle))) };
  }
  function hides({ points, places, middle, size }, eye, target) {
    const ray = target.clone().sub(eye), along = middle.clone().sub(eye).dot(ray) / ray.dot(ray);
    if (along < 0 || along > 1.2 || eye.clone().addScaledVector(ray, along).distanceTo(middle) > size) return false;
    for (let k = 0; k < places.length; k += 3) {
      const [a, b, c] = [points[places[k]], points[places[k + 1]], points[places[k + 2]]];
      const u = b.clone().sub(a), v = c.clone().sub(a), p = new THREE.Vector3().crossVectors(ray, v), det = u.dot(p);
      if (Math.abs(det) < 1e-15) continue;
      const t = eye.clone().sub(a), x = t.dot(p) / det, q = t.cross(u), y = ray.dot(q) / det, far = v.dot(q) / det;
      if (x >= 0 && y >= 0 && x + y <= 1 && far > 0 && far < 0.995) return true;
    }
    return false;
  }
  function written(pen, words, x, y, color) {
    Object.assign(pen, { font: "600 12px system-ui, sans-serif", textAlign: "center", lineWidth: 3, strokeStyle: "rgb(255 255 255 / 85%)", fillStyle: color, lineJoin: "round" });
    pen.strokeText(words, x, y);
    pen.fillText(words, x, y);
  }

  // where everything is
  const corners = structure.bricks.flatMap((brick) => brick.corners).map((c) => new THREE.Vector3(...c));
  const around = new THREE.Box3().setFromPoints(corners).getBoundingSphere(new THREE.Sphere());
  const middle = around.center, radius = around.radius || 1;
  const stands = builds.flatMap((build) => build.arms.lines).flat().map((place) => new THREE.Vector3(...place));
  // from where all is seen at first: the structure, and its robots unless these make it small
  function fit(camera) {
    const up = new THREE.Vector3(...structure.up);
    const side = (Math.abs(up.z) > 0.9 ? new THREE.Vector3(0.35, -1, 0.3) : new THREE.Vector3(1, 0.4, 0.5)).normalize();
    const right = new THREE.Vector3().crossVectors(up, side).normalize(), above = new THREE.Vector3().crossVectors(side, right);
    const high = 0.88 * Math.tan(((camera.fov / 2) * Math.PI) / 180), wide = high * camera.aspect;
    const from = (points) => {
      const reaches = [right, above].map((axis) => points.map((p) => p.dot(axis))), ends = reaches.map((r) => [Math.min(...r), Math.max(...r)]);
      const center = new THREE.Vector3(), depth = points.reduce((sum, p) => sum + p.dot(side), 0) / points.length;
      [right, above].forEach((axis, k) => center.addScaledVector(axis, (ends[k][0] + ends[k][1]) / 2));
      center.addScaledVector(side, depth);
      const far = Math.max(...points.map((p) => { const q = p.clone().sub(center); return q.dot(side) + Math.max(Math.abs(q.dot(right)) / wide, Math.abs(q.dot(above)) / high); }));
      return { center, side, far: far || 3 * radius };
    };
    const own = from(corners), all = from([...corners, ...stands]);
    return all.far <= 2.6 * own.far ? all : { ...own, far: 2.6 * own.far };
  }
  const yard = 1.05 * Math.max(radius, ...stands.map((place) => place.distanceTo(middle)));
  const panes = [];
  let mirroring = false;
  function mirror(from) {
    if (mirroring) return;
    mirroring = true;
    for (const pane of panes) {
      if (pane === from) continue;
      pane.camera.position.copy(from.camera.position);
      pane.controls.target.copy(from.controls.target);
      pane.controls.update();
      pane.draw();
    }
    mirroring = false;
  }

  // what is read of a step
  const rank = (build, i) => (build.rank ? build.rank[i] : i);  // how many bricks stand before one
  const column = (build, name) => build.columns.indexOf(name);
  function number(build, s, name) {
    const i = column(build, name);
    return i < 0 || build.rows[s][i] === "" ? null : Number(build.rows[s][i]);
  }
  function largest(build, s) {
    const forces = build.forces.map((name) => number(build, s, name)).filter((f) => f !== null).map(Math.abs);
    return forces.length ? Math.max(...forces) : null;
  }
  const responseAt = (build, s, name) => (name === "F_largest" ? largest(build, s) : number(build, s, name));
  const text = (tag, content, name) => { const e = document.createElement(tag); e.textContent = content; if (name) e.className = name; return e; };

  function happens(build, s) {
    const step = build.steps[s], newest = structure.bricks.find((_, i) => rank(build, i) === step.bricks - (step.kind === "remove" ? 0 : 1));
    const before = s ? build.steps[s - 1].grips : step.number === 1 ? step.grips.map(() => null) : step.grips;
    const who = (own) => structure.robots.filter((_, r) => before[r] !== step.grips[r] && own(step.grips[r])).map((robot) => robot.words).join(", ").replace(/, ([^,]*)$/, " and $1");
    const taker = who((node) => node !== null && (step.kind !== "place" || structure.bricks[structure.nodes[node].brick] === newest));
    if (step.kind === "place") return `brick ${newest.name} is placed${taker ? ` by ${taker}` : ""}`;
    if (step.kind === "remove") return `brick ${newest.name} is taken away`;
    const leaver = who((node) => node === null) || "a robot";
    if (step.kind === "release") return `${leaver} ${leaver.includes(" and ") ? "let" : "lets"} go`;
    return `${taker || "a robot"} takes a new grip`;
  }
  const share = (build, s, r) => Math.abs(number(build, s, build.forces[r]) || 0) / structure.robots[r].payload;
  const percent = (v) => `${Math.round(100 * v)} %`;
  const held = (step, r) => (step.grips[r] === null ? "–" : structure.bricks[structure.nodes[step.grips[r]].brick].name);
  function table(build, at) {
    const s = Math.min(at, build.steps.length - 1), step = build.steps[s], out = document.createElement("div"), what = happens(build, s);
    out.append(text("h2", `${build.name}, step ${step.number} of ${build.steps.length}`));
    if (s === build.decides) out.append(text("p", build.marks[s] ? "The step that decides: the first where something is wrong." : "The step that decides: the worst of all.", "hint"));
    out.append(text("p", `${what[0].toUpperCase()}${what.slice(1)}; ${step.bricks} of ${structure.bricks.length} bricks stand.` + (build.stands[s] ? ` It ${build.stands[s]}.` : "")));
    if (build.marks[s]) out.append(text("p", build.marks[s], "over"));
    const grips = document.createElement("table"), rows = document.createElement("table");
    grips.innerHTML = "<tr><th>robot</th><th>brick</th><th>node</th><th>force, N</th><th>of payload</th></tr>";
    structure.robots.forEach((robot, r) => {
      const row = document.createElement("tr"), name = document.createElement("td"), swatch = text("span", "", "swatch");
      swatch.style.background = robot.color;
      name.append(swatch, robot.words);
      const node = step.grips[r], force = build.rows[s][column(build, build.forces[r])], over = force !== "" && Math.abs(Number(force)) > robot.payload ? "over" : "";
      row.append(name, text("td", node === null ? "idle" : held(step, r)), text("td", node === null ? "–" : node));
      row.append(text("td", force === "" ? "–" : plain(force), over), text("td", force === "" ? "–" : percent(share(build, s, r)), over));
      grips.append(row);
    });
    build.columns.forEach((name, i) => {
      if (["step", "type", "bricks"].includes(name) || /_(node|brick)$|_sup_\d/.test(name) || build.forces.includes(name) || build.rows[s][i] === "") return;
      const row = document.createElement("tr"), bound = build.bounds[name];
      row.append(text("td", WORDS[name] || name));
      row.append(text("td", shownValue(name, build.rows[s][i]), bound !== undefined && Number(build.rows[s][i]) > bound ? "over" : ""));
      rows.append(row);
    });
    out.append(grips, rows, ...supports(build, s));
    return out;
  }
  // force and moment that each ground end exerts
  function supports(build, s) {
    const size = (field, g) => Math.hypot(...[0, 1, 2].map((k) => value(field, s, 3 * g + k)));
    const acting = structure.grounds.map((_, g) => g).filter((g) => size(build.push, g) > 0);
    if (!build.push || !acting.length || acting.length > 8) return [];
    const out = document.createElement("table");
    out.innerHTML = "<tr><th>support at brick</th><th>force, N</th><th>moment, N m</th></tr>";
    for (const g of acting) {
      const row = document.createElement("tr");
      row.append(text("td", structure.grounds[g].brick), text("td", plain(size(build.push, g).toPrecision(3))), text("td", plain(size(build.turn, g).toPrecision(3))));
      out.append(row);
    }
    return [out];
  }

  // controls
  const slider = byId("step");
  let timer = null;
  const shown = () => [builds[byId("first").value], byId("second").value === "" ? null : builds[byId("second").value]].filter(Boolean);
  const options = () => ({ magnify: Number(byId("magnify").value) || 0, forces: byId("forces").checked, robots: byId("robots").checked });
  function refresh() {
    const pair = shown(), at = Number(slider.value);
    slider.max = Math.max(...pair.map((build) => build.steps.length)) - 1;
    while (panes.length < pair.length) panes.push(new Pane(byId("panes")));
    panes.forEach((pane, i) => { pane.box.hidden = i >= pair.length; pane.box.style.display = i < pair.length ? "" : "none"; });
    pair.forEach((build, i) => panes[i].show(build, at, options()));
    byId("where").textContent = `step ${at + 1} of ${Number(slider.max) + 1}`;
    byId("now").replaceChildren(...pair.map((build) => table(build, at)));
    marking.forEach((mark) => mark(at));
    charts.cursors.forEach((move) => move(at));
    if (points) points.mark();
    if (window.parent !== window) window.parent.postMessage({ seqopt: { step: at + 1, build: pair[0].name } }, "*");  // to a widget
  }
  let moved = false;  // by whom looks at it
  function go(s) {
    slider.max = Math.max(...shown().map((build) => build.steps.length)) - 1;
    slider.value = Math.max(0, Math.min(Number(slider.max), s));
    refresh();
  }
  function pause() { clearInterval(timer); timer = null; byId("play").textContent = "play"; }
  function play() {
    if (timer) return pause();
    if (Number(slider.value) >= Number(slider.max)) go(0);
    byId("play").textContent = "pause";
    timer = setInterval(() => { if (Number(slider.value) >= Number(slider.max)) pause(); else go(Number(slider.value) + 1); }, 450);
  }
  const charts = makeCharts({ structure, builds, shown, number, rank, responseAt, text, go, choose, happens, share, percent, held, plain, length });
  const marking = [];
  // what is said of the build that is chosen
  function about() {
    const [build] = shown(), whole = byId("sentence").textContent;
    byId("about").textContent = whole.startsWith(build.sentence) ? "" : build.sentence[0].toUpperCase() + build.sentence.slice(1);
    byId("use").replaceChildren(charts.use(build));
    byId("strip").replaceChildren(...charts.strip(build, marking));
    byId("steps").replaceChildren(charts.list(build, marking));
  }
  const points = data.scatter && charts.scatter(data.scatter);
  function drawCharts() {
    charts.cursors.length = marking.length = 0;
    about();
    const grid = document.createElement("div");
    grid.className = "grid";
    for (const [name, title] of Object.entries(responses)) grid.append(charts.lines(name, title));
    const parts = [...shown().map(charts.gantt), ...(builds.length > 1 ? [charts.legend()] : []), grid];
    byId("charts").replaceChildren(...(points ? [points] : []), ...parts);
  }

  // rows that name a build show it
  function choose(name, step = 0) {
    const i = builds.findIndex((build) => build.name === name);
    byId("first").value = i;
    drawCharts();
    if (moved && !step) refresh();
    else go(step ? step - 1 : builds[i].decides);
    for (const row of document.querySelectorAll("#tables tr[data-build]")) row.classList.toggle("chosen", row.dataset.build === name);
  }
  for (const row of document.querySelectorAll("#tables tbody tr")) {
    const cell = row.cells[0], name = cell ? cell.textContent : "";
    if (!builds.some((build) => build.name === name)) continue;
    const button = text("button", name, "link");
    button.type = "button";
    button.addEventListener("click", () => choose(name));
    cell.replaceChildren(button);
    row.dataset.build = name;
  }

  byId("name").textContent = `${structure.name}, step by step`;
  byId("note").textContent = data.note;
  byId("sentence").classList.toggle("wrong", /^(Not buildable|Outside)/.test(byId("sentence").textContent));
  builds.forEach((build, i) => {
    byId("first").append(new Option(build.name, i));
    byId("second").append(new Option(build.name, i));
  });
  byId("second").prepend(new Option("nothing", "", true, true));
  byId("second").value = "";
  await Promise.all(builds.flatMap((build) => ["twist", "edge", "push", "turn"].map((name) => unpack(build[name]))));
  for (const id of ["first", "second"]) byId(id).addEventListener("change", () => { drawCharts(); refresh(); });
  for (const id of ["magnify", "forces", "robots"]) byId(id).addEventListener("input", refresh);
  byId("tables").classList.toggle("long", document.querySelectorAll("#tables figure:first-child tr").length > 9);
  byId("numbers").value = structure.bricks.length > SHORT ? "" : "names";
  byId("numbers").addEventListener("input", () => panes.forEach((pane) => pane.draw()));
  slider.addEventListener("input", () => { moved = true; refresh(); });
  const step = (by) => { moved = true; go(Number(slider.value) + by); };
  byId("back").addEventListener("click", () => step(-1));
  byId("on").addEventListener("click", () => step(1));
  // canvases are not printed everywhere: a picture of what is seen is
  function pictured() {
    byId("picture").src = panes[0].picture();
    byId("picture").alt = panes[0].canvas.getAttribute("aria-label");
  }
  window.addEventListener("beforeprint", pictured);
  byId("print").addEventListener("click", () => window.print());
  byId("play").addEventListener("click", play);
  byId("save").addEventListener("click", () => {
    const link = document.createElement("a");
    link.download = `${structure.name} step ${Number(slider.value) + 1}.png`;
    link.href = panes[0].picture();
    link.click();
  });
  document.addEventListener("keydown", (event) => {
    if (["SELECT", "INPUT", "BUTTON"].includes(event.target.tagName) && event.target !== slider) return;
    const keys = { ArrowLeft: () => step(-1), ArrowRight: () => step(1), Home: () => go(0), End: () => go(Number(slider.max)), " ": play };
    if (keys[event.key]) { event.preventDefault(); keys[event.key](); }
  });
  window.addEventListener("message", ({ source, data }) => {
    if (source !== window.parent || !data?.seqopt) return;
    const { step, build } = data.seqopt;
    if (step) moved = true;
    if (builds.some(({ name }) => name === build) && build !== shown()[0].name) choose(build, step);
    else if (step) go(step - 1);
  });
  const asked = new URLSearchParams(location.hash.slice(1));
  if (asked.has("build")) byId("first").value = Math.max(0, builds.findIndex((build) => build.name === asked.get("build")));
  if (asked.has("beside")) byId("second").value = builds.findIndex((build) => build.name === asked.get("beside"));
  if (asked.has("magnify")) byId("magnify").value = asked.get("magnify");
  byId("forces").checked = asked.has("forces");
  byId("robots").checked = asked.get("robots") !== "off";
  drawCharts();
  moved = asked.has("step");
  go(moved ? Number(asked.get("step")) - 1 : shown()[0].decides);
  pictured();
  document.body.dataset.ready = "true";
})();
