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
  // Named one by one: some of plotly's own buttons would send the data elsewhere.
  const buttons = [["toImage", "zoom2d", "pan2d", "resetScale2d"]];
  const config = {responsive: true, displaylogo: false, displayModeBar: "hover", modeBarButtons: buttons};
  for (const [key, figure] of Object.entries(figures)) {
    await Plotly.newPlot(key, figure.data, {...common, ...figure.layout}, config);
  }
  for (const button of document.querySelectorAll("button[data-figure]")) {
    button.addEventListener("click", () => {
      const range = JSON.parse(button.dataset.range);
      Plotly.relayout(button.dataset.figure, range ? {"xaxis.range": range} : {"xaxis.autorange": true});
    });
  }
  const fit = () => Object.keys(figures).forEach((key) => Plotly.Plots.resize(key));
  window.addEventListener("beforeprint", fit);
  window.addEventListener("afterprint", fit);
  document.documentElement.dataset.drawn = String(Object.keys(figures).length);
})();
