"use strict";
// What is drawn along the build, and a point for each build. `page` holds the data and what the viewer does.
function makeCharts(page) {
  const { structure, builds, shown, number, rank, responseAt, text, go, choose, happens, share, percent, held, plain, length } = page;
  const SVG = "http://www.w3.org/2000/svg";
  function draw(tag, attributes, parent, content) {
    const e = document.createElementNS(SVG, tag);
    for (const [key, v] of Object.entries(attributes)) e.setAttribute(key, v);
    if (content !== undefined) e.textContent = content;
    parent.append(e);
    return e;
  }
  const cursors = [];
  function frame(title, width, height, left, steps) {
    const box = document.createElement("div");
    box.className = "chart";
    const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "img", "aria-label": title }, box);
    draw("text", { x: left, y: 13, class: "title" }, svg, title);
    const x = (s) => left + ((s + 0.5) * (width - left - 10)) / steps;
    const cursor = draw("line", { class: "cursor", y1: 18, y2: height - 18 }, svg);
    cursors.push((s) => { const at = x(Math.min(s, steps - 1)); cursor.setAttribute("x1", at); cursor.setAttribute("x2", at); });
    svg.classList.add("hit");
    svg.addEventListener("click", (event) => {
      const at = (event.clientX - svg.getBoundingClientRect().left) * (width / svg.getBoundingClientRect().width);
      go(Math.floor(((at - left) * steps) / (width - left - 10)));
    });
    draw("text", { x: width - 10, y: height - 4, "text-anchor": "end" }, svg, `step ${steps}`);
    draw("text", { x: left, y: height - 4 }, svg, "step 1");
    return { box, svg, x, cursor };
  }
  function gantt(build) {
    const steps = build.steps.length, rows = structure.robots.length, width = Math.max(1180, 8.5 * steps), height = 40 + 26 * rows, left = 70;
    const { box, svg, x, cursor } = frame(`${build.name}: which brick each robot holds; darker where it carries more; a white dot where it places the brick${build.marks.some(Boolean) ? "; red below: over payload or outside the linear range" : ""}`, width, height, left, steps);
    const most = Math.max(1e-30, ...build.steps.flatMap((_, s) => build.forces.map((name) => Math.abs(number(build, s, name) || 0))));
    structure.robots.forEach((robot, r) => {
      const y = 22 + 26 * r;
      draw("text", { x: left - 6, y: y + 14, "text-anchor": "end" }, svg, robot.words);
      let s = 0;
      while (s < steps) {
        const node = build.steps[s].grips[r];
        let end = s;
        while (end + 1 < steps && build.steps[end + 1].grips[r] === node) end += 1;
        if (node !== null) {
          for (let k = s; k <= end; k += 1) {
            const share = Math.abs(number(build, k, build.forces[r]) || 0) / most;
            draw("rect", { x: x(k - 0.5), y, width: x(1) - x(0) + 0.3, height: 20, fill: robot.color, "fill-opacity": 0.15 + 0.85 * share }, svg);
          }
          const name = structure.bricks[structure.nodes[node].brick].name, span = x(end + 0.5) - x(s - 0.5);
          const mine = draw("rect", { x: x(s - 0.5), y, width: span, height: 20, fill: "none", stroke: "#222", "stroke-width": 0.7 }, svg);
          draw("title", {}, mine, `${robot.words} holds brick ${name} at node ${node}, steps ${build.steps[s].number} to ${build.steps[end].number}`);
          const places = build.steps[s].kind === "place" && rank(build, structure.nodes[node].brick) === build.steps[s].bricks - 1;
          if (places) {
            const dot = draw("circle", { cx: x(s), cy: y + 10, r: 3.2, fill: "#fff", stroke: "#222" }, svg);
            draw("title", {}, dot, `${robot.words} places brick ${name} in step ${build.steps[s].number}`);
          }
          const half = 4 * String(name).length + 1, mid = Math.max(x(s - 0.5) + span / 2, places ? x(s) + 5 + half : 0);  // beside its dot
          if (mid + half < x(end + 0.5)) {
            draw("rect", { x: mid - half, y: y + 4, width: 2 * half, height: 13, fill: "#fff", "fill-opacity": 0.85, rx: 2 }, svg);
            draw("text", { x: mid, y: y + 14.5, "text-anchor": "middle" }, svg, name);
          }
        }
        s = end + 1;
      }
    });
    build.marks.forEach((mark, k) => {
      if (mark) draw("title", {}, draw("rect", { class: "marked", x: x(k - 0.5), y: height - 17, width: x(1) - x(0) + 0.3, height: 4 }, svg), mark);
    });
    svg.append(cursor);
    box.classList.add("wide");
    svg.style.minWidth = `${0.7 * width}px`;
    return box;
  }
  const STYLES = [["#1f5fa8", ""], ["#c8102e", "6 3"], ["#0b7a75", "2 2"], ["#7b2d8b", "8 3 2 3"], ["#8a5a00", "4 4"], ["#444", "1 3"]];
  // lines of at most so many builds: those shown, then the first others
  const MOST = 6;
  const drawn = () => [...new Set([...shown(), ...(builds.length > MOST ? [] : builds)])];
  function lines(name, title) {
    const builds = drawn(), steps = Math.max(...builds.map((b) => b.steps.length)), width = 430, height = 190, left = 44;
    let values = builds.map((build) => build.steps.map((_, s) => responseAt(build, s, name)));
    const far = name.startsWith("D_") && Math.max(...values.flat()) >= 1000;  // then in mm
    if (far) values = values.map((own) => own.map((v) => (v === null ? null : v / 1000)));
    const { box, svg, x, cursor } = frame(far ? title.replace("µm", "mm") : title, width, height, left, steps);
    const bound = builds.map((build) => build.bounds[name]).find((b) => b !== undefined);
    const top = 1.06 * Math.max(1e-12, bound || 0, ...values.flat().filter((v) => v !== null));
    const y = (v) => height - 18 - (Math.max(v, 0) / top) * (height - 40);
    for (const share of [0, 0.5, 1]) {
      draw("line", { class: "axis", x1: left, x2: width - 10, y1: y((share * top) / 1.06), y2: y((share * top) / 1.06), "stroke-opacity": share ? 0.25 : 1 }, svg);
      draw("text", { x: left - 5, y: y((share * top) / 1.06) + 4, "text-anchor": "end" }, svg, plain(((share * top) / 1.06).toPrecision(3)));
    }
    if (bound) draw("line", { x1: left, x2: width - 10, y1: y(bound), y2: y(bound), stroke: "#a40018", "stroke-dasharray": "3 3" }, svg);
    builds.forEach((build, b) => {
      const [color, dash] = STYLES[b % STYLES.length];
      const points = values[b].map((v, s) => (v === null ? null : `${x(s)},${y(v)}`)).filter(Boolean).join(" ");
      draw("polyline", { points, fill: "none", stroke: color, "stroke-width": 1.5, "stroke-dasharray": dash }, svg);
    });
    svg.append(cursor);
    return box;
  }
  function legend() {
    const out = document.createElement("p"), builds = drawn();
    builds.forEach((build, b) => {
      const [color, dash] = STYLES[b % STYLES.length], svg = document.createElementNS(SVG, "svg"), span = document.createElement("span");
      svg.setAttribute("width", 34); svg.setAttribute("height", 10);
      draw("line", { x1: 2, x2: 30, y1: 5, y2: 5, stroke: color, "stroke-width": 2, "stroke-dasharray": dash }, svg);
      span.className = "key";
      span.append(svg, " " + build.name);
      out.append(span);
    });
    return out;
  }

  // how much of its payload each robot uses
  function use(build) {
    const out = document.createElement("table");
    out.innerHTML = "<tr><th>robot</th><th>payload, N</th><th>largest force, N</th><th>of payload</th><th>in step</th></tr>";
    structure.robots.forEach((robot, r) => {
      const row = document.createElement("tr"), name = document.createElement("td"), swatch = text("span", "", "swatch");
      const all = build.steps.map((_, s) => share(build, s, r)), most = Math.max(...all), s = all.indexOf(most), over = most > 1 ? "over" : "";
      swatch.style.background = robot.color;
      name.append(swatch, robot.words);
      row.append(name, text("td", plain(robot.payload.toPrecision(4))));
      const cells = build.steps.some((step) => step.grips[r] !== null) ? [plain((most * robot.payload).toPrecision(4)), percent(most), linked(build, s)] : ["idle", "–", "–"];
      row.append(...cells.map((cell) => { const td = text("td", "", over); td.append(cell); return td; }));
      out.append(row);
    });
    return out;
  }
  function linked(build, s) {
    const button = text("button", build.steps[s].number, "link");
    button.type = "button";
    button.addEventListener("click", () => go(s));
    return button;
  }
  // what is wrong with each step, and whether it stands, along the slider
  const LOOKS = { stands: "good", falls: "bad", "is undecided": "open" };
  function strip(build, marking) {
    const steps = build.steps.length, over = build.steps.map((_, s) => (structure.robots.some((_, r) => share(build, s, r) > 1 + 1e-9) ? "bad" : "good"));
    const left = build.marks.map((mark) => (mark.includes("linear range") ? "bad" : "good"));
    const rows = [["payload", over, "exceeded"], ...(left.includes("bad") ? [["linear range", left, "exceeded"]] : []), ...build.verdicts.map(({ how, of }) => [how, of.map((word) => LOOKS[word]), "fall"])];
    return rows.flatMap(([name, looks, wrong]) => {
      const bad = looks.filter((look) => look === "bad").length, open = looks.filter((look) => look === "open").length;
      const said = [bad ? `${plain(bad)} of ${plain(steps)} ${wrong === "fall" ? (bad === 1 ? "falls" : "fall") : "exceeded"}` : "", open ? `${plain(open)} not known` : ""].filter(Boolean).join(", ");
      const label = text("span", `${name}: ${said || (wrong === "fall" ? "every step stands" : "every step within")}`, bad ? "over" : "");
      if (bad) label.append(", first in step ", linked(build, looks.indexOf("bad")));
      const svg = document.createElementNS(SVG, "svg");
      for (const [key, v] of Object.entries({ viewBox: `0 0 ${steps} 10`, preserveAspectRatio: "none", role: "img", "aria-label": label.textContent })) svg.setAttribute(key, v);
      for (let s = 0, end; s < steps; s = end) {
        for (end = s + 1; end < steps && looks[end] === looks[s]; end += 1);
        draw("rect", { x: s, y: looks[s] === "good" ? 3 : 0, width: end - s, height: looks[s] === "good" ? 4 : 10, class: looks[s] }, svg);
      }
      const here = draw("rect", { y: 0, width: Math.max(1, steps / 300) / 2, height: 10, fill: "#222" }, svg);
      marking.push((at) => here.setAttribute("x", Math.min(at, steps - 1) + 0.25));
      svg.addEventListener("click", (event) => { const { left, width } = svg.getBoundingClientRect(); go(Math.floor(((event.clientX - left) / width) * steps)); });
      return [label, svg];
    });
  }
  // every step in a row
  const OPENED = 400;
  function list(build, marking) {
    const out = document.createElement("details"), box = document.createElement("div"), table = document.createElement("table"), rows = [];
    out.append(text("summary", `Every step: what happens, which brick each robot holds with which share of its payload, and whether it stands`), box);
    box.className = "scroll";
    box.tabIndex = 0;
    const head = document.createElement("tr");
    head.append(...["step", "what happens", ...structure.robots.map((robot) => robot.words), ...build.verdicts.map(({ how }) => how)].map((name) => text("th", name)));
    function fill() {
      if (!out.open || rows.length) return;
      table.append(head);
      build.steps.forEach((step, s) => {
        const row = document.createElement("tr"), first = document.createElement("td");
        first.append(linked(build, s));
        row.append(first, text("td", happens(build, s)));
        structure.robots.forEach((_, r) => row.append(text("td", step.grips[r] === null ? "–" : `${held(step, r)}, ${percent(share(build, s, r))}`, share(build, s, r) > 1 ? "over" : "")));
        build.verdicts.forEach(({ of }) => row.append(text("td", of[s] === "is undecided" ? "not known" : of[s], of[s] === "falls" ? "over" : "")));
        row.dataset.step = step.number;
        row.addEventListener("click", () => go(s));
        rows.push(row);
      });
      table.append(...rows);
      box.append(table);
    }
    out.addEventListener("toggle", fill);
    out.open = build.steps.length <= OPENED;
    fill();
    marking.push((at) => rows.forEach((row, s) => {
      if (row.classList.toggle("chosen", s === at)) box.scrollTop = row.offsetTop - box.clientHeight / 2;
    }));
    return out;
  }

  // a point for each build, on axes that can be chosen
  function ticks(low, high) {
    const out = [];
    const rough = (high - low) / 4 || 1, power = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 5, 10].map((n) => n * power).find((v) => v >= rough);
    for (let v = Math.ceil(low / step) * step; v <= high + 1e-9 * step; v += step) out.push(Number(v.toPrecision(12)));
    return out;
  }
  function axis(data, name, other, from, to) {
    const known = data.values[name].filter((v, i) => v !== null && data.values[other][i] !== null);
    let low = Math.min(...known), high = Math.max(...known);
    const room = 0.08 * (high - low) || 0.08 * Math.abs(high) || 1;
    [low, high] = [low - room, high + room];
    return { at: (v) => from + ((v - low) / (high - low)) * (to - from), ticks: ticks(low, high) };
  }
  // the name stands above its point, higher where another name is in the way
  const FEW = 16, LINE = 14;
  function name_point(svg, taken, x, y, name, right) {
    const wide = 6.4 * name.length, left = Math.min(x + 4, right - wide);
    let low = y - 11;
    const crossing = () => taken.some(([l, r, at]) => l < left + wide + 4 && r > left - 4 && Math.abs(at - low) < LINE);
    while (crossing()) low -= LINE;
    taken.push([left, left + wide, low]);
    draw("line", { x1: x, y1: y - 6, x2: left, y2: low + 3, stroke: "#8a8580", "stroke-width": 0.7 }, svg);
    draw("text", { x: left, y: low }, svg, name);
  }
  function scatter(data) {
    const out = document.createElement("div"), pick = document.createElement("p"), place = document.createElement("div");
    const axes = ["across", "up"].map((way, k) => {
      const select = document.createElement("select"), label = text("label", `${way} `);
      data.axes.forEach((name, i) => select.append(new Option(name, name, i === k, i === k)));
      select.addEventListener("change", redraw);
      label.append(select);
      if (data.axes.length > 2) pick.append(label, " ");
      return select;
    });
    function redraw() {
      const width = 700, height = 330, left = 70, bottom = height - 46;
      const box = document.createElement("div");
      box.className = "chart";
      const svg = draw("svg", { viewBox: `0 0 ${width} ${height}`, role: "group", "aria-label": data.title }, box);
      draw("text", { x: left, y: 14, class: "title" }, svg, data.title);
      const [across, up] = axes.map((select) => select.value);
      const x = axis(data, across, up, left, width - 20), y = axis(data, up, across, bottom, 26);
      draw("line", { class: "axis", x1: left, x2: width - 20, y1: bottom, y2: bottom }, svg);
      draw("line", { class: "axis", x1: left, x2: left, y1: 26, y2: bottom }, svg);
      x.ticks.forEach((v) => draw("text", { x: x.at(v), y: bottom + 16, "text-anchor": "middle" }, svg, plain(v.toPrecision(4))));
      y.ticks.forEach((v) => {
        draw("line", { class: "axis", x1: left, x2: width - 20, y1: y.at(v), y2: y.at(v), "stroke-opacity": 0.25 }, svg);
        draw("text", { x: left - 6, y: y.at(v) + 4, "text-anchor": "end" }, svg, plain(v.toPrecision(4)));
      });
      draw("text", { x: (left + width) / 2, y: height - 8, "text-anchor": "middle" }, svg, across);
      draw("text", { x: 14, y: (26 + bottom) / 2, "text-anchor": "middle", transform: `rotate(-90 14 ${(26 + bottom) / 2})` }, svg, up);
      const taken = [];
      data.builds.forEach((name, i) => {
        const [a, b] = [data.values[across][i], data.values[up][i]];
        if (a === null || b === null) return;
        const point = draw("circle", { cx: x.at(a), cy: y.at(b), r: 6, class: "point", "data-build": name, tabindex: 0, role: "button", "aria-label": `${name}: ${across} ${plain(a)}, ${up} ${plain(b)}` }, svg);
        draw("title", {}, point, `${name}: ${plain(a.toPrecision(4))}, ${plain(b.toPrecision(4))}`);
        const chosen = () => choose(name);
        point.addEventListener("click", chosen);
        point.addEventListener("keydown", (event) => { if (["Enter", " "].includes(event.key)) { event.preventDefault(); event.stopPropagation(); chosen(); } });
        if (data.builds.length <= FEW) name_point(svg, taken, x.at(a), y.at(b), name, width - 10);
      });
      place.replaceChildren(box);
      mark();
    }
    function mark() {
      const now = shown().map((build) => build.name);
      place.querySelectorAll("circle").forEach((point) => {
        if (point.classList.toggle("chosen", now.includes(point.dataset.build)) && point !== document.activeElement) point.parentNode.append(point);
      });
    }
    out.className = "points";
    out.append(pick, place);
    redraw();
    out.mark = mark;
    return out;
  }
  return { gantt, lines, legend, scatter, cursors, use, strip, list };
}
