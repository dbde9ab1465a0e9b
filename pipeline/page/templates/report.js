const report = JSON.parse(document.getElementById("report-data").textContent);
const options = { actions: false, renderer: "svg", mode: "vega-lite", ast: true,
  config: report.theme };

const draw = (element, name) => vegaEmbed(element, {
  description: element.closest("figure").querySelector("figcaption").textContent.trim(),
  ...report.charts[name] }, options);

for (const element of document.querySelectorAll("[data-chart]")) {
  draw(element, element.dataset.chart);
}

const dialog = document.getElementById("panel");
const names = Object.keys(report.panels);
let shown;

const open = (name) => {
  const panel = report.panels[shown = name];
  dialog.querySelector("h2").textContent = panel.title;
  if (!dialog.open) dialog.showModal();
  dialog.scrollTop = 0;
  dialog.querySelectorAll("figure").forEach((figure, number) => {
    figure.querySelector("figcaption").textContent = panel.sentences[number];
    const charts = figure.querySelector(".charts");
    charts.replaceChildren(...panel.charts[number].map(() => document.createElement("div")));
    panel.charts[number].forEach((chart, place) => {
      charts.children[place].className = "chart";
      draw(charts.children[place], chart);
    });
  });
};
const step = (by) => open(names[(names.indexOf(shown) + by + names.length) % names.length]);

document.addEventListener("click", ({ target }) => {
  if (target.dataset.parameter) open(target.dataset.parameter);
  if (target.dataset.step) step(Number(target.dataset.step));
  if (target === dialog || "close" in target.dataset) dialog.close();
});
