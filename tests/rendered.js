// What is wrong with a page as it is rendered: sentences, none of a good one.
(() => {
  const wrong = [];
  const root = document.documentElement;
  if (root.scrollWidth > root.clientWidth) wrong.push(`scrolls sideways: ${root.scrollWidth} px`);

  const seen = (element) => element.checkVisibility({ visibilityProperty: true, opacityProperty: true });
  const words = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  while (walker.nextNode()) {
    const node = walker.currentNode, element = node.parentElement;
    if (!node.data.trim() || element.closest("script, style, option, .slider span") || !seen(element)) continue;
    const range = document.createRange();
    range.selectNodeContents(node);
    for (const box of range.getClientRects()) {
      if (box.width > 0.5 && box.height > 0.5) words.push({ box, element, text: node.data.trim().slice(0, 40) });
    }
  }

  const scrolled = (element) => element.closest("pre, .tables");
  for (const { box, element, text } of words) {
    const right = box.right > root.clientWidth + 0.5 || box.left < -0.5;
    if (right && !scrolled(element)) wrong.push(`cut off at the side: "${text}"`);
  }

  // A fifth of the line's height is room for accents that no letter fills.
  words.sort((one, other) => one.box.top - other.box.top);
  words.forEach((one, k) => {
    for (const other of words.slice(k + 1)) {
      if (other.box.top > one.box.bottom) break;
      if (getComputedStyle(one.element).position === "sticky") continue;
      const across = Math.min(one.box.right, other.box.right) - Math.max(one.box.left, other.box.left);
      const down = Math.min(one.box.bottom, other.box.bottom) - Math.max(one.box.top, other.box.top);
      const room = 0.25 * Math.min(one.box.height, other.box.height);
      if (across > 1 && down > room) wrong.push(`"${one.text}" overlaps "${other.text}"`);
    }
  });

  const numbers = (colour) => (colour.match(/[\d.]+/g) || []).map(Number);
  const linear = (level) => (level <= 0.04045 ? level / 12.92 : ((level + 0.055) / 1.055) ** 2.4);
  const luminance = ([r, g, b]) =>
    0.2126 * linear(r / 255) + 0.7152 * linear(g / 255) + 0.0722 * linear(b / 255);
  const backOf = (element) => {
    for (let each = element; each; each = each.parentElement) {
      const colour = numbers(getComputedStyle(each).backgroundColor);
      if (colour.length === 3 || colour[3] === 1) return colour;
    }
    return [255, 255, 255];
  };
  const told = new Set();
  for (const { element, text } of words) {
    const style = getComputedStyle(element), drawn = element.closest("svg");
    const ink = luminance(numbers(drawn ? style.fill : style.color)), back = luminance(backOf(element));
    const contrast = (Math.max(ink, back) + 0.05) / (Math.min(ink, back) + 0.05);
    const key = `${element.tagName} ${element.className} ${contrast.toFixed(2)}`;
    if (contrast >= 4.5 || told.has(key)) continue;
    told.add(key);
    wrong.push(`contrast ${contrast.toFixed(2)} of "${text}"`);
  }
  return wrong.slice(0, 20);
})()
