"use strict";
// names of bricks, nodes at which robots can hold, and reaches: on the page of a scene alone
function makeMarks(structure, redraw) {
  const { nodes, reaches } = structure.marks;
  const shown = { names: structure.bricks.length <= 60, nodes: true, reaches: true };
  const row = document.createElement("div");
  row.className = "row";
  for (const kind of Object.keys(shown)) {
    const label = document.createElement("label"), box = document.createElement("input");
    box.type = "checkbox";
    box.id = `show-${kind}`;
    box.checked = shown[kind];
    box.addEventListener("input", () => { shown[kind] = box.checked; redraw(); });
    label.append(box, ` ${{ names: "names of bricks", nodes: "nodes (in the color of the robot that alone reaches it; black: several do; red: nobody)", reaches: "reaches" }[kind]}`);
    row.append(label);
  }
  document.getElementById("controls").prepend(row);
  for (const id of ["first", "second", "magnify", "forces"]) document.getElementById(id).parentElement.hidden = true;  // of builds
  document.body.classList.add("scene");
  document.querySelector("main").append(document.getElementById("tables").lastElementChild);
  const paint = (color) => new THREE.MeshBasicMaterial({ color, transparent: true, opacity: 0.1, side: THREE.DoubleSide, depthWrite: false });
  const reachOf = ({ center, radius, plane, color }) => {
    if (center) {
      const ball = new THREE.Group(), round = new THREE.SphereGeometry(radius, 32, 20);
      const ring = new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(circles(radius)), new THREE.LineBasicMaterial({ color }));
      ball.add(new THREE.Mesh(round, paint(color)), ring);
      ball.position.set(...center);
      return ball;
    }
    const flat = new THREE.BufferGeometry().setFromPoints(plane.map((p) => new THREE.Vector3(...p)));
    flat.setIndex([0, 1, 2, 0, 2, 3]);
    return new THREE.Mesh(flat, paint(color));
  };
  const circles = (radius) => {
    const out = [], at = (k) => { const a = (2 * Math.PI * k) / 48; return [radius * Math.cos(a), radius * Math.sin(a)]; };
    for (let k = 0; k < 48; k += 1) for (const p of [at(k), at(k + 1)]) out.push(new THREE.Vector3(p[0], p[1], 0));
    for (let k = 0; k < 48; k += 1) for (const p of [at(k), at(k + 1)]) out.push(new THREE.Vector3(p[0], 0, p[1]));
    return out;
  };
  return (pane, size) => {
    const names = structure.bricks.map((brick) => {
      const span = document.createElement("span");
      span.className = "brick";
      span.textContent = brick.name;
      pane.box.append(span);
      return span;
    });
    const dot = new THREE.SphereGeometry(size * 0.42, 12, 8), lost = new THREE.SphereGeometry(size * 0.6, 12, 8);
    const balls = nodes.map(({ at, brick, color }) => {
      const mesh = new THREE.Mesh(color ? dot : lost, new THREE.MeshBasicMaterial({ color: color || "#c8102e", depthTest: false, transparent: true }));
      mesh.position.set(...at);
      mesh.renderOrder = 3;
      pane.scene.add(mesh);
      return { mesh, brick };
    });
    const areas = reaches.map(reachOf);
    areas.forEach((area) => pane.scene.add(area));
    let count = structure.bricks.length;
    return {
      show(bricks) {
        count = bricks;
        balls.forEach(({ mesh, brick }) => { mesh.visible = shown.nodes && brick < count; });
        areas.forEach((area) => { area.visible = shown.reaches; });
      },
      place() {
        const { clientWidth: w, clientHeight: h } = pane.box;
        names.forEach((span, i) => {
          span.hidden = !shown.names || i >= count;
          if (span.hidden) return;
          const seen = new THREE.Vector3(...structure.bricks[i].center).project(pane.camera);
          span.style.left = `${Math.round((seen.x + 1) * w / 2)}px`;
          span.style.top = `${Math.round((1 - seen.y) * h / 2)}px`;
        });
      },
    };
  };
}
