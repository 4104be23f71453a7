// Values below the pointer, in all pictures of a section at once.
"use strict";

const UNKNOWN = 65535;
const PREFIXES = { "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 0: "", 3: "k", 6: "M", 9: "G" };

function valuesOf(figure) {
  if (figure.map === undefined && figure.dataset.values) {
    const bytes = Uint8Array.from(atob(figure.dataset.values), (letter) => letter.charCodeAt(0));
    const low = Number(figure.dataset.low), step = Number(figure.dataset.step);
    const width = Number(figure.dataset.width);
    const values = new Float32Array(bytes.length / 2);
    for (let k = 0; k < values.length; k++) {
      const level = bytes[2 * k] | (bytes[2 * k + 1] << 8);
      values[k] = level === UNKNOWN ? NaN : low + level * step;
    }
    figure.map = { width, height: values.length / width, values };
  }
  return figure.map;
}

function written(value, unit, digits = 3) {
  if (!Number.isFinite(value)) return "none";
  if (unit === "probability") return `${(100 * value).toFixed(0)} %`;
  if (unit === "ln") return `± ${(100 * value).toFixed(0)} %`;
  let exponent = 0;
  if (value !== 0) exponent = 3 * Math.floor(Math.log10(Math.abs(Number(value.toPrecision(digits)))) / 3);
  exponent = Math.min(9, Math.max(-12, exponent));
  if (unit === "m" && exponent === -3 && Math.abs(value) >= 0.01) {
    return `${(100 * value).toPrecision(digits)} cm`.replace("-", "−");
  }
  if (unit !== "m" && exponent <= 3 && exponent >= 0) exponent = 0;
  const number = value / 10 ** exponent;
  const places = number === 0 ? 0 : Math.max(0, digits - 1 - Math.floor(Math.log10(Math.abs(number))));
  return `${number.toFixed(Math.min(places, 6))} ${PREFIXES[exponent]}${unit}`.replace("-", "−");
}

function pixelBelow(event, frame, map) {
  const box = frame.getBoundingClientRect();
  const column = Math.floor(((event.clientX - box.left) / box.width) * map.width);
  const row = Math.floor(((event.clientY - box.top) / box.height) * map.height);
  const inside = column >= 0 && column < map.width && row >= 0 && row < map.height;
  return inside ? { column, row } : null;
}

function point(figure, at) {
  const map = valuesOf(figure), told = figure.querySelector("output");
  const here = at && map && map.width === at.width && map.height === at.height;
  figure.classList.toggle("pointed", Boolean(here));
  if (!here) return;
  const frame = figure.querySelector(".frame");
  frame.style.setProperty("--x", `${(100 * (at.column + 0.5)) / map.width}%`);
  frame.style.setProperty("--y", `${(100 * (at.row + 0.5)) / map.height}%`);
  told.textContent = written(map.values[at.row * map.width + at.column], figure.dataset.unit);
}

function linkPictures(group) {
  const figures = [...group.querySelectorAll("figure[data-values]")];
  const show = (event) => {
    const figure = event.target.closest("figure[data-values]");
    if (!figure || !event.target.closest(".frame")) return;
    const map = valuesOf(figure), at = pixelBelow(event, figure.querySelector(".frame"), map);
    const place = at && { ...at, width: map.width, height: map.height };
    figures.forEach((each) => point(each, place));
  };
  group.addEventListener("pointermove", show);
  group.addEventListener("pointerdown", show);
  group.addEventListener("pointerleave", () => figures.forEach((each) => point(each, null)));
}

document.querySelectorAll(".linked").forEach(linkPictures);
