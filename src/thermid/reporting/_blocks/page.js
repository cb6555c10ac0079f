// The page's own script: light or dark, the contents, and figures that answer. Without it, and on paper, the page stands as it is.
"use strict";
(() => {
  const root = document.documentElement, make = (tag, name, text) => {
    const e = document.createElement(tag);
    if (name) e.className = name;
    if (text) e.textContent = text;
    return e;
  };

  // light or dark: as the system has it until asked otherwise; kept nowhere
  const theme = document.getElementById("theme"), system = matchMedia("(prefers-color-scheme: dark)");
  const isDark = () => (root.dataset.theme || (system.matches ? "dark" : "light")) === "dark";
  const name = () => { theme.textContent = isDark() ? "Light" : "Dark"; theme.setAttribute("aria-label", isDark() ? "Light: show the page light" : "Dark: show the page dark"); };
  theme.hidden = false;
  theme.onclick = () => { root.dataset.theme = isDark() ? "light" : "dark"; name(); };
  system.addEventListener("change", name);
  name();

  // the contents: a menu that closes when it has done its work, and the section in view
  const menu = document.querySelector(".menu");
  menu.addEventListener("click", (e) => { if (e.target.closest("a")) menu.open = false; });
  document.addEventListener("keydown", (e) => { if (e.key === "Escape" && menu.open) { menu.open = false; menu.firstElementChild.focus(); } });
  document.addEventListener("click", (e) => { if (menu.open && !menu.contains(e.target)) menu.open = false; });
  const links = [...document.querySelectorAll("nav a")], ends = new Map();
  for (const a of links) { const end = document.getElementById(a.hash.slice(1)); if (end) ends.set(end, [...(ends.get(end) || []), a]); }
  const mark = () => {
    let now = null;
    for (const end of ends.keys()) if (end.getBoundingClientRect().top < innerHeight * 0.3) now = end;
    for (const [end, own] of ends) for (const a of own) if (end === now) a.setAttribute("aria-current", "true"); else a.removeAttribute("aria-current");
  };
  let due = 0;
  addEventListener("scroll", () => { due = due || requestAnimationFrame(() => { due = 0; mark(); }); }, { passive: true });
  mark();
  // a link to something folded away opens it
  const unfold = () => { for (let e = location.hash && document.getElementById(decodeURIComponent(location.hash.slice(1))); e; e = e.parentElement) if (e.tagName === "DETAILS") e.open = true; };
  addEventListener("hashchange", unfold);
  unfold();

  // figures
  const first = document.querySelector("svg"), GRID = 10000, HINT = "← → cursor, + − zoom, 0 all";
  const draw = (tag, given) => { const e = document.createElementNS(first.namespaceURI, tag); for (const k in given) e.setAttribute(k, given[k]); return e; };
  const ticks = (low, high, about) => {
    const rough = (high - low) / Math.max(about, 1), size = 10 ** Math.floor(Math.log10(rough));
    const step = [1, 2, 2.5, 5, 10].map((f) => f * size).find((s) => s >= 0.999 * rough), out = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++) out.push(k * step);
    return [out, step];
  };
  const text = (value, step) => {
    let n = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
    if (Math.abs(step * 10 ** n - Math.round(step * 10 ** n)) > 1e-6) n++;
    return (Math.abs(value) < step / 1e6 ? 0 : value).toFixed(n).replace("-", "−");
  };

  /** One figure: reads its lines back from their paths, shows values at a cursor, zooms. */
  class Chart {
    constructor(svg) {
      this.svg = svg; this.unit = svg.dataset.unit; this.at = null;
      this.box = make("div", "chart live");
      svg.replaceWith(this.box);
      this.read = make("div", "read");
      this.read.setAttribute("aria-live", "polite");
      const tools = make("div", "tools");
      for (const [sign, label, act] of [["+", "Zoom in", () => this.zoom(0.5)], ["−", "Zoom out", () => this.zoom(2)], ["⟲", "Show all", () => this.reset()]]) {
        const b = make("button", "", sign);
        b.type = "button"; b.tabIndex = -1; b.setAttribute("aria-label", label); b.onclick = (e) => { e.stopPropagation(); act(); };
        tools.append(b);
      }
      this.box.append(svg, this.read, tools);
      this.box.tabIndex = 0;
      this.box.setAttribute("role", "group");
      this.box.setAttribute("aria-roledescription", "chart");
      this.box.setAttribute("aria-label", `${svg.getAttribute("aria-label").split(". ")[0]}. Arrow keys move a cursor, plus and minus zoom, 0 shows all.`);
      this.box.addEventListener("keydown", (e) => this.key(e));
      this.box.addEventListener("pointermove", (e) => this.move(e));
      this.box.addEventListener("pointerdown", (e) => this.down(e));
      this.box.addEventListener("pointerup", (e) => this.up(e));
      this.box.addEventListener("pointercancel", () => this.drop());
      this.box.addEventListener("pointerleave", () => { if (!this.drag && document.activeElement !== this.box) this.leave(); });
      this.box.addEventListener("dblclick", () => this.reset());
      this.box.addEventListener("blur", () => this.leave());
    }

    /** Read the lines, once, when they are first asked for. */
    get panels() {
      if (this.known) return this.known;
      this.known = [...this.svg.querySelectorAll(".panel")].map((g) => {
        const [left, top, width, height] = g.dataset.box.split(" ").map(Number), [x0, x1, y0, y1] = g.dataset.ends.split(" ").map(Number);
        const lines = [...g.querySelectorAll(".line")].map((path) => {
          const x = [], y = [], breaks = new Set();
          let px = 0, py = 0;
          for (const [, command, numbers] of path.getAttribute("d").matchAll(/([Mlh])([^Mlh]*)/g)) {
            const n = (numbers.match(/-?\d+/g) || []).map(Number);
            for (let k = 0; k + 1 < n.length; k += 2) {
              if (command === "M") { px = n[k]; py = n[k + 1]; breaks.add(x.length); } else { px += n[k]; py += n[k + 1]; }
              x.push(x0 + (x1 - x0) * px / GRID); y.push(y1 - (y1 - y0) * py / GRID);
            }
          }
          return { path, name: path.dataset.n, less: path.dataset.less && JSON.parse(path.dataset.less), x, y, breaks };
        });
        const axis = g.querySelector(".ticks"), rules = g.querySelector(".grid"), view = g.querySelector(".view");
        return { g, left, top, width, height, x0, x1, y0, y1, lines, axis, rules, view, unit: g.dataset.unit, scale: view.getAttribute("transform"), first: [axis.innerHTML, rules.getAttribute("d")] };
      });
      const p = this.known[0];
      this.whole = this.now = [p.x0, p.x1];
      const xs = this.known.flatMap((q) => q.lines.flatMap((l) => [l.x[0], l.x.at(-1)]));
      this.data = [Math.min(...xs), Math.max(...xs)];
      this.hair = draw("path", { class: "hair", style: "stroke:var(--f-ink);stroke-width:.8;fill:none" });
      this.dots = draw("g", { class: "hair" });
      this.pick = draw("rect", { class: "hair", y: p.top, style: "fill:var(--f-simulated);fill-opacity:.15" });
      this.svg.append(this.pick, this.hair, this.dots);
      return this.known;
    }

    /** x of a pointer's event, within the window. */
    under(e) {
      const p = this.panels[0], r = this.svg.getBoundingClientRect(), scale = this.svg.viewBox.baseVal.width / r.width;
      const share = ((e.clientX - r.left) * scale - p.left) / p.width;
      return this.now[0] + (this.now[1] - this.now[0]) * Math.min(1, Math.max(0, share));
    }

    place(x) { const p = this.panels[0]; return p.left + p.width * (x - this.now[0]) / (this.now[1] - this.now[0]); }

    move(e) {
      const x = this.under(e);
      if (this.drag !== undefined && this.drag !== null && e.pointerType === "mouse") {
        const [a, b] = [this.drag, x].map((v) => this.place(v)).sort((m, n) => m - n), last = this.panels.at(-1);
        this.pick.setAttribute("x", a); this.pick.setAttribute("width", b - a); this.pick.setAttribute("height", last.top + last.height - this.panels[0].top);
      }
      this.show(x);
    }

    down(e) {
      if (e.target.closest("button")) return;
      this.drag = this.under(e);
      if (e.pointerType === "mouse") this.box.setPointerCapture(e.pointerId);
      this.show(this.drag);
    }

    up(e) {
      const from = this.drag;
      this.drop();
      if (from === undefined || from === null || e.pointerType !== "mouse") return;
      const ends = [from, this.under(e)].sort((a, b) => a - b);
      if (this.place(ends[1]) - this.place(ends[0]) > 8) this.window(ends[0], ends[1]);
    }

    drop() { this.drag = null; if (this.pick) this.pick.removeAttribute("width"); }

    key(e) {
      if (e.ctrlKey || e.metaKey || e.altKey || e.target !== this.box) return;
      this.panels;
      const [low, high] = this.now, far = (high - low) / (e.shiftKey ? 10 : 100), at = this.at ?? low + (high - low) / 2;
      const act = {
        ArrowRight: () => this.show(Math.min(high, at + far)), ArrowLeft: () => this.show(Math.max(low, at - far)),
        Home: () => this.show(low), End: () => this.show(high), "+": () => this.zoom(0.5), "=": () => this.zoom(0.5),
        "-": () => this.zoom(2), "0": () => this.reset(), Escape: () => { this.reset(); this.leave(); },
      }[e.key];
      if (!act) return;
      e.preventDefault();
      act();
    }

    zoom(by) {
      this.panels;
      const [low, high] = this.now, at = this.at ?? (low + high) / 2;
      this.window(at - (at - low) * by, at + (high - at) * by);
    }

    reset() { if (this.known) this.window(...this.whole); }

    /** Show a stretch of x; y follows what is seen in it. */
    window(low, high) {
      [low, high] = [Math.max(low, this.whole[0]), Math.min(high, this.whole[1])];
      if (high - low < 1e-4 * (this.whole[1] - this.whole[0])) return;
      this.now = [low, high];
      const all = low === this.whole[0] && high === this.whole[1];
      this.box.classList.toggle("zoomed", !all);
      this.panels.forEach((p, k) => {
        if (all) { p.view.setAttribute("transform", p.scale); p.axis.innerHTML = p.first[0]; p.rules.setAttribute("d", p.first[1]); } else this.rescale(p, k);
        const mark = p.g.querySelector(".leaves");
        if (mark) mark.style.display = all ? "" : "none";
      });
      const last = this.panels.at(-1), texts = last.axis;
      if (!all) {
        const [xs, step] = ticks(low, high, Math.round(last.width / 62));
        for (const x of xs) { const t = draw("text", { x: this.place(x), y: last.top + last.height + 14, "text-anchor": "middle" }); t.textContent = text(x, step); texts.append(t); }
      }
      if (this.at !== null) this.show(Math.min(high, Math.max(low, this.at)));
    }

    rescale(p) {
      const [low, high] = this.now, seen = [];
      for (const line of p.lines) if (!line.path.classList.contains("off")) line.x.forEach((x, k) => { if (x >= low && x <= high) seen.push(line.y[k]); });
      let y0 = seen.length ? Math.min(...seen) : p.y0, y1 = seen.length ? Math.max(...seen) : p.y1;
      const room = 0.06 * (y1 - y0) || 0.01 * (p.y1 - p.y0);
      [y0, y1] = [y0 - room, y1 + room];
      const sx = p.width / (high - low), sy = p.height / (y1 - y0);
      const left = p.left + (p.x0 - low) * sx, top = p.top + (y1 - p.y1) * sy;
      p.view.setAttribute("transform", `translate(${left} ${top})scale(${sx * (p.x1 - p.x0) / GRID} ${sy * (p.y1 - p.y0) / GRID})`);
      const [ys, step] = ticks(y0, y1, Math.max(3, Math.round(p.height / 42))), [xs] = ticks(low, high, Math.round(p.width / 62));
      p.axis.replaceChildren(...ys.map((y) => { const t = draw("text", { x: p.left - 6, y: p.top + (y1 - y) * sy + 3.8, "text-anchor": "end" }); t.textContent = text(y, step); return t; }));
      p.rules.setAttribute("d", xs.map((x) => `M${this.place(x)} ${p.top}v${p.height}`).join("") + ys.map((y) => `M${p.left} ${p.top + (y1 - y) * sy}h${p.width}`).join(""));
      p.now = [y0, y1];
    }

    /** Show the values at x. */
    show(x) {
      this.panels;
      x = Math.min(this.data[1], Math.max(this.data[0], x));
      const found = this.panels.map((p) => p.lines.filter((l) => !l.path.classList.contains("off")).map((l) => [l, this.value(l, x)]));
      this.at = x;
      const first = this.panels[0], last = this.panels.at(-1), px = this.place(x);
      this.hair.setAttribute("d", `M${px} ${first.top}V${last.top + last.height}`);
      this.dots.replaceChildren();
      this.read.replaceChildren(make("b", "", `${text(x, (this.now[1] - this.now[0]) / 200)} ${this.unit}`));
      const rows = this.rows(found);
      this.panels.forEach((p, k) => {
        const [y0, y1] = this.now[0] === this.whole[0] && this.now[1] === this.whole[1] ? [p.y0, p.y1] : p.now || [p.y0, p.y1];
        for (const [line, y] of found[k]) {
          if (y === null) continue;
          const row = make("span"), [shown, digits] = rows.get(line);
          row.append(make("span", "", line.name.replace(/ −?[\d.]+ °C$/, "")), make("span", "", `${text(shown, digits)} ${p.unit}`));
          this.read.append(row);
          const cy = p.top + p.height * (y1 - y) / (y1 - y0);
          if (cy >= p.top && cy <= p.top + p.height) this.dots.append(draw("circle", { cx: px, cy, r: 3, style: `fill:${line.path.style.stroke}` }));
        }
      });
      if (document.activeElement === this.box) this.read.append(make("div", "soft", HINT));
      const right = px > first.left + first.width / 2;
      this.read.style.left = right ? `${100 * first.left / this.svg.viewBox.baseVal.width + 1}%` : "auto";
      this.read.style.right = right ? "auto" : "2%";
    }

    /** What is said of each line: its value and the step of its last digit. A difference and the two it is of have one step, and agree. */
    rows(found) {
      const whole = this.now[0] === this.whole[0] && this.now[1] === this.whole[1], out = new Map(), at = (name, own) => found.flat().find(([l, y]) => l.name === name && l !== own && !l.less && y !== null)?.[0];
      this.panels.forEach((p, k) => {
        const [y0, y1] = whole ? [p.y0, p.y1] : p.now || [p.y0, p.y1], step = 10 ** Math.floor(Math.log10((y1 - y0) / 200));
        for (const [line, y] of found[k]) out.set(line, [y, step]);
      });
      const differences = found.flat().filter(([l, y]) => l.less && y !== null), finest = Math.min(...differences.map(([l]) => out.get(l)[1]));
      for (const [line] of differences) {
        const [more, less] = line.less.map((name) => at(name, line));
        for (const l of [line, more, less]) if (l) { const [y, step] = out.get(l), own = Math.min(step, finest); out.set(l, [Math.round(y / own) * own, own]); }
        if (more && less) out.set(less, [out.get(more)[0] - out.get(line)[0], out.get(line)[1]]);
      }
      return out;
    }

    /** y of a line at x, between its points; null outside it and in a gap. */
    value(line, x) {
      const { x: xs, y: ys } = line;
      if (!xs.length || x < xs[0] || x > xs.at(-1)) return null;
      let low = 0, high = xs.length - 1;
      while (high - low > 1) { const mid = (low + high) >> 1; if (xs[mid] <= x) low = mid; else high = mid; }
      if (line.breaks.has(high)) return null;
      const span = xs[high] - xs[low];
      return span > 0 ? ys[low] + (ys[high] - ys[low]) * (x - xs[low]) / span : ys[low];
    }

    leave() {
      this.at = null;
      this.read.replaceChildren();
      if (this.hair) { this.hair.removeAttribute("d"); this.dots.replaceChildren(); }
    }
  }

  const charts = [...document.querySelectorAll("svg.plot[data-unit]")].map((svg) => new Chart(svg));
  addEventListener("beforeprint", () => { for (const c of charts) { c.reset(); c.leave(); } });

  // a legend shows and hides its lines, in all figures beside it
  for (const legend of document.querySelectorAll(".charts .legend")) {
    const around = legend.closest(".charts");
    for (const item of legend.children) {
      const shapes = () => [...around.querySelectorAll(".line,.area")].filter((e) => e.dataset.n === item.dataset.n);
      if (!shapes().length) continue;
      const button = make("button");
      button.type = "button";
      button.append(...item.childNodes);
      button.setAttribute("aria-pressed", "true");
      button.title = "Show or hide";
      button.onclick = () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", String(on));
        for (const e of shapes()) e.classList.toggle("off", !on);
        for (const c of charts) if (c.known && around.contains(c.box)) { c.window(...c.now); if (c.at !== null) c.show(c.at); }
      };
      item.append(button);
    }
  }
  addEventListener("beforeprint", () => { for (const b of document.querySelectorAll(".legend button[aria-pressed=false]")) b.click(); });
})();
