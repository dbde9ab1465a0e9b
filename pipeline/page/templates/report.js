const report = JSON.parse(document.getElementById("report-data").textContent);
const options = { actions: false, renderer: "svg", mode: "vega-lite", ast: true,
  config: report.theme };

// alternative text: the chart's own title, and what its figure says
const draw = (element, name) => {
  const { text, subtitle } = report.charts[name].title ?? {};
  const caption = element.closest("figure").querySelector("figcaption").textContent.trim();
  const description = [text, subtitle, caption].flat().filter(Boolean).join(". ");
  return vegaEmbed(element, { description, ...report.charts[name] }, options);
};

// a folded chart has no width: it is drawn when it is shown
const drawn = new Set();
const drawShown = () => {
  for (const element of document.querySelectorAll("[data-chart]")) {
    if (drawn.has(element) || element.closest("details:not([open])")) continue;
    drawn.add(element);
    draw(element, element.dataset.chart);
  }
};
const sections = [...document.querySelectorAll("details.section")];
const unfold = (chosen) => { for (const section of chosen) section.open = true; drawShown(); };
const unfoldTarget = () => unfold(sections.filter((s) => `#${s.parentElement.id}` === location.hash));

document.addEventListener("toggle", drawShown, true);
addEventListener("hashchange", unfoldTarget);
addEventListener("beforeprint", () => unfold(sections));
unfoldTarget();

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
  if ("unfold" in target.dataset) unfold(sections);
  if (target.hash === location.hash) unfoldTarget();
  if (target.dataset.step) step(Number(target.dataset.step));
  if (target === dialog || "close" in target.dataset) dialog.close();
});
