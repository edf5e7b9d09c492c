// Charts over time that share one axis and one playhead: lines, and rows of coloured cells.
// Drawn on canvas in the page's own colours; hovering tells values, clicking and dragging seeks.
"use strict";

const physiquePlots = (() => {
  const GUTTER = 92; // px left of the time axis, for names and numbers
  const RIGHT = 8;
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const paint = (colour) => (colour.startsWith("--") ? css(colour) : colour);

  // The index of the last frame that is not after `time`.
  function frameAt(times, time) {
    let low = 0;
    let high = times.length - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (times[middle] <= time + 1e-6) low = middle;
      else high = middle - 1;
    }
    return low;
  }

  function niceStep(span, count) {
    const raw = span / Math.max(1, count);
    const unit = 10 ** Math.floor(Math.log10(raw));
    return unit * [1, 2, 2.5, 5, 10].find((k) => k * unit >= raw * 0.999);
  }

  class Timeline {
    constructor({ duration, tip, onSeek }) {
      Object.assign(this, { duration: Math.max(duration, 1e-3), tip, onSeek, time: 0 });
      this.charts = [];
      new ResizeObserver(() => this.draw()).observe(document.body);
      matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
    }

    // chart: height(), draw(ctx, frame), tell(time, y) -> {title, lines: [[colour, text], ...]}.
    add(host, chart) {
      host.replaceChildren();
      const canvas = document.createElement("canvas");
      const head = document.createElement("div");
      canvas.setAttribute("role", "img");
      canvas.setAttribute("aria-label", chart.label);
      head.className = "playhead";
      host.append(canvas, head);
      const held = { host, canvas, head, chart };
      this.charts = this.charts.filter((other) => other.host !== host);
      this.charts.push(held);
      if (!host.dataset.wired) this.wire(host);
      this.drawOne(held);
    }

    wire(host) {
      host.dataset.wired = "yes";
      const timeOf = (event) => {
        const box = host.getBoundingClientRect();
        const share = (event.clientX - box.left - GUTTER) / (box.width - GUTTER - RIGHT);
        return Math.min(1, Math.max(0, share)) * this.duration;
      };
      let down = false;
      host.addEventListener("pointerdown", (event) => {
        down = true;
        if (event.pointerType === "mouse") host.setPointerCapture(event.pointerId);
        this.onSeek(timeOf(event));
      });
      host.addEventListener("pointermove", (event) => {
        if (down) this.onSeek(timeOf(event));
        const held = this.charts.find((other) => other.host === host);
        const y = event.clientY - host.getBoundingClientRect().top;
        this.tell(held.chart.tell(timeOf(event), y), event);
      });
      const up = () => (down = false);
      host.addEventListener("pointerup", up);
      host.addEventListener("pointercancel", up);
      host.addEventListener("pointerleave", () => {
        down = false;
        this.tip.hidden = true;
      });
    }

    tell(words, event) {
      const { tip } = this;
      const title = document.createElement("b");
      title.textContent = words.title;
      const lines = words.lines.map(([colour, text]) => {
        const line = document.createElement("div");
        if (colour) {
          const dot = document.createElement("span");
          dot.className = "dot";
          dot.style.background = paint(colour);
          line.append(dot);
        }
        line.append(text);
        return line;
      });
      tip.replaceChildren(title, ...lines);
      tip.hidden = false;
      const { width, height } = tip.getBoundingClientRect();
      const right = event.clientX + 16 + width > innerWidth;
      const x = right ? Math.max(4, event.clientX - width - 14) : event.clientX + 16;
      const above = event.clientY - height - 12;
      const y = above > 4 ? above : Math.min(event.clientY + 16, innerHeight - height - 4);
      tip.style.transform = `translate(${x}px, ${y}px)`;
    }

    setTime(time) {
      this.time = time;
      for (const { host, head } of this.charts) {
        const width = host.clientWidth - GUTTER - RIGHT;
        head.style.transform = `translateX(${GUTTER + (width * time) / this.duration}px)`;
      }
    }

    draw() {
      for (const held of this.charts) this.drawOne(held);
    }

    drawOne({ host, canvas, chart }) {
      const width = host.clientWidth;
      const height = chart.height();
      const ratio = window.devicePixelRatio || 1;
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
      canvas.style.height = `${height}px`;
      const ctx = canvas.getContext("2d");
      ctx.scale(ratio, ratio);
      ctx.font = "12px system-ui, sans-serif";
      const plot = width - GUTTER - RIGHT;
      const x = (time) => GUTTER + (plot * time) / this.duration;
      chart.draw(ctx, { x, left: GUTTER, right: width - RIGHT, width, height, plot });
      this.setTime(this.time);
    }

    // The seconds under a chart.
    axis(ctx, { x, plot }, bottom) {
      const step = niceStep(this.duration, plot / 70);
      ctx.fillStyle = css("--quiet");
      ctx.textAlign = "center";
      ctx.textBaseline = "top";
      for (let i = 0; i * step <= this.duration + 1e-6; i++) {
        const label = `${+(i * step).toFixed(2)}${i === 0 ? " s" : ""}`;
        ctx.fillText(label, x(i * step), bottom + 4);
      }
    }
  }

  // series: [{name, colour, times, values, dash, fill}]; bars: [{colour, times, values}] beneath.
  function lines(timeline, { label, series, bars = [], digits, unit, zero, least }) {
    const all = series.flatMap(({ values }) => values);
    let high = all.reduce((a, b) => Math.max(a, b), least ?? -Infinity);
    let low = zero ? 0 : all.reduce((a, b) => Math.min(a, b), Infinity);
    if (high - low < 1e-9) high = low + 1;
    const step = niceStep(high - low, 3);
    low = Math.floor(low / step + 1e-9) * step;
    high = Math.ceil(high / step - 1e-9) * step;
    const plotHeight = 104;
    const barsHeight = bars.length * 11 + (bars.length ? 6 : 0);
    return {
      label,
      height: () => 6 + plotHeight + barsHeight + 20,
      draw(ctx, frame) {
        const y = (value) => 6 + plotHeight * (1 - (value - low) / (high - low));
        ctx.textAlign = "right";
        ctx.textBaseline = "middle";
        ctx.lineWidth = 1;
        for (let k = 0; low + k * step <= high + step * 1e-6; k++) {
          const value = low + k * step;
          ctx.strokeStyle = css("--line");
          ctx.beginPath();
          ctx.moveTo(frame.left, Math.round(y(value)) + 0.5);
          ctx.lineTo(frame.right, Math.round(y(value)) + 0.5);
          ctx.stroke();
          ctx.fillStyle = css("--quiet");
          ctx.fillText(`${+value.toFixed(3)}`, frame.left - 8, y(value));
        }
        ctx.lineJoin = "round";
        for (const one of series) {
          ctx.beginPath();
          one.values.forEach((value, i) => ctx.lineTo(frame.x(one.times[i]), y(value)));
          ctx.strokeStyle = paint(one.colour);
          ctx.lineWidth = one.dash ? 1.2 : 1.8;
          ctx.setLineDash(one.dash ? [4, 3] : []);
          ctx.stroke();
          ctx.setLineDash([]);
          if (!one.fill) continue;
          ctx.lineTo(frame.x(one.times.at(-1)), y(low));
          ctx.lineTo(frame.x(one.times[0]), y(low));
          ctx.globalAlpha = 0.18;
          ctx.fillStyle = paint(one.colour);
          ctx.fill();
          ctx.globalAlpha = 1;
        }
        bars.forEach(({ name, colour, times, values }, row) => {
          const top = 6 + plotHeight + 9 + row * 11;
          ctx.fillStyle = css("--quiet");
          ctx.textAlign = "right";
          ctx.font = "10px system-ui, sans-serif";
          ctx.fillText(name, frame.left - 8, top + 3);
          ctx.fillStyle = paint(colour);
          cells(times, timeline.duration, (i, from, to) => {
            if (values[i]) ctx.fillRect(frame.x(from), top, frame.x(to) - frame.x(from) + 0.5, 6);
          });
        });
        ctx.font = "12px system-ui, sans-serif";
        timeline.axis(ctx, frame, 6 + plotHeight + barsHeight);
      },
      tell: (time) => ({
        title: `${time.toFixed(2)} s`,
        lines: series
          .filter(({ times }) => time <= times.at(-1) + 1e-6)
          .map(({ name, colour, times, values, note }) => {
            const i = frameAt(times, time);
            return [colour, `${name}: ${values[i].toFixed(digits)} ${unit}${note?.(i) ?? ""}`];
          }),
      }),
    };
  }

  // Each frame lasts until the next one.
  function cells(times, duration, draw) {
    times.forEach((time, i) => draw(i, time, times[i + 1] ?? time));
  }

  // rows: [{name, colour, spans: [{start, end, colour, text, ink, words}]}]
  function spans(timeline, { label, rows, onPick }) {
    const row = 30;
    return {
      label,
      height: () => rows.length * (row + 4) + 20,
      draw(ctx, frame) {
        rows.forEach(({ name, colour, spans: parts }, k) => {
          const top = k * (row + 4);
          rowName(ctx, frame, name, colour, top + row / 2);
          for (const part of parts) {
            const from = frame.x(part.start);
            const to = frame.x(part.end);
            ctx.fillStyle = paint(part.colour);
            ctx.beginPath();
            ctx.roundRect(from + 0.5, top, Math.max(1, to - from - 1), row, 4);
            ctx.fill();
            const text = part.texts.find((words) => ctx.measureText(words).width < to - from - 10);
            if (!text) continue;
            ctx.fillStyle = paint(part.ink);
            ctx.textAlign = "center";
            ctx.textBaseline = "middle";
            ctx.fillText(text, (from + to) / 2, top + row / 2 + 0.5);
          }
        });
        timeline.axis(ctx, frame, rows.length * (row + 4) - 4);
      },
      tell(time, y) {
        const k = Math.min(rows.length - 1, Math.max(0, Math.floor(y / (row + 4))));
        const part = rows[k].spans.find(({ end }) => time <= end) ?? rows[k].spans.at(-1);
        return part ? part.words : { title: `${time.toFixed(2)} s`, lines: [] };
      },
    };
  }

  // rows: [{name, share: (frame) => 0 to 1, tell: (frame) => text}] at `times`.
  function heat(timeline, { label, rows, times }) {
    const row = 15;
    return {
      label,
      height: () => rows.length * (row + 3) + 20,
      draw(ctx, frame) {
        rows.forEach(({ name, share }, k) => {
          const top = k * (row + 3);
          rowName(ctx, frame, name, null, top + row / 2);
          ctx.fillStyle = css("--line");
          ctx.fillRect(frame.left, top, frame.x(times.at(-1)) - frame.left, row);
          const [warm, hot] = [css("--warm"), css("--hot")];
          cells(times, timeline.duration, (i, from, to) => {
            const value = share(i);
            const full = value >= 0.995;
            ctx.globalAlpha = full ? 1 : Math.min(1, value) ** 1.5 * 0.9;
            ctx.fillStyle = full ? hot : warm;
            ctx.fillRect(frame.x(from), top, frame.x(to) - frame.x(from) + 0.4, row);
          });
          ctx.globalAlpha = 1;
        });
        timeline.axis(ctx, frame, rows.length * (row + 3) - 3);
      },
      tell(time, y) {
        const k = Math.min(rows.length - 1, Math.max(0, Math.floor(y / (row + 3))));
        const i = frameAt(times, time);
        return { title: `${time.toFixed(2)} s, ${rows[k].name}`, lines: [[null, rows[k].tell(i)]] };
      },
    };
  }

  function rowName(ctx, frame, name, colour, middle) {
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    ctx.fillStyle = css("--quiet");
    let text = name;
    while (text.length > 4 && ctx.measureText(text).width > frame.left - (colour ? 26 : 12)) {
      text = `${text.slice(0, -2)}…`;
    }
    ctx.fillText(text, frame.left - 8, middle);
    if (!colour) return;
    ctx.fillStyle = paint(colour);
    ctx.beginPath();
    ctx.arc(8, middle, 5, 0, 2 * Math.PI);
    ctx.fill();
  }

  return { Timeline, lines, spans, heat, frameAt };
})();
