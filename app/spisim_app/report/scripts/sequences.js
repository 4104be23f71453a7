// Sliders over what comes one after the other: patterns of a frame, captures of a flight.

function sequence(section, steps, show, pause_ms) {
  const slider = section.querySelector("input[type=range]"), play = section.querySelector("button");
  let timer = null;
  const stop = () => {
    clearInterval(timer);
    timer = null;
    play.textContent = "Play";
  };
  const go = (step) => {
    slider.value = step;
    show(step);
  };
  slider.max = steps - 1;
  slider.addEventListener("input", () => {
    stop();
    show(Number(slider.value));
  });
  play.addEventListener("click", () => {
    if (timer !== null) return stop();
    play.textContent = "Stop";
    go(Number(slider.value) >= steps - 1 ? 0 : Number(slider.value) + 1);
    timer = setInterval(() => {
      go(Number(slider.value) + 1);
      if (Number(slider.value) >= steps - 1) stop();
    }, pause_ms);
  });
  section.hidden = false;
  go(steps - 1);
}

function buildUp(section) {
  const told = JSON.parse(section.dataset.told), words = section.querySelector(".step output");
  const strips = [...section.querySelectorAll(".strip img")];
  sequence(section, told.length, (step) => {
    strips.forEach((strip) => (strip.style.left = `${-100 * step}%`));
    const { patterns, share, time_s, likeness } = told[step];
    const parts = [`${patterns} pattern${patterns > 1 ? "s" : ""}`, `${(100 * share).toPrecision(3)} %`];
    if (time_s !== null) parts.push(written(time_s, "s"));
    if (likeness !== null) parts.push(`correlation ${likeness.toFixed(3)}`);
    words.textContent = parts.join(" · ");
  }, 700);
}

function flight(section) {
  const samples = [...document.querySelectorAll(".sample[data-instant]")];
  const pictures = [...section.querySelectorAll("figure:not(.plan)")];
  const places = [...section.querySelectorAll("[data-at]")];
  const words = section.querySelector(".step output");
  sequence(section, samples.length, (step) => {
    const sample = samples[step], figures = sample.querySelectorAll("figure");
    pictures.forEach((picture, k) => {
      picture.querySelector("img").src = figures[k].querySelector("img").src;
    });
    places.forEach((place) => place.classList.toggle("now", Number(place.dataset.at) === step));
    words.textContent = sample.dataset.instant;
  }, Number(section.dataset.pauseMs));
}

document.querySelectorAll(".buildup").forEach(buildUp);
document.querySelectorAll(".flight-player").forEach(flight);
