// One map at a time, large, with everything that is known of a pixel; and its cloud of points.

function explore(section) {
  const width = Number(section.dataset.width), height = Number(section.dataset.height);
  const optics = { x: Number(section.dataset.tanX), y: Number(section.dataset.tanY) };
  const spots = JSON.parse(section.dataset.spots);
  const pictures = [...document.querySelectorAll("figure[data-kind]")].filter(
    (figure) => valuesOf(figure).width === width && valuesOf(figure).height === height);
  const find = (kind, method) => pictures.find((figure) =>
    figure.dataset.kind === kind && figure.dataset.method === method);
  const pick = (name) => section.querySelector(`[name="${name}"]`);
  const [kind, method, truth, rays] = ["kind", "method", "truth", "rays"].map(pick);
  const frame = section.querySelector(".frame"), shown = frame.querySelector("img");
  const told = section.querySelector(".pixel"), caption = section.querySelector(".large figcaption");
  const cloud = cloudOn(section.querySelector("canvas"));
  let pointed = null;

  const figureOf = (name) => find(name, method.value) || find(name, "true") || find(name, "");
  const depthOf = () => find("depth", method.value);
  const trueDepth = find("depth", "true");

  function rayOf(row, column) {
    const x = ((2 * column + 1 - width) / width) * optics.x;
    const y = ((2 * row + 1 - height) / height) * optics.y;
    return [x, y, Math.hypot(x, y, 1)];
  }

  async function coloursOf(figure) {
    const picture = figure.querySelector("img");
    await picture.decode();
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    const context = canvas.getContext("2d");
    context.drawImage(picture, 0, 0, width, height);
    return new Uint32Array(context.getImageData(0, 0, width, height).data.buffer);
  }

  function pointsOf(map, colours, only) {
    const points = [], kept = [];
    map.values.forEach((depth, k) => {
      if (!(depth > 0) || depth > section.dataset.reach || (only !== undefined && only !== k)) return;
      const [x, y] = rayOf(Math.floor(k / width), k % width);
      points.push(x * depth, y * depth, depth);
      kept.push(typeof colours === "number" ? colours : colours[k]);
    });
    return { points, colours: kept, side: (2.1 * optics.x) / width };
  }

  function spread(sets) {
    const sides = [0, 1, 2].map((axis) => {
      const along = sets.flatMap(({ points }) => points.filter((_, k) => k % 3 === axis));
      along.sort((one, other) => one - other);
      const at = (share) => along[Math.floor(share * (along.length - 1))] ?? 0;
      return [at(0.02), at(0.98)];
    });
    const near = Math.min(0, sides[2][0]);
    const size = Math.max(...sides.map(([low, high]) => high - low), sides[2][1] - near, 0.3);
    cloud.around([0, (sides[1][0] + sides[1][1]) / 2, (near + sides[2][1]) / 2], size / 2);
    return { far: sides[2][1], floor: sides[1][1] };
  }

  function ladder({ far, floor }) {
    const step = [0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100].find((each) => far / each <= 6) || 200;
    const lines = [{ from: [0, floor, 0], to: [0, floor, far], colour: "--quiet" }];
    for (let z = 0; z <= far + 1e-6; z += step) {
      const half = Math.max(z * optics.x, 0.02 * far);
      lines.push({ from: [-half, floor, z], to: [half, floor, z], colour: "--quiet",
        label: z > 0 ? `${Number(z.toPrecision(3))} m` : "" });
    }
    const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([x, y]) =>
      [x * optics.x * 0.12 * far, y * optics.y * 0.12 * far, 0.12 * far]);
    corners.forEach((corner, k) => {
      lines.push({ from: [0, 0, 0], to: corner, colour: "--ink" });
      lines.push({ from: corner, to: corners[(k + 1) % 4], colour: "--ink" });
    });
    return lines;
  }

  async function drawCloud() {
    const depth = depthOf() || trueDepth, figure = figureOf(kind.value);
    if (!depth || !figure) return;
    const sets = [pointsOf(valuesOf(depth), await coloursOf(figure))];
    const beam = spread(truth?.checked ? [...sets, pointsOf(valuesOf(trueDepth), 0)] : sets);
    if (truth?.checked) sets.push(pointsOf(valuesOf(trueDepth), 0xff7a4de0));
    const lines = ladder(beam);
    if (rays?.checked) {
      spots.forEach(({ colour, at }) => lines.push({ from: [0, 0, 0], to: at, colour, dot: true }));
    }
    if (pointed) {
      const k = pointed.row * width + pointed.column, z = valuesOf(depth).values[k];
      const [x, y] = rayOf(pointed.row, pointed.column);
      if (z > 0) lines.push({ from: [0, 0, 0], to: [x * z, y * z, z], colour: "--accent", dot: true });
    }
    cloud.show(sets, lines);
  }

  function tell() {
    const at = pointed || { row: Math.floor(height / 2), column: Math.floor(width / 2) };
    const k = at.row * width + at.column, length = rayOf(at.row, at.column)[2];
    const value = (name, who) => {
      const figure = find(name, who);
      return figure ? valuesOf(figure).values[k] : undefined;
    };
    const depth = value("depth", method.value), real = value("depth", "true");
    const sigma = value("deviation", method.value), nothing = value("nothing", method.value);
    const rows = [["Pixel", `${at.column}, ${at.row}`]];
    if (depth !== undefined) rows.push(["Range", written(depth * length, "m")]);
    if (sigma !== undefined) rows.push(["Sigma", written(depth * length * sigma, "m", 2)]);
    if (real !== undefined) rows.push(["True range", written(real * length, "m")]);
    if (depth !== undefined && real !== undefined) rows.push(["Error", written((depth - real) * length, "m", 2)]);
    if (nothing !== undefined) rows.push(["P(nothing)", written(nothing, "probability")]);
    told.replaceChildren(...rows.map(([name, words]) => {
      const box = document.createElement("div");
      const term = Object.assign(document.createElement("dt"), { textContent: name });
      box.append(term, Object.assign(document.createElement("dd"), { textContent: words }));
      return box;
    }));
    frame.style.setProperty("--x", `${(100 * (at.column + 0.5)) / width}%`);
    frame.style.setProperty("--y", `${(100 * (at.row + 0.5)) / height}%`);
  }

  function draw() {
    for (const option of kind.options) option.disabled = !figureOf(option.value);
    const figure = figureOf(kind.value) || depthOf() || pictures[0];
    shown.src = figure.querySelector("img").src;
    shown.alt = figure.dataset.title;
    const named = ["depth", "image"].includes(figure.dataset.kind);
    const words = `${named ? `${figure.dataset.kind}: ` : ""}${figure.dataset.title.toLowerCase()}`;
    caption.firstElementChild.textContent = words[0].toUpperCase() + words.slice(1);
    const bar = figure.closest(".pictures")?.querySelector(".scale");
    caption.lastElementChild.replaceChildren(...(bar ? [bar.cloneNode(true)] : []));
    tell();
    drawCloud();
  }

  const move = (event) => {
    const at = pixelBelow(event, frame, { width, height });
    if (!at) return;
    pointed = at;
    tell();
    drawCloud();
  };
  frame.addEventListener("pointermove", move);
  frame.addEventListener("pointerdown", move);
  for (const each of [kind, method, truth, rays]) each?.addEventListener("change", draw);
  section.querySelectorAll("[data-look]").forEach((button) =>
    button.addEventListener("click", () => cloud.look(button.dataset.look)));
  section.querySelectorAll("[data-zoom]").forEach((button) =>
    button.addEventListener("click", () => cloud.zoom(Number(button.dataset.zoom))));
  section.hidden = false;
  draw();
}

document.querySelectorAll(".explore").forEach(explore);
