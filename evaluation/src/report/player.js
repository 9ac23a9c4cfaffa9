// The player: a drive seen from above, step by step. `reel.rs` packs what it plays.

/** A row of numbers from its differences: `packed.rs`. */
function restored([order, ...row]) {
  for (let time = 0; time < order; time += 1) {
    let sum = 0;
    row = row.map((value) => (sum += value));
  }
  return row;
}

/** Numbers of a reel in metres, radians and metres a second. */
function developed(film) {
  const [place, map, turn, rate] = film.q;
  const scaled = (row, quantum) => restored(row).map((value) => value * quantum);
  const run = ([from, x, y, heading]) => ({ from, x: scaled(x, place), y: scaled(y, place), heading: scaled(heading, turn) });
  const path = (lines, close) => {
    const all = new Path2D();
    for (const [x, y] of lines.map((line) => line.map((row) => scaled(row, map)))) {
      x.forEach((value, index) => (index ? all.lineTo(value, y[index]) : all.moveTo(value, y[index])));
      if (close) all.closePath();
    }
    return all;
  };
  const way = (row, [x, y]) => {
    const points = [];
    for (let index = 0; index < row.length; index += 2) {
      x += row[index] * place;
      y += row[index + 1] * place;
      points.push([x, y]);
    }
    return points;
  };
  const av = run(film.av.run);
  const agents = film.agents.map((agent) => ({ ...agent, size: agent.size.map((side) => side * place), runs: agent.runs.map(run) }));
  let futures = [];
  return {
    frames: av.x.length,
    map: {
      lanes: path(film.map.lanes), bikes: path(film.map.bikes), edges: path(film.map.edges), white: path(film.map.white),
      yellow: path(film.map.yellow), dashed: path(film.map.dashed), crossings: path(film.map.crossings, true),
      areas: path(film.map.areas, true), stops: film.map.stops.map((at) => at.map((value) => value * map)),
    },
    av, size: film.av.size.map((side) => side * place), agents,
    speed: scaled(film.speed, rate), acceleration: scaled(film.acc, rate), limit: scaled(film.limit, rate),
    log: film.log.map(run),
    signals: film.signals.map(({ at, shows }) => ({ at: at.map((value) => value * place), shows: shows.flatMap(([state, frames]) => Array(frames).fill(state)) })),
    plans: film.plans.map((row, frame) => [[av.x[frame], av.y[frame]], ...way(row, [av.x[frame], av.y[frame]])]),
    futures: film.futures.map((told, frame) => (futures = told === null ? futures : told.map(([percent, tracks]) => ({
      percent,
      lines: tracks.map(([number, row]) => {
        const now = posed(agents[number].runs, frame);
        const from = now ? [now.x, now.y] : way(row.slice(0, 2), [0, 0])[0];
        return [from, ...way(row, now ? from : [0, 0])];
      }),
    })))),
    beside: film.beside && { label: film.beside.label, runs: [run(film.beside.run)] },
    events: film.events.map(([frame, text, fault]) => ({ frame: Math.min(frame, av.x.length - 1), text, fault })),
  };
}

/** Where somebody is at a time between two frames; null where nobody is. */
function posed(runs, time) {
  for (const { from, x, y, heading } of runs) {
    const at = time - from;
    if (at < 0 || at > x.length - 1) continue;
    const before = Math.floor(at), after = Math.min(before + 1, x.length - 1), share = at - before;
    const mix = (row) => row[before] + share * (row[after] - row[before]);
    const turn = Math.atan2(Math.sin(heading[after] - heading[before]), Math.cos(heading[after] - heading[before]));
    return { x: mix(x), y: mix(y), heading: heading[before] + share * turn };
  }
  return null;
}

/** Frame 0 is before the first step; the frame after a step shows what came of it. */
const named = (frame) => (frame ? `step ${frame - 1}` : "start");

const KINDS = ["vehicle", "pedestrian", "cyclist", "other"];
const RATE = 10; // frames a second

function player() {
  const section = document.getElementById("player");
  if (!section) return;
  const at = (id) => document.getElementById(id);
  const [stage, timeline, range, choice, play] = ["stage", "timeline", "range", "choice", "play"].map(at);
  const reels = [...document.querySelectorAll("script.reel")];
  const films = new Map();
  const state = { film: null, drive: -1, time: 0, playing: false, speed: 1, zoom: 1, last: 0, asked: 0 };
  let colours = {};

  const readColours = () => {
    const style = getComputedStyle(document.documentElement);
    const names = ["ground", "road", "lane", "edge", "white", "yellow", "cross", "area", "av", "plan", "future", "log", "beside", "reacts", "rim", "ink",
      "muted", "line", "accent", "bad", "tint", "red", "amber", "green", "unlit", ...KINDS];
    colours = Object.fromEntries(names.map((name) => [name, style.getPropertyValue(`--${name}`).trim()]));
  };

  /** A canvas as sharp as the screen; its context, width and height in CSS pixels. */
  function sharp(canvas) {
    const ratio = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      [canvas.width, canvas.height] = [Math.round(width * ratio), Math.round(height * ratio)];
    }
    const pen = canvas.getContext("2d");
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    return { pen, width, height };
  }

  function draw() {
    const { film } = state;
    if (!film) return;
    drawStage(film);
    drawTimeline(film);
    const frame = Math.round(state.time);
    range.value = frame;
    const seconds = (frame / RATE).toFixed(1);
    range.setAttribute("aria-valuetext", `${named(frame)}, ${seconds} seconds`);
    at("step").textContent = frame ? `${frame - 1} of ${film.frames - 2}` : "start";
    at("seconds").textContent = `${seconds} s`;
    at("speed").textContent = `${film.speed[frame].toFixed(1)} m/s`;
    at("limit").textContent = film.limit[frame] >= 0 ? `${film.limit[frame].toFixed(1)} m/s` : "-";
    at("acceleration").textContent = `${film.acceleration[frame].toFixed(1)} m/s²`;
    for (const item of at("events").children) item.classList.toggle("now", Number(item.dataset.frame) === frame);
  }

  function drawStage(film) {
    const { pen, width, height } = sharp(stage);
    const metres = Math.max(60, Math.min(110, width / 9)) / state.zoom;
    const scale = width / metres;
    const av = posed([film.av], state.time);
    pen.fillStyle = colours.ground;
    pen.fillRect(0, 0, width, height);
    pen.translate(width / 2, height / 2);
    pen.scale(scale, -scale);
    pen.translate(-av.x, -av.y);
    pen.lineJoin = pen.lineCap = "round";
    const line = (path, colour, metres, hairs = 0, dash = []) => {
      pen.strokeStyle = colour;
      pen.lineWidth = Math.max(metres, hairs / scale);
      pen.setLineDash(dash);
      pen.stroke(path);
    };
    pen.fillStyle = colours.area;
    pen.fill(film.map.areas);
    for (const path of [film.map.white, film.map.yellow, film.map.dashed, film.map.lanes]) line(path, colours.road, 4.2);
    line(film.map.bikes, colours.road, 2);
    line(film.map.lanes, colours.lane, 0, 1);
    pen.globalAlpha = 0.75;
    pen.fillStyle = colours.cross;
    pen.fill(film.map.crossings);
    pen.globalAlpha = 1;
    line(film.map.white, colours.white, 0.15, 1);
    line(film.map.dashed, colours.white, 0.15, 1, [3, 5]);
    line(film.map.yellow, colours.yellow, 0.15, 1);
    line(film.map.edges, colours.edge, 0.2, 1.4);
    const dot = (x, y, metres, colour) => {
      pen.beginPath();
      pen.arc(x, y, Math.max(metres, 3.5 / scale), 0, 2 * Math.PI);
      [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [colour, colours.rim, 1.5 / scale];
      pen.setLineDash([]);
      pen.fill();
      pen.stroke();
    };
    for (const [x, y] of film.map.stops) dot(x, y, 0.9, colours.red);
    const frame = Math.min(Math.floor(state.time + 1e-6), film.frames - 1);
    if (at("futures").checked) drawFutures(film.futures[frame], pen, scale);
    if (at("plans").checked && film.plans[frame].length > 1) {
      pen.globalAlpha = 0.9;
      line(polyline(film.plans[frame]), colours.plan, 0.7, 3);
      pen.globalAlpha = 1;
    }
    for (const agent of film.agents) {
      const pose = posed(agent.runs, state.time);
      if (pose) body(pen, scale, pose, agent.size, colours[KINDS[agent.kind]], agent.kind === 1, agent.reacts <= frame ? colours.reacts : colours.rim);
    }
    if (at("log").checked) {
      const logged = posed(film.log, state.time);
      if (logged) outline(pen, scale, logged, film.size, colours.log, [0.8, 0.6]);
    }
    const other = film.beside && at("beside").checked && posed(film.beside.runs, state.time);
    if (other) outline(pen, scale, other, film.size, colours.beside, []);
    body(pen, scale, av, film.size, colours.av, false, colours.rim);
    for (const { at: [x, y], shows } of film.signals) {
      if (shows[frame] >= 0) dot(x, y, 0.8, colours[["unlit", "red", "amber", "green"][shows[frame]]]);
    }
    scaleBar(pen, scale, height);
  }

  function drawFutures(futures, pen, scale) {
    for (const { percent, lines } of [...futures].reverse()) {
      pen.globalAlpha = 0.2 + 0.75 * (percent / 100);
      pen.strokeStyle = colours.future;
      pen.lineWidth = Math.max(0.3, 1.8 / scale);
      pen.setLineDash([]);
      for (const points of lines) pen.stroke(polyline(points));
    }
    pen.globalAlpha = 1;
  }

  function polyline(points) {
    const path = new Path2D();
    points.forEach(([x, y], index) => (index ? path.lineTo(x, y) : path.moveTo(x, y)));
    return path;
  }

  function box(pen, { x, y, heading }, [length, width], least, paint) {
    const [along, across] = [Math.max(length, least), Math.max(width, least / 2)];
    pen.save();
    pen.translate(x, y);
    pen.rotate(heading);
    pen.beginPath();
    pen.roundRect(-along / 2, -across / 2, along, across, 0.25 * across);
    paint(along, across);
    pen.restore();
  }

  function body(pen, scale, pose, size, colour, round, nose) {
    pen.setLineDash([]);
    [pen.fillStyle, pen.strokeStyle, pen.lineWidth] = [colour, colours.rim, 1.5 / scale];
    if (round) {
      pen.beginPath();
      pen.arc(pose.x, pose.y, Math.max(0.45, 3 / scale), 0, 2 * Math.PI);
      pen.stroke();
      pen.fill();
      return;
    }
    box(pen, pose, size, 4 / scale, (along, across) => {
      pen.stroke();
      pen.fill();
      pen.beginPath();
      pen.moveTo(along * 0.42, 0);
      pen.lineTo(along * 0.42 - across * 0.5, across * 0.28);
      pen.lineTo(along * 0.42 - across * 0.5, -across * 0.28);
      pen.fillStyle = nose;
      pen.fill();
    });
  }

  function outline(pen, scale, pose, size, colour, dash) {
    pen.setLineDash(dash);
    [pen.strokeStyle, pen.lineWidth] = [colour, Math.max(0.16, 1.6 / scale)];
    box(pen, pose, size, 4 / scale, () => pen.stroke());
    pen.setLineDash([]);
  }

  function scaleBar(pen, scale, height) {
    const ratio = window.devicePixelRatio || 1;
    pen.setTransform(ratio, 0, 0, ratio, 0, 0);
    [pen.fillStyle, pen.font] = [colours.muted, "12px system-ui, sans-serif"];
    pen.fillRect(14, height - 16, 10 * scale, 2);
    pen.fillText("10 m", 14, height - 22);
  }

  function drawTimeline(film) {
    const { pen, width, height } = sharp(timeline);
    const [left, right, top, bottom] = [8, width - 8, 6, height - 6];
    const x = (frame) => left + ((right - left) * frame) / Math.max(1, film.frames - 1);
    const most = Math.max(5, ...film.speed, ...film.limit);
    const y = (speed) => bottom - ((bottom - top) * Math.max(0, speed)) / most;
    pen.clearRect(0, 0, width, height);
    pen.beginPath();
    film.speed.forEach((speed, frame) => pen.lineTo(x(frame), y(speed)));
    [pen.strokeStyle, pen.lineWidth, pen.lineJoin] = [colours.accent, 1.6, "round"];
    pen.stroke();
    pen.lineTo(right, bottom);
    pen.lineTo(left, bottom);
    pen.fillStyle = colours.tint;
    pen.fill();
    for (const { frame, fault } of film.events) {
      pen.fillStyle = fault ? colours.bad : colours.muted;
      pen.fillRect(x(frame) - 1, top, 2, bottom - top);
    }
    pen.fillStyle = colours.ink;
    pen.fillRect(x(state.time) - 1, 0, 2, height);
  }

  function tick(now) {
    if (!state.playing) return;
    state.time += ((now - state.last) / 1000) * RATE * state.speed;
    state.last = now;
    if (state.time >= state.film.frames - 1) {
      state.time = state.film.frames - 1;
      pause();
    }
    draw();
    if (state.playing) requestAnimationFrame(tick);
  }

  function pause() {
    state.playing = false;
    play.textContent = "Play";
  }

  function start() {
    if (state.time >= state.film.frames - 1) state.time = 0;
    state.playing = true;
    state.last = performance.now();
    play.textContent = "Pause";
    requestAnimationFrame(tick);
  }

  const toggle = () => { if (state.film) { if (state.playing) { pause(); state.time = Math.round(state.time); draw(); } else start(); } };
  const seek = (frame) => {
    if (!state.film) return;
    pause();
    state.time = Math.max(0, Math.min(state.film.frames - 1, Math.round(frame)));
    draw();
  };
  const event = (way) => {
    const frames = (state.film?.events ?? []).map(({ frame }) => frame).filter((frame) => way * (frame - Math.round(state.time)) > 0);
    if (frames.length) seek(way > 0 ? Math.min(...frames) : Math.max(...frames));
  };
  const zoom = (factor) => { state.zoom = Math.max(0.3, Math.min(6, state.zoom * factor)); draw(); };

  async function choose(drive, follow) {
    if (!reels[drive]) return;
    pause();
    state.asked = drive;
    choice.value = drive;
    const reel = reels[drive];
    if (!films.has(drive)) films.set(drive, developed(await unpack(reel.textContent)));
    if (state.asked !== drive) return; // another was chosen meanwhile
    [state.film, state.drive, state.time] = [films.get(drive), drive, 0];
    const { film } = state;
    range.max = film.frames - 1;
    at("title").textContent = `${reel.dataset.scene} · ${reel.dataset.run}`;
    at("ended").textContent = reel.dataset.end;
    at("drive-note").textContent = reel.dataset.note;
    at("drive-note").hidden = !reel.dataset.note;
    at("reacts-legend").hidden = !film.agents.some((agent) => agent.reacts !== undefined);
    at("beside-label").hidden = at("beside-legend").hidden = !film.beside;
    at("beside-name").textContent = at("beside-legend-name").textContent = film.beside ? film.beside.label : "";
    at("events").replaceChildren(...film.events.map(({ frame, text, fault }) => {
      const item = element("li", fault ? "fault" : "");
      item.dataset.frame = frame;
      const button = element("button");
      button.append(element("span", "", named(frame)), element("span", "", text));
      button.addEventListener("click", () => seek(frame));
      item.append(button);
      return item;
    }));
    at("nothing").hidden = film.events.length > 0;
    at("previous").disabled = drive === 0;
    at("next").disabled = drive === reels.length - 1;
    // A failure is seen best a little before it happens.
    const first = film.events.find(({ fault }) => fault);
    state.time = first ? Math.max(0, first.frame - 20) : 0;
    draw();
    if (follow) {
      section.scrollIntoView({ block: "start" });
      stage.focus({ preventScroll: true });
      history.replaceState(null, "", `#drive-${drive}`);
    }
  }

  play.addEventListener("click", toggle);
  at("back").addEventListener("click", () => seek(Math.round(state.time) - 1));
  at("forth").addEventListener("click", () => seek(Math.round(state.time) + 1));
  at("event-back").addEventListener("click", () => event(-1));
  at("event-forth").addEventListener("click", () => event(1));
  at("nearer").addEventListener("click", () => zoom(1.35));
  at("farther").addEventListener("click", () => zoom(1 / 1.35));
  at("previous").addEventListener("click", () => choose(state.drive - 1, true));
  at("next").addEventListener("click", () => choose(state.drive + 1, true));
  at("rate").addEventListener("input", () => { state.speed = Number(at("rate").value); });
  choice.addEventListener("input", () => choose(Number(choice.value), true));
  range.addEventListener("input", () => seek(Number(range.value)));
  stage.addEventListener("click", toggle);
  const scrub = (pointer) => {
    const { left, width } = timeline.getBoundingClientRect();
    if (state.film) seek(((pointer.clientX - left - 8) / (width - 16)) * (state.film.frames - 1));
  };
  timeline.addEventListener("pointerdown", (pointer) => { timeline.setPointerCapture(pointer.pointerId); scrub(pointer); });
  timeline.addEventListener("pointermove", (pointer) => { if (pointer.buttons) scrub(pointer); });
  for (const id of ["plans", "futures", "log", "beside"]) at(id).addEventListener("input", draw);
  document.addEventListener("drive", ({ detail }) => choose(detail, true));

  const keys = {
    " ": toggle, k: toggle,
    ArrowLeft: ({ shiftKey }) => seek(Math.round(state.time) - (shiftKey ? 10 : 1)),
    ArrowRight: ({ shiftKey }) => seek(Math.round(state.time) + (shiftKey ? 10 : 1)),
    Home: () => seek(0), End: () => seek(Infinity),
    "[": () => event(-1), "]": () => event(1), "+": () => zoom(1.35), "=": () => zoom(1.35), "-": () => zoom(1 / 1.35),
    p: () => choose(state.drive - 1, true), n: () => choose(state.drive + 1, true),
  };
  section.addEventListener("keydown", (pressed) => {
    const { key, target, ctrlKey, metaKey, altKey } = pressed;
    if (ctrlKey || metaKey || altKey || !keys[key]) return;
    // Its own keys stay its own: a button is pressed by a space, a list is walked by arrows.
    if (target.tagName === "SELECT" || (key === " " && target !== stage && target !== range)) return;
    pressed.preventDefault();
    keys[key](pressed);
  });

  const again = () => { readColours(); draw(); };
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", again);
  addEventListener("beforeprint", () => { document.documentElement.dataset.print = ""; again(); });
  addEventListener("afterprint", () => { delete document.documentElement.dataset.print; again(); });
  new ResizeObserver(draw).observe(stage);
  readColours();
  section.hidden = false;
  const asked = /^#drive-(\d+)$/.exec(location.hash);
  choose(asked && reels[asked[1]] ? Number(asked[1]) : 0, Boolean(asked));
}

player();
