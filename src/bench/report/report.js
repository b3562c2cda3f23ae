"use strict";
// Everything that can be read without it is in the page already: this compares images.
(() => {
  const stops = [[5, 48, 97], [103, 169, 207], [247, 247, 247], [239, 138, 98], [103, 0, 31]];
  const invalid = [70, 70, 70];

  // Of an error in units of the scale.
  function colour(error) {
    const place = (Math.max(-1, Math.min(1, error)) + 1) * 2;
    const stop = Math.min(3, Math.floor(place));
    const part = place - stop;
    return stops[stop].map((low, i) => low + part * (stops[stop + 1][i] - low));
  }

  function pixels(image) {
    const canvas = document.createElement("canvas");
    canvas.width = image.naturalWidth;
    canvas.height = image.naturalHeight;
    const context = canvas.getContext("2d", { willReadFrequently: true });
    context.drawImage(image, 0, 0);
    return context.getImageData(0, 0, canvas.width, canvas.height);
  }

  const loaded = (image) => image.decode().then(() => image, () => null);

  function setUp(group) {
    const find = (selector) => group.querySelector(selector);
    const [left, right, of, scale] = [".left", ".right", ".of", ".scale"].map(find);
    const [stage, over, under, cut] = [".stage", ".over", ".under", ".cut"].map(find);
    const [canvas, flicker] = ["canvas", ".flicker"].map(find);
    const chosen = (select) => document.getElementById(select.value);
    const named = (select) => select.selectedOptions[0].textContent;

    function showPair() {
      for (const [select, image, tag] of [[left, over, ".tag-left"], [right, under, ".tag-right"]]) {
        image.src = chosen(select).src;
        image.alt = `${named(select)}: visibility`;
        find(tag).textContent = named(select);
      }
    }

    function showCut() {
      stage.style.setProperty("--cut", `${cut.value}%`);
    }

    let turn = 0;
    async function showHeat() {
      const mine = ++turn;
      const truth = document.getElementById(`${group.id}-truth`);
      const valid = document.getElementById(`${group.id}-valid`);
      const images = await Promise.all([chosen(of), truth, valid].map(loaded));
      if (mine !== turn || images.includes(null)) return;
      const [found, wanted, mask] = images.map(pixels);
      canvas.width = found.width;
      canvas.height = found.height;
      const range = Number(scale.value);
      const context = canvas.getContext("2d");
      const out = context.createImageData(found.width, found.height);
      for (let i = 0; i < out.data.length; i += 4) {
        const error = (found.data[i] - wanted.data[i]) / 255 / range;
        out.data.set(mask.data[i] > 127 ? colour(error) : invalid, i);
        out.data[i + 3] = 255;
      }
      context.putImageData(out, 0, 0);
      canvas.dataset.drawn = of.value;
      canvas.setAttribute("aria-label", `${named(of)} minus truth, blue too dark, red too bright`);
      find(".low").textContent = `\u2212${scale.value} too dark`;
      find(".high").textContent = `+${scale.value} too bright`;
    }

    let timer = 0;
    function toggleFlicker() {
      const starts = !timer;
      clearInterval(timer);
      let isLeft = false;
      timer = starts ? setInterval(() => {
        isLeft = !isLeft;
        stage.style.setProperty("--cut", isLeft ? "100%" : "0%");
      }, 600) : 0;
      flicker.setAttribute("aria-pressed", String(starts));
      if (!starts) showCut();
    }

    left.addEventListener("change", showPair);
    right.addEventListener("change", showPair);
    cut.addEventListener("input", () => {
      if (timer) toggleFlicker();
      showCut();
    });
    flicker.addEventListener("click", toggleFlicker);
    of.addEventListener("change", showHeat);
    scale.addEventListener("change", showHeat);
    for (const pick of group.querySelectorAll(".pick")) {
      pick.addEventListener("click", () => {
        const isTruth = pick.dataset.image.endsWith("-truth");
        (isTruth ? left : right).value = pick.dataset.image;
        showPair();
        if (!isTruth) {
          of.value = pick.dataset.image;
          showHeat();
        }
        stage.scrollIntoView({ block: "center" });
      });
    }
    showPair();
    // Pictures far down the page are drawn when they are near.
    const near = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) {
        near.disconnect();
        showHeat();
      }
    }, { rootMargin: "600px" });
    near.observe(canvas);
  }

  // Tables that go on to the right fade out there.
  const widths = new ResizeObserver((entries) => entries.forEach((entry) => showMore(entry.target)));
  function showMore(box) {
    box.classList.toggle("more", box.scrollLeft + box.clientWidth < box.scrollWidth - 1);
  }
  for (const box of document.querySelectorAll(".scroll")) {
    box.addEventListener("scroll", () => showMore(box), { passive: true });
    widths.observe(box);
  }

  for (const group of document.querySelectorAll(".group")) setUp(group);
})();
