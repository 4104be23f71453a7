// A cloud of points on a canvas, to be turned, moved closer and seen from all around.
// Coordinates as the camera's: x right, y down, z ahead, in metres.

const LOOKS = {
  behind: { turn: 0.7, tilt: 0.4 },
  above: { turn: 0, tilt: 1.55 },
  side: { turn: -1.55, tilt: 0.02 },
};

function cloudOn(canvas) {
  const context = canvas.getContext("2d");
  const state = { ...LOOKS.behind, zoom: 1, fit: [0, 0, 1], sets: [], lines: [], centre: [0, 0, 3], size: 3 };
  let waiting = false, scale = 1;

  function project(x, y, z) {
    const [a, b, c] = state.centre;
    const cosine = Math.cos(state.turn), sine = Math.sin(state.turn);
    const right = (x - a) * cosine + (z - c) * sine;
    const ahead = (z - c) * cosine - (x - a) * sine;
    const down = (y - b) * Math.cos(state.tilt) - ahead * Math.sin(state.tilt);
    const depth = ahead * Math.cos(state.tilt) + (y - b) * Math.sin(state.tilt);
    const far = 3.2 * state.size + depth;
    const [across, below, enlarged] = state.fit;
    const focal = (state.size * enlarged * state.zoom) / Math.max(far, 1e-3);
    const left = canvas.width / 2 - across * state.zoom, top = canvas.height / 2 - below * state.zoom;
    return [left + right * focal, top + down * focal, far, focal];
  }

  // What is seen from here fills the canvas but for a margin.
  function fit() {
    Object.assign(state, { zoom: 1, fit: [canvas.width / 2, canvas.height / 2, 1] });
    let [left, right, top, bottom] = [Infinity, -Infinity, Infinity, -Infinity];
    const reach = (at) => {
      const [u, v] = project(...at);
      [left, right] = [Math.min(left, u), Math.max(right, u)];
      [top, bottom] = [Math.min(top, v), Math.max(bottom, v)];
    };
    for (const { points } of state.sets) {
      for (let k = 0; k + 2 < points.length; k += 9) reach(points.slice(k, k + 3));
    }
    state.lines.forEach(({ from, to }) => (reach(from), reach(to)));
    if (!(right > left) || !(bottom > top)) return;
    const enlarged = 0.84 * Math.min(canvas.width / (right - left), canvas.height / (bottom - top));
    state.fit = [((left + right) / 2) * enlarged, ((top + bottom) / 2) * enlarged, enlarged];
  }

  function drawPoints(picture, nearest) {
    const { width, height } = canvas, pixels = new Uint32Array(picture.data.buffer);
    for (const { points, colours, side } of state.sets) {
      for (let k = 0; k < colours.length; k++) {
        const [u, v, far, focal] = project(points[3 * k], points[3 * k + 1], points[3 * k + 2]);
        if (far < 0.05 * state.size) continue;
        const half = Math.min(10 * scale, Math.max(scale, 0.5 * side * points[3 * k + 2] * focal));
        const left = Math.max(0, Math.round(u - half)), right = Math.min(width, Math.round(u + half));
        const top = Math.max(0, Math.round(v - half)), bottom = Math.min(height, Math.round(v + half));
        for (let row = top; row < bottom; row++) {
          for (let place = row * width + left; place < row * width + right; place++) {
            if (far < nearest[place]) {
              nearest[place] = far;
              pixels[place] = colours[k];
            }
          }
        }
      }
    }
  }

  function drawLines(style) {
    context.font = `${12 * scale}px ${getComputedStyle(canvas).fontFamily}`;
    for (const { from, to, colour, label, dot } of state.lines) {
      const start = project(...from), end = project(...to);
      if (start[2] <= 0 || end[2] <= 0) continue;
      context.strokeStyle = context.fillStyle = style.getPropertyValue(colour);
      context.lineWidth = (dot ? 1.5 : 1) * scale;
      context.beginPath();
      context.moveTo(start[0], start[1]);
      context.lineTo(end[0], end[1]);
      context.stroke();
      if (dot) {
        context.beginPath();
        context.arc(end[0], end[1], 5 * scale, 0, 7);
        context.fill();
      }
      if (label) context.fillText(label, end[0] + 6 * scale, end[1] + 14 * scale);
    }
  }

  function draw() {
    waiting = false;
    scale = window.devicePixelRatio || 1;
    const width = Math.round(canvas.clientWidth * scale);
    const height = Math.round(canvas.clientHeight * scale);
    if (width === 0 || height === 0) return;
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    if (state.fitting) fit();
    state.fitting = false;
    const picture = context.createImageData(width, height);
    drawPoints(picture, new Float32Array(width * height).fill(Infinity));
    context.putImageData(picture, 0, 0);
    drawLines(getComputedStyle(canvas));
  }

  function soon() {
    if (!waiting) requestAnimationFrame(draw);
    waiting = true;
  }

  function turn(right, down) {
    state.turn += right;
    state.tilt = Math.min(1.57, Math.max(-1.57, state.tilt + down));
    soon();
  }

  function zoom(factor) {
    state.zoom = Math.min(12, Math.max(0.3, state.zoom * factor));
    soon();
  }

  const fingers = new Map();
  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  canvas.addEventListener("pointermove", (event) => {
    const before = fingers.get(event.pointerId);
    if (!before) return;
    const apart = () => {
      const [one, other] = [...fingers.values()];
      return Math.hypot(one[0] - other[0], one[1] - other[1]);
    };
    const width = fingers.size === 2 ? apart() : 0;
    fingers.set(event.pointerId, [event.clientX, event.clientY]);
    if (fingers.size === 1) turn(0.008 * (event.clientX - before[0]), 0.008 * (event.clientY - before[1]));
    else if (fingers.size === 2 && width > 0) zoom(apart() / width);
  });
  for (const end of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(end, (event) => fingers.delete(event.pointerId));
  }
  canvas.addEventListener("wheel", (event) => {
    if (document.activeElement !== canvas && !event.ctrlKey) return; // the page scrolls on
    event.preventDefault();
    zoom(Math.exp(-0.0015 * event.deltaY));
  }, { passive: false });
  const KEYS = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1),
    ArrowDown: () => turn(0, 0.1), "+": () => zoom(1.2), "-": () => zoom(1 / 1.2),
  };
  canvas.addEventListener("keydown", (event) => {
    if (!KEYS[event.key]) return;
    event.preventDefault();
    KEYS[event.key]();
  });
  new ResizeObserver(soon).observe(canvas);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", soon);

  return {
    show(sets, lines) {
      Object.assign(state, { sets, lines });
      soon();
    },
    around(centre, size) {
      if (String([centre, size]) !== String([state.centre, state.size])) state.fitting = true;
      Object.assign(state, { centre, size });
    },
    look(name) {
      Object.assign(state, LOOKS[name], { fitting: true });
      soon();
    },
    zoom,
  };
}
