// The table of scenes: filtered, sorted, a page at a time. What it shows is set as text, never as markup.
"use strict";

/** What `packed::letters` packed. */
async function unpack(letters) {
  const bytes = Uint8Array.from(atob(letters), (letter) => letter.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return JSON.parse(await new Response(stream).text());
}

/** A new element with a class and text. */
function element(name, className, text) {
  const made = document.createElement(name);
  if (className) made.className = className;
  if (text !== undefined) made.textContent = text;
  return made;
}

const PAGE = 50;

async function sceneTable() {
  const source = document.getElementById("rows");
  if (!source) return;
  const { runs, reasons, rows } = await unpack(source.textContent);
  const body = document.querySelector("#scenes tbody");
  const find = document.getElementById("find");
  const run = document.getElementById("run");
  const chips = [...document.querySelectorAll("#reasons button")];
  const state = { reason: "", page: 0, key: "trouble", down: true };

  // A row: run, scene, numbers of reasons, end, score or null, story, number of its drive in the player or -1.
  const passes = ([of, scene, why, end, , story]) => {
    if (run && run.value !== "" && Number(run.value) !== of) return false;
    if (state.reason === "passed" ? why.length > 0 || end === "undrivable" : state.reason === "failed" ? why.length === 0
      : state.reason !== "" && !why.some((index) => reasons[index] === state.reason)) return false;
    const words = find.value.trim().toLowerCase();
    return !words || `${scene} ${story}`.toLowerCase().includes(words);
  };
  const order = {
    trouble: () => 0,
    scene: (a, b) => (a[1] < b[1] ? -1 : a[1] > b[1] ? 1 : 0),
    score: (a, b) => (a[4] ?? -1) - (b[4] ?? -1),
  };

  function show() {
    const shown = rows.filter(passes);
    if (state.key !== "trouble") shown.sort(order[state.key]);
    if (!state.down) shown.reverse();
    const pages = Math.max(1, Math.ceil(shown.length / PAGE));
    state.page = Math.min(state.page, pages - 1);
    const from = state.page * PAGE;
    body.replaceChildren(...shown.slice(from, from + PAGE).map(line));
    const last = Math.min(from + PAGE, shown.length);
    const text = shown.length ? `${from + 1} to ${last} of ${shown.length}` : "no drive is like that";
    document.getElementById("shown").textContent = text;
    document.getElementById("before").disabled = state.page === 0;
    document.getElementById("after").disabled = state.page + 1 >= pages;
  }

  function line([of, scene, why, end, score, story, drive]) {
    const row = element("tr");
    row.append(element("td", "words id", scene));
    if (run) row.append(element("td", "words", runs[of]));
    const tags = element("td", "words");
    if (why.length) for (const index of why) tags.append(element("span", "tag", reasons[index]), " ");
    else tags.append(element("span", "tag calm", end === "undrivable" ? end : "passed"));
    row.append(tags, element("td", "words end", end));
    if (document.querySelector("#scenes th.score")) row.append(element("td", "score", score === null ? "-" : score.toFixed(3)));
    row.append(element("td", "words story", story));
    const cell = element("td", "play");
    if (drive >= 0) {
      const button = element("button", "", "Play");
      button.setAttribute("aria-label", `Play ${scene}, ${runs[of]}`);
      button.addEventListener("click", () => document.dispatchEvent(new CustomEvent("drive", { detail: drive })));
      cell.append(button);
    }
    row.append(cell);
    return row;
  }

  for (const chip of chips) chip.addEventListener("click", () => {
    state.reason = state.reason === chip.value ? "" : chip.value;
    state.page = 0;
    for (const other of chips) other.setAttribute("aria-pressed", String(other.value === state.reason));
    show();
  });
  for (const input of [find, run]) input?.addEventListener("input", () => { state.page = 0; show(); });
  for (const head of document.querySelectorAll("#scenes th[data-key]")) head.querySelector("button").addEventListener("click", () => {
    if (state.key === head.dataset.key) state.down = !state.down;
    else [state.key, state.down] = [head.dataset.key, true];
    for (const other of document.querySelectorAll("#scenes th[data-key]")) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", state.down === (state.key === "trouble") ? "descending" : "ascending");
    state.page = 0;
    show();
  });
  document.getElementById("before").addEventListener("click", () => { state.page -= 1; show(); });
  document.getElementById("after").addEventListener("click", () => { state.page += 1; show(); });
  document.getElementById("filters").hidden = false;
  document.getElementById("pager").hidden = false;
  show();
}

sceneTable();
