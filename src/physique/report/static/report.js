// A report: playback in three dimensions, and charts that go along with it.
"use strict";

(async () => {
  const byId = (id) => document.getElementById(id);
  const data = JSON.parse(byId("data").textContent);
  const { runs, names } = data;
  const { Timeline, lines, spans, heat, frameAt } = physiquePlots;
  const several = runs.length > 1;
  const duration = Math.max(...runs.map((run) => run.times.at(-1)));
  const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
  for (const run of runs) run.use = bytes(run.use);

  const state = { time: 0, playing: false, run: 0 };
  const toggles = { surface: "skin", ghost: true, effort: true, follow: true };
  let stage = null;

  // ------------------------------------------------------------------------------ charts
  const timeline = new Timeline({ duration, tip: byId("tip"), onSeek: (time) => seek(time) });
  const chart = (name) => document.querySelector(`[data-chart="${name}"]`);

  function wordsOf(part) {
    const when = `${part.start.toFixed(2)} to ${part.end.toFixed(2)} s: ${part.level}`;
    return { title: when, lines: part.causes.map(([word, text]) => [null, `${word}: ${text}`]) };
  }

  function costOf(part) {
    const shares = Object.entries(part.shares).sort(([, a], [, b]) => b - a);
    const listed = shares.map(([word, share]) => `${word} ${(100 * share).toFixed(0)} %`).join(", ");
    return [null, `Cost ${part.difficulty.toFixed(1)} a second: ${listed}`];
  }

  function difficultyRow(run) {
    return {
      name: several ? run.short : "",
      colour: several ? run.colour : null,
      spans: run.windows.map((part) => {
        const causes = part.causes.map(([word]) => word);
        const dark = part.level === "very hard" || part.level === "lost";
        return {
          start: part.start,
          end: part.end,
          colour: `--${part.level.replace(" ", "-")}`,
          ink: dark ? "#ffffff" : "--ink",
          texts: [causes.join(", "), causes.slice(0, 2).join(", "), causes[0] ?? part.level, part.level],
          words: { ...wordsOf(part), lines: [costOf(part), ...wordsOf(part).lines] },
        };
      }),
    };
  }

  timeline.add(
    chart("difficulty"),
    spans(timeline, { label: "Difficulty of each part", rows: runs.map(difficultyRow) }),
  );
  timeline.add(
    chart("error"),
    lines(timeline, {
      label: "Distance of the joints from the recording",
      digits: 0,
      unit: "mm",
      zero: true,
      series: runs.map((run) => ({
        name: several ? run.short : "mean",
        colour: run.colour,
        times: run.times,
        values: run.error,
        note: (i) => `, ${names.joints[run.worstJoint[i]]} ${run.worst[i]} mm`,
      })),
    }),
  );
  timeline.add(
    chart("height"),
    lines(timeline, {
      label: "Height of the hips",
      digits: 2,
      unit: "m",
      series: runs.flatMap((run) => {
        const shared = { colour: run.colour, times: run.times };
        return [
          { ...shared, name: `${several ? run.short : "simulated"}`, values: run.height },
          { ...shared, name: "its recording", values: run.heightSource, dash: true },
        ];
      }),
    }),
  );

  function detailCharts() {
    const run = runs[state.run];
    const count = names.hinges.length;
    const strongest = (group, frame) => {
      let best = group.hinges[0];
      for (const hinge of group.hinges) {
        if (run.use[frame * count + hinge] > run.use[frame * count + best]) best = hinge;
      }
      return best;
    };
    timeline.add(
      chart("effort"),
      heat(timeline, {
        label: "Torque in use of each group of joints",
        times: run.times,
        rows: names.groups.map((group) => ({
          name: group.name,
          share: (i) => run.use[i * count + strongest(group, i)] / names.full,
          tell(i) {
            const hinge = strongest(group, i);
            const share = run.use[i * count + hinge] / names.full;
            const limit = run.limits[hinge];
            const torque = `${(share * limit).toFixed(0)} of ${limit.toFixed(0)} Nm`;
            return `${names.hinges[hinge]}: ${torque}, ${(100 * share).toFixed(0)} %`;
          },
        })),
      }),
    );
    const sides = [["left foot", "--left"], ["right foot", "--right"]];
    const series = sides.map(([name, colour], k) => {
      return { name, colour, times: run.times, values: run.force[k], fill: true };
    });
    const rest = run.forceOther.some((value) => value > 0.05);
    byId("rest").hidden = !rest;
    if (rest) {
      const other = { name: "rest of the body", colour: "--hot" };
      series.push({ ...other, times: run.times, values: run.forceOther });
    }
    timeline.add(
      chart("floor"),
      lines(timeline, {
        label: "Upward force of the floor",
        digits: 2,
        unit: "body weights",
        zero: true,
        least: 1,
        series,
        bars: sides.map(([name, colour], k) => ({
          name, colour, times: run.times, values: run.onFloorSource[k],
        })),
      }),
    );
  }

  // What makes the present part hard: for two runs side by side, of more for the one chosen.
  function why(time = state.time) {
    const told = (runs.length > 2 ? [runs[state.run]] : runs).map((run) => {
      const part = run.windows.find(({ end }) => time < end) ?? run.windows.at(-1);
      return part && { run, part };
    });
    const key = told.map((one) => one && `${one.run.short} ${one.part.start}`).join();
    if (why.shown === key) return;
    why.shown = key;
    const blocks = told.filter(Boolean).map(({ run, part }) => {
      const block = document.createElement("div");
      const title = document.createElement("p");
      const { title: when, lines: causes } = wordsOf(part);
      title.append(dot(run.colour), `${several ? `${run.short}, ` : ""}${when}`);
      const list = document.createElement("ul");
      for (const [, text] of causes) {
        const [word, ...rest] = text.split(": ");
        const item = document.createElement("li");
        const strong = document.createElement("span");
        strong.className = "word";
        strong.textContent = word;
        item.append(strong, `: ${rest.join(": ")}`);
        list.append(item);
      }
      block.append(title, list);
      return block;
    });
    byId("why").replaceChildren(...blocks);
  }

  // Keep room for the longest of them, so that nothing below jumps while the motion plays.
  function reserve() {
    const box = byId("why");
    box.style.minHeight = "";
    let most = 0;
    for (const { start } of runs.flatMap((run) => run.windows)) {
      why(start + 1e-6);
      most = Math.max(most, box.offsetHeight);
    }
    box.style.minHeight = `${most}px`;
    why();
  }

  function dot(colour) {
    const mark = document.createElement("span");
    mark.className = "dot";
    mark.style.background = colour;
    return mark;
  }

  // ------------------------------------------------------------------------------ the stage
  const colours = () => {
    const css = getComputedStyle(document.documentElement);
    const get = (name) => css.getPropertyValue(name).trim();
    return { background: get("--stage"), tile: get("--stage-tile"), shadow: +get("--shadow") };
  };

  async function openStage() {
    const figures = runs.map((run, i) => ({
      glb: bytes(byId(`model-${i}`).textContent).buffer,
      shift: run.shift,
      colour: run.colour,
    }));
    const canvas = byId("stage");
    stage = await PhysiqueStage.createStage(canvas, { figures });
    stage.theme(colours());
    stage.resize();
    stage.look("diagonal");
    new ResizeObserver(() => stage.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => stage.theme(colours()));
  }

  const jointsOfHinges = names.hingeJoint;
  function effort() {
    runs.forEach((run, k) => {
      const i = frameAt(run.times, state.time);
      const use = {};
      jointsOfHinges.forEach((joint, h) => {
        const share = run.use[i * jointsOfHinges.length + h] / names.full;
        use[joint] = Math.max(use[joint] ?? 0, share);
      });
      stage.effort(k, use);
    });
  }

  // ------------------------------------------------------------------------------ time
  function seek(time) {
    state.time = Math.min(duration, Math.max(0, time));
    if (stage) {
      effort();
      stage.setTime(state.time);
    }
    timeline.setTime(state.time);
    byId("scrub").value = state.time / duration;
    byId("now").textContent = `${state.time.toFixed(2)} s`;
    why();
  }

  let last = null;
  function tick(now) {
    if (!state.playing) return;
    const speed = +byId("speed").value;
    const passed = last === null ? 0 : Math.min(0.2, (now - last) / 1000);
    last = now;
    const time = state.time + passed * speed;
    seek(time > duration ? 0 : time);
    requestAnimationFrame(tick);
  }

  function play(on) {
    state.playing = on;
    last = null;
    byId("play").textContent = on ? "❚❚" : "▶\uFE0E";
    byId("play").setAttribute("aria-pressed", String(on));
    if (on) requestAnimationFrame(tick);
  }

  function stepFrames(count) {
    play(false);
    const run = runs.reduce((a, b) => (a.times.length >= b.times.length ? a : b));
    const i = frameAt(run.times, state.time) + count;
    seek(run.times[Math.min(run.times.length - 1, Math.max(0, i))]);
  }

  function changeSpeed(by) {
    const select = byId("speed");
    select.selectedIndex = Math.min(select.length - 1, Math.max(0, select.selectedIndex + by));
  }

  // ------------------------------------------------------------------------------ controls
  function toggle(name) {
    const swap = { skin: "capsules", capsules: "skin" };
    toggles[name] = name === "surface" ? swap[toggles.surface] : !toggles[name];
    const pressed = name === "surface" ? toggles.surface === "capsules" : toggles[name];
    const button = document.querySelector(`[data-toggle="${name}"]`);
    button.setAttribute("aria-pressed", String(pressed));
    if (!stage) return;
    stage.set(name, toggles[name]);
    seek(state.time);
  }

  // Look at one run, or at all of them (null); the charts below show one in any case.
  function choose(index) {
    if (index !== null && index !== state.run) {
      state.run = index;
      detailCharts();
      reserve();
    }
    stage?.set("focus", several ? index : null);
    document.querySelectorAll("[data-run]").forEach((button) => {
      const inTabs = button.parentElement.id === "tabs";
      const chosen = button.dataset.run === String(inTabs ? state.run : index);
      button.setAttribute("aria-pressed", String(chosen));
    });
  }

  function runButton(index) {
    const button = document.createElement("button");
    button.type = "button";
    button.dataset.run = String(index);
    if (index === null) button.textContent = "All";
    else button.append(dot(runs[index].colour), runs[index].short);
    button.addEventListener("click", () => choose(index));
    return button;
  }

  if (several) {
    byId("figures").append(runButton(null), ...runs.map((_, i) => runButton(i)));
    byId("tabs").append(...runs.map((_, i) => runButton(i)));
  }
  byId("play").addEventListener("click", () => play(!state.playing));
  byId("back").addEventListener("click", () => stepFrames(-1));
  byId("next").addEventListener("click", () => stepFrames(1));
  byId("scrub").addEventListener("input", (event) => seek(event.target.value * duration));
  document.querySelectorAll("[data-toggle]").forEach((button) => {
    button.addEventListener("click", () => toggle(button.dataset.toggle));
  });
  document.querySelectorAll("[data-look]").forEach((button) => {
    button.addEventListener("click", () => stage?.look(button.dataset.look));
  });

  const keys = {
    " ": () => play(!state.playing),
    Home: () => seek(0),
    End: () => seek(duration),
    "+": () => changeSpeed(1),
    "-": () => changeSpeed(-1),
    c: () => toggle("surface"),
    g: () => toggle("ghost"),
    e: () => toggle("effort"),
    f: () => toggle("follow"),
    0: () => choose(null),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const { tagName } = event.target;
    const busy = tagName === "SELECT" || tagName === "SUMMARY" || tagName === "BUTTON";
    if (busy && [" ", "Enter", "Home", "End"].includes(event.key)) return;
    if (event.key === "ArrowLeft" || event.key === "ArrowRight") {
      if (tagName === "SELECT") return;
      stepFrames((event.key === "ArrowRight" ? 1 : -1) * (event.shiftKey ? 10 : 1));
    } else if (/^[1-9]$/.test(event.key) && event.key <= runs.length) choose(event.key - 1);
    else if (Object.hasOwn(keys, event.key)) keys[event.key]();
    else return;
    event.preventDefault();
  });

  let width = 0;
  new ResizeObserver(() => {
    if (byId("why").clientWidth === width) return;
    width = byId("why").clientWidth;
    reserve();
  }).observe(byId("why"));
  byId("total").textContent = `of ${duration.toFixed(2)} s`;
  detailCharts();
  choose(null);
  seek(0);
  try {
    await openStage();
  } catch (fault) {
    byId("stage-note").textContent = `The figures need WebGL, which this browser does not offer (${fault.message}).`;
    byId("stage-note").hidden = false;
  }
  choose(null);
  seek(0);
  document.documentElement.dataset.ready = stage ? "stage" : "charts";
  if (stage && !matchMedia("(prefers-reduced-motion: reduce)").matches) play(true);
})();
