"""Section `provenance` of the HTML page: what the numbers were made with, when and where."""

from collections.abc import Mapping, Sequence
from typing import Any

import yaml

from pipeline.campaign import provenance
from pipeline.campaign.provenance import NOT_RECORDED
from pipeline.config.load import RUN_GROUPS, differences
from pipeline.page.parts import Section, Table, cells, say
from pipeline.study.campaign import Campaign

_SHOWN = (*RUN_GROUPS, "campaign", "bounds")


def section(campaigns: Sequence[Campaign], *, when: bool) -> Section:
    """Make the section.

    Parameters
    ----------
    campaigns : sequence of Campaign
        The main one first.
    when : bool
        Whether it says when, where and how fast runs were made; a page without is the same, to the
        last byte, whoever makes it.

    Returns
    -------
    Section
    """
    main, *others = campaigns
    made = {one.name: provenance.sessions(one.path) for one in campaigns} if when else {}
    unknown = [name for name, sessions in made.items() if not sessions]
    settings = _settings(main)
    texts = {
        f"Full configuration of {main.name}": yaml.safe_dump(
            settings, sort_keys=False, default_flow_style=None
        )
    }
    for campaign in others:
        lines = differences(settings, _settings(campaign))
        title = f"How {campaign.name} differs from {main.name}"
        texts[title] = "\n".join(lines) if lines else "in nothing"
    software = main.runs.attrs["software"]
    return Section(
        "provenance",
        lines=[say("not_recorded", word=NOT_RECORDED, campaigns=unknown)] if unknown else [],
        tables=[
            _campaigns(campaigns),
            *([_sessions(campaigns)] if when and len(unknown) < len(campaigns) else []),
            _software(software),
        ],
        preformatted=texts,
    )


def _settings(campaign: Campaign) -> dict[str, Any]:
    return {key: value for key, value in campaign.configuration.items() if key in _SHOWN}


def _campaigns(campaigns: Sequence[Campaign]) -> Table:
    rows = []
    for campaign in campaigns:
        summary, attributes = campaign.summary, campaign.runs.attrs
        texts = (
            f"`{campaign.name}`",
            campaign.configuration["schedule"]["name"],
            campaign.configuration["noise"]["name"],
            f"{summary['runs_done']} of {campaign.asked}",
            summary["runs_failed"],
            attributes["seed"],
            f"`{attributes['fingerprint'][:12]}`",
        )
        rows.append(cells(texts))
    headings = ("campaign", "schedule", "noise", "runs done", "failed", "seed")
    caption = "Campaigns; the fingerprint is that of configuration and code"
    return Table(caption, (*headings, "fingerprint"), rows, 3)


def _sessions(campaigns: Sequence[Campaign]) -> Table:
    rows = []
    for campaign in campaigns:
        made = provenance.sessions(campaign.path)
        rows += [cells((f"`{campaign.name}`", *_session(entry))) for entry in made]
    headings = ("campaign", "date (UTC)", "commit", "machine", "runs", "time", "workers")
    return Table("Where their runs were made, session by session", headings, rows, 4)


def _session(entry: Mapping[str, Any]) -> tuple[str, ...]:
    changed = {True: ", with changes", False: "", None: ""}[entry.get("changed")]
    commit, workers = entry["commit"], entry["workers"] or "any number"
    short = commit if commit == NOT_RECORDED else f"`{commit[:12]}`"
    return (
        entry["date"].removesuffix("+00:00").replace("T", " "),
        f"{short}{changed}",
        f"{entry['cores']} cores, {entry['processor']}",
        str(entry["runs"]),
        f"{entry['seconds']:.1f} s",
        f"{workers} ({entry['cluster']})",
    )


def _software(versions: Mapping[str, str]) -> Table:
    caption = "Versions that the main campaign was made with"
    return Table(caption, list(versions), [cells(list(versions.values()))], len(versions))
