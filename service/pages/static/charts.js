// Tilt, roll, pan and height over time, with their intervals, by the chart library of the page.

const root = document.getElementById("camera");
const place = document.getElementById("charts");
const PARAMETERS = [
  { name: "Tilt", field: "tilt_deg", prior: "tilt_rad", unit: "°", digits: 2 },
  { name: "Roll", field: "roll_deg", prior: "roll_rad", unit: "°", digits: 2 },
  { name: "Pan", field: "heading_deg", prior: "heading_rad", unit: "°", digits: 2 },
  { name: "Height", field: "height_m", prior: "height_m", unit: " m", digits: 2 },
];
const Z90 = 1.645; // standard deviations to each side of an interval that holds in 90 of 100 cases
const POINTS = 1000;
const DAY_MS = 86_400_000;
let days = 0;
let drawn = ""; // what the charts show, so that news without any change draws nothing

const facts = () => JSON.parse(document.getElementById("chart-facts").dataset.facts);
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

const clock = new Intl.DateTimeFormat("sv-SE", {
  timeZone: root.dataset.zone, dateStyle: "short", timeStyle: "medium",
});
/** A time by the cameras' clock, as the chart library reads it: it knows no zones. */
const local = (at) => clock.format(new Date(at));

async function history() {
  const query = new URLSearchParams({ points: POINTS });
  if (days) query.set("from", new Date(Date.now() - days * DAY_MS).toISOString());
  const answer = await fetch(`/cameras/${encodeURIComponent(root.dataset.camera)}/pose/history?${query}`);
  if (!answer.ok) throw new Error(`history: ${answer.status}`);
  return (await answer.json()).items;
}

const priorOf = (prior, parameter) =>
  parameter.prior.endsWith("_rad") ? (prior[parameter.prior] * 180) / Math.PI : prior[parameter.prior];

/** The traces of one parameter: its band, its line, and the prior pose under them. */
function traces(items, parameter, at, priors) {
  const axes = { xaxis: "x", yaxis: at ? `y${at + 1}` : "y" };
  const x = items.map((item) => local(item.to));
  const sd = items.map((item) => item.sd?.[parameter.field] ?? null);
  // What the tracks cannot tell is a gap, not the prior.
  const y = items.map((item, n) => (sd[n] === null ? null : item[parameter.field]));
  const edge = (sign) => y.map((value, n) => (value === null ? null : value + sign * Z90 * sd[n]));
  const quiet = { mode: "lines", line: { width: 0 }, hoverinfo: "skip", showlegend: false };
  const served = colour("--served");
  return [
    ...band(x, edge(-1), edge(1)).map(([bandX, bandY]) => ({
      ...axes, ...quiet, x: bandX, y: bandY, fill: "toself", fillcolor: served + "2e",
    })),
    {
      ...axes, ...priorSteps(priors, parameter, x), mode: "lines", name: "prior",
      line: { color: colour("--prior"), dash: "dash", width: 1.5, shape: "hv" },
      hoverinfo: "skip",
    },
    {
      ...axes, x, y, mode: "lines+markers", name: parameter.name,
      line: { color: served, width: 2 }, marker: { size: 5, color: served },
      customdata: items.map((item, n) => [sd[n] === null ? null : Z90 * sd[n], item.state, item.tracks]),
      hovertemplate:
        `%{x|%d %b %H:%M}<br><b>%{y:.${parameter.digits}f}${parameter.unit}</b>` +
        ` ±%{customdata[0]:.${parameter.digits}f}${parameter.unit}<br>%{customdata[1]}, %{customdata[2]} people` +
        "<extra></extra>",
    },
  ];
}

/** Closed outlines of the band, one for each run without a gap. */
function band(x, low, high) {
  const runs = [];
  for (let n = 0; n < x.length; n++) {
    if (low[n] === null) continue;
    if (!n || low[n - 1] === null) runs.push([]);
    runs.at(-1).push(n);
  }
  return runs.map((run) => {
    const back = run.toReversed();
    return [
      [...run, ...back].map((n) => x[n]),
      [...run.map((n) => high[n]), ...back.map((n) => low[n])],
    ];
  });
}

/** The prior pose as steps over the time that is drawn; the first was there before. */
function priorSteps(priors, parameter, x) {
  const [first, last] = [x[0], x.at(-1)];
  const steps = priors.map((prior, n) => [n ? local(prior.at) : first, priorOf(prior, parameter)]);
  const inside = steps.filter(([at], n) => n === 0 || at <= last);
  const past = inside.filter(([at]) => at <= first);
  const shown = [[first, past.at(-1)[1]], ...inside.filter(([at]) => at > first)];
  shown.push([last, shown.at(-1)[1]]);
  return { x: shown.map(([at]) => at), y: shown.map(([, value]) => value) };
}

function marks(alerts, x) {
  const [first, last] = [x[0], x.at(-1)];
  const seen = alerts.map((alert) => ({ ...alert, at: local(alert.at) }));
  const inside = seen.filter(({ at }) => at >= first && at <= last);
  const shapes = inside.map(({ at }) => ({
    type: "line", xref: "x", yref: "paper", x0: at, x1: at, y0: 0, y1: 1,
    line: { color: colour("--drifting"), dash: "dot", width: 1.5 },
  }));
  const trace = {
    x: inside.map(({ at }) => at), y: inside.map(() => 1), yaxis: "y5", xaxis: "x",
    mode: "markers", marker: { symbol: "triangle-down", size: 11, color: colour("--drifting") },
    text: inside.map(({ words, firing }) => words + (firing ? ", open" : ", ended")),
    hovertemplate: "%{x|%d %b %H:%M}<br>%{text}<extra></extra>", showlegend: false, cliponaxis: false,
  };
  return { shapes, trace };
}

function layout(shapes) {
  const ink = colour("--ink");
  const line = colour("--line");
  const rows = {};
  PARAMETERS.forEach((parameter, at) => {
    const top = 0.97 - at * 0.245;
    rows[at ? `yaxis${at + 1}` : "yaxis"] = {
      domain: [top - 0.205, top], title: { text: `${parameter.name}${parameter.unit === "°" ? " °" : " m"}`, font: { size: 12 } },
      gridcolor: line, zeroline: false, automargin: true, nticks: 5, ticklen: 0, anchor: "x",
    };
  });
  return {
    ...rows,
    yaxis5: { domain: [0.98, 1], visible: false, fixedrange: true, range: [0, 1] },
    xaxis: {
      anchor: "y4", type: "date", gridcolor: line, showspikes: true, spikemode: "across",
      spikethickness: 1, spikecolor: ink, spikedash: "solid", spikesnap: "cursor",
    },
    shapes, showlegend: false, hovermode: "x", margin: { l: 56, r: 12, t: 6, b: 30 }, height: 560,
    // A finger that scrolls the page must not be caught by a chart.
    dragmode: matchMedia("(pointer: coarse)").matches ? false : "zoom",
    paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)",
    font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: ink },
    hoverlabel: { bgcolor: colour("--raised"), bordercolor: line, font: { color: ink } },
    uirevision: String(days),
  };
}

async function draw({ anew = false } = {}) {
  const items = await history();
  const { alerts, priors } = facts();
  const now = JSON.stringify([days, items.length, items.at(-1), alerts, priors]);
  if (now === drawn && !anew) return;
  drawn = now;
  document.getElementById("charts-empty").hidden = items.length > 0;
  tabulate(items);
  if (!items.length) return window.Plotly.purge(place);
  const x = items.map((item) => local(item.to));
  const { shapes, trace } = marks(alerts, x);
  const all = PARAMETERS.flatMap((parameter, at) => traces(items, parameter, at, priors));
  await window.Plotly.react(place, [...all, trace], layout(shapes), {
    responsive: true, displaylogo: false, displayModeBar: false, scrollZoom: false,
  });
  place.dataset.points = items.length;
}

/** The newest values, for who cannot see the charts. */
function tabulate(items) {
  const table = document.createElement("table");
  const head = table.createTHead().insertRow();
  for (const words of ["Time", ...PARAMETERS.map(({ name }) => name), "People", "State"]) {
    const cell = document.createElement("th");
    cell.scope = "col";
    cell.textContent = words;
    head.append(cell);
  }
  const body = table.createTBody();
  for (const item of items.slice(-20).reverse()) {
    const row = body.insertRow();
    const values = PARAMETERS.map(({ field, unit, digits }) => {
      const sd = item.sd?.[field] ?? null;
      if (sd === null) return "not told";
      return `${item[field].toFixed(digits)}${unit} ±${(Z90 * sd).toFixed(digits)}`;
    });
    for (const text of [local(item.to), ...values, item.tracks, item.state]) {
      row.insertCell().textContent = text;
    }
  }
  document.getElementById("charts-values").replaceChildren(table);
}

const redraw = (how) => draw(how).catch((error) => console.warn(error));

for (const button of document.querySelectorAll("[data-days]")) {
  button.addEventListener("click", () => {
    days = Number(button.dataset.days);
    for (const each of document.querySelectorAll("[data-days]")) {
      each.setAttribute("aria-pressed", String(each === button));
    }
    redraw();
  });
}
document.addEventListener("camera-news", () => redraw());
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraw({ anew: true }));
redraw();
