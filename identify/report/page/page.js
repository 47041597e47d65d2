"use strict";
(async () => {
  const figures = JSON.parse(document.getElementById("figures").textContent);
  const common = {
    autosize: true,
    margin: {l: 64, r: 12, t: 40, b: 46},
    paper_bgcolor: "rgba(0,0,0,0)",
    plot_bgcolor: "rgba(0,0,0,0)",
    font: {family: "system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif", size: 12, color: "#6b7686"},
    hovermode: "closest",
    hoverlabel: {bgcolor: "#ffffff", font: {color: "#1d2430"}},
    legend: {orientation: "h", x: 0, xanchor: "left", y: 1, yref: "container", yanchor: "top", bgcolor: "rgba(0,0,0,0)"},
    modebar: {bgcolor: "rgba(0,0,0,0)", color: "#8a919b", activecolor: "#2b7bba"},
  };
  const NARROW = 620, GAP = 84, LEGEND_ROW = 22; // px: below NARROW panels stand one above the other
  // Named one by one: some of plotly's own buttons would send the data elsewhere.
  const buttons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
  const settings = (narrow) => (
    {responsive: true, displaylogo: false, displayModeBar: narrow ? false : "hover", modeBarButtons: buttons}
  );

  const entries = (data) => new Set(data.filter((t) => t.showlegend !== false && t.name).map((t) => t.name)).size;

  // The same layout with one panel a row, for a window in which side by side they would overlap.
  const stacked = (layout, data) => {
    const panels = Object.keys(layout).filter((key) => /^xaxis\d*$/.test(key))
      .map((key) => ({x: layout[key], y: layout[layout[key].anchor.replace("y", "yaxis")]}))
      .sort((a, b) => b.y.domain[0] - a.y.domain[0] || a.x.domain[0] - b.x.domain[0]);
    const columns = new Set(panels.map((panel) => panel.x.domain[0])).size;
    const legend = LEGEND_ROW * entries(data);
    const top = 18 + (layout.showlegend === false ? 0 : legend);
    const rows = panels.length / columns;
    const plot = Math.max(130, (layout.height - 90 - GAP * (rows - 1) / 2) / rows);
    const gap = columns > 1 ? GAP : GAP / 2;
    const inner = panels.length * plot + (panels.length - 1) * gap;
    const moved = {...layout, height: inner + top + 60, margin: {...common.margin, l: 52, t: top}};
    const notes = (layout.annotations || []).map((note) => ({...note}));
    panels.forEach((panel, row) => {
      const high = 1 - row * (plot + gap) / inner, [x0, y1] = [panel.x.domain[0], panel.y.domain[1]];
      for (const note of notes) {
        if (note.xref === "paper" && !note.moved && note.x === x0 && note.y === y1) {
          Object.assign(note, {x: 0, y: high, moved: true, font: {size: 11}});
        }
      }
      const of = (axis) => Object.keys(layout).find((key) => layout[key] === axis);
      moved[of(panel.x)] = {...panel.x, domain: [0, 1], tickangle: 0, nticks: 5};
      moved[of(panel.y)] = {...panel.y, domain: [Math.max(0, high - plot / inner), high]};
      if (panel.y.ticktext) moved[of(panel.y)].showticklabels = true;
      if (columns > 1 && panel.x.title) moved[of(panel.x)].showticklabels = true;
    });
    moved.annotations = notes.map(({moved: _, ...note}) => note);
    moved.legend = {...common.legend, orientation: "v"};
    return moved;
  };

  const draw = async (key) => {
    const figure = figures[key], place = document.getElementById(key);
    const narrow = window.innerWidth < NARROW;
    const layout = narrow ? stacked(figure.layout, figure.data) : figure.layout;
    place.style.height = `${layout.height}px`;
    await Plotly.react(key, figure.data, {...common, ...layout}, settings(narrow));
    figure.narrow = narrow;
  };
  for (const key of Object.keys(figures)) await draw(key);
  for (const button of document.querySelectorAll("button[data-figure]")) {
    button.addEventListener("click", () => {
      const range = JSON.parse(button.dataset.range);
      Plotly.relayout(button.dataset.figure, range ? {"xaxis.range": range} : {"xaxis.autorange": true});
    });
  }
  const fit = () => {
    for (const key of Object.keys(figures)) {
      if (document.getElementById(key).offsetWidth === 0) continue; // folded away
      if (figures[key].narrow !== window.innerWidth < NARROW) draw(key); else Plotly.Plots.resize(key);
    }
  };
  for (const fold of document.querySelectorAll("details")) fold.addEventListener("toggle", fit);
  let folded = [];
  window.addEventListener("resize", fit);
  window.addEventListener("beforeprint", () => {
    folded = [...document.querySelectorAll("details:not([open])")];
    for (const fold of folded) fold.open = true;
    fit();
  });
  window.addEventListener("afterprint", () => {
    for (const fold of folded) fold.open = false;
    fit();
  });
  document.documentElement.dataset.drawn = String(Object.keys(figures).length);
})();
