"""The HTML page: one file with everything in it, for the study or for any campaigns.

Sections come from the ``page_*`` modules, the look from ``templates``. The scripts in the page are
Vega-Lite for the charts and DataTables for the table, as their packages ship them; nothing is
loaded from anywhere.
"""

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import jinja2
import vl_convert
from markupsafe import Markup, escape

from pipeline.config.load import run_settings
from pipeline.config.schema import Config
from pipeline.console.errors import DataError
from pipeline.gate import history
from pipeline.gate.judge import BASELINE
from pipeline.page import campaign as page_campaign
from pipeline.page import data as page_data
from pipeline.page import origin as page_origin
from pipeline.page import study as page_study
from pipeline.page import verdict as page_verdict
from pipeline.page.charts import THEME
from pipeline.page.parts import TEMPLATES, Section, say
from pipeline.study import assumptions, claims, findings, names
from pipeline.study.campaign import Campaign, comparison
from pipeline.study.claims import Claims
from pipeline.study.findings import Contest, Summary
from pipeline.study.headline import headline

_STUDY_TITLE = "19 positions against 25"


@dataclass(frozen=True)
class Page:
    """All that the template shows.

    Attributes
    ----------
    title, headline : str
    verdict : str
        Of the bounds of the main campaign, in two words or three.
    notes : list of str
        What a reader must know before anything else, such as runs that are missing.
    sections : list of Section
    charts : dict of str to specification
        Those of the sections and of the panels, by id.
    panels : dict of str to dict
        Of `pipeline.page.campaign.panels`.
    """

    title: str
    verdict: str
    headline: str
    notes: list[str]
    sections: list[Section]
    charts: dict[str, Any]
    panels: dict[str, Any]


def study(config: Config) -> Page:
    """Compose the page of the study.

    Parameters
    ----------
    config : Config
        Gives the bounds.

    Returns
    -------
    Page

    Raises
    ------
    DataError
        If a result is missing.
    """
    every = page_data.read_campaigns(config, [names.RUNS / n for n in names.CAMPAIGNS])
    by_name = {campaign.name: campaign for campaign in every}
    main, one_pass = by_name[names.MAIN], by_name[names.ONE_PASS]
    levels = [main, *(by_name[name] for name in names.MAIN_LEVELS if name != names.MAIN)]
    comparisons = [
        (title, findings.read_comparison(name)) for name, title in names.COMPARISONS.items()
    ]
    wing = claims.read()
    return _page(
        "Calibration by Monte Carlo",
        [main, *(campaign for campaign in every if campaign is not main)],
        side_by_side=[main, one_pass],
        schedules=page_campaign.contest_section(comparisons, _STUDY_TITLE),
        noise=page_study.noise(levels, wing),
        paper_section=page_study.paper_section(wing)
        if wing
        else Section("paper", left_out=say("no_wing", path=claims.PATH)),
        wing=wing,
        when=False,
        better=findings.contest(findings.read_comparison(names.BETTER)),
        assumed=page_study.assumptions_section(assumptions.read()),
    )


def campaigns(config: Config, paths: Sequence[str]) -> Page:
    """Compose the page of any campaigns.

    Parameters
    ----------
    config : Config
        Gives the bounds.
    paths : sequence of str
        Campaign stores, the main one first.

    Returns
    -------
    Page

    Raises
    ------
    DataError
        If a store is missing or has fewer than two runs done.
    """
    every = page_data.read_campaigns(config, paths)
    compared, reasons = _against_first(every)
    return _page(
        " · ".join(campaign.name for campaign in every),
        every,
        side_by_side=every,
        schedules=page_campaign.contest_section(compared, left_out=" ".join(reasons)),
        noise=page_study.noise(every if _differ_in_noise(every) else [], None),
        paper_section=Section("paper", left_out=say("chosen_alone")),
        wing=claims.read(),
        when=True,
        better=findings.contest(compared[0][1]) if compared else None,
    )


def _page(
    title: str,
    every: list[Campaign],
    *,
    side_by_side: list[Campaign],
    schedules: Section,
    noise: Section,
    paper_section: Section,
    wing: Claims | None,
    when: bool,
    better: Contest | None,
    assumed: Section | None = None,
) -> Page:
    main = every[0]
    made_with, reason = page_data.config_or_reason(main)
    course = page_data.course_of(main, made_with) if made_with else None
    if made_with and course:
        from_config = [
            page_campaign.convergence(main, course),
            page_campaign.observability(made_with, wing),
            page_study.accuracy_history(history.read(BASELINE), main, made_with),
        ]
    else:
        names = ("convergence", "observability", "history")
        from_config = [Section(name, left_out=f"Left out: {reason}.") for name in names]
    convergence, observability, over_time = from_config
    sections = [
        page_verdict.section(main),
        *([assumed] if assumed else []),
        page_campaign.distributions(main),
        page_campaign.sigmas(side_by_side),
        page_campaign.nees(side_by_side),
        schedules,
        convergence,
        observability,
        noise,
        paper_section,
        over_time,
        page_origin.section(every, when=when),
    ]
    charts, panels = page_campaign.panels(main, course)
    for section in sections:
        for picture in section.pictures:
            charts |= picture.charts
    notes = [note for note in map(page_data.unfinished, every) if note]
    word = f"bounds {findings.bounds_word(main.summary)}"
    told = headline(main.summary, better)
    return Page(title, word, told, notes, sections, charts, panels)


def _against_first(every: Sequence[Campaign]) -> tuple[list[tuple[str, Summary]], list[str]]:
    """Compare further campaigns with the first; why some are no pairs."""
    first, *others = every
    comparisons, reasons = [], []
    for campaign in others:
        try:
            found = comparison(campaign, first)
        except DataError as error:
            reasons.append(f"Left out: {error}.")
        else:
            comparisons.append((f"{campaign.name} against {first.name}", found))
    if not others:
        reasons.append(say("no_second"))
    return comparisons, reasons


def _differ_in_noise(every: Sequence[Campaign]) -> bool:
    settings = [run_settings(campaign.configuration) for campaign in every]
    levels = {str(setting.pop("noise")) for setting in settings}
    same = all(setting == settings[0] for setting in settings)
    return same and len(levels) == len(every) > 1


def html(page: Page) -> str:
    """Write a page as one HTML file, the same bytes for the same page.

    Parameters
    ----------
    page : Page

    Returns
    -------
    str
    """
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["code"] = _code
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}  # and nothing sorted
    tables = resources.files("itables") / "html"
    return environment.get_template("report.html.jinja").render(
        page=page,
        theme=THEME,
        vega=Markup(
            vl_convert.javascript_bundle("window.vegaEmbed = vegaEmbed;").replace(
                "</script", "<\\/script"
            )
        ),
        # a module: it can only be imported, here from an address that holds it
        datatables=base64.b64encode((tables / "dt_bundle.js").read_bytes()).decode(),
        datatables_style=Markup((tables / "dt_bundle.css").read_text(encoding="utf-8")),
    )


def _code(text: str) -> Markup:
    """Text with what stands between backticks set as code."""
    return Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", str(escape(text))))


def output_path(config: Config) -> Path:
    """File that the page of campaigns goes to: `out`, or one beside the first store."""
    assert config.campaigns
    first = Path(config.campaigns[0])
    return Path(config.out) if config.out else first.with_name(f"{first.name}.html")
