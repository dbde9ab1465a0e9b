"""What readers and citation tools learn of the project agrees with the package."""

import re
import tomllib
from pathlib import Path

import yaml

import inscal

REPOSITORY = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((REPOSITORY / "pyproject.toml").read_text())["project"]
VERSION = inscal.__version__


def test_citation_has_what_its_format_requires_and_the_packages_version():
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text())
    assert {"cff-version", "message", "title", "authors"} <= set(citation)
    assert citation["cff-version"] == "1.2.0"
    assert citation["type"] == "software"
    assert citation["version"] == VERSION
    assert citation["license"] == PROJECT["license"]
    assert citation["authors"] == [{"name": "The inscal developers"}]


def test_changelog_names_the_packages_version():
    text = (REPOSITORY / "CHANGELOG.md").read_text()
    assert text.startswith("# Changelog\n")
    assert re.search(r"^## \[Unreleased\]$", text, re.MULTILINE)
    assert VERSION in text


def test_files_that_contributors_are_sent_to_exist():
    text = (REPOSITORY / "CONTRIBUTING.md").read_text()
    assert len(text.splitlines()) <= 60
    named = re.findall(r"`((?:\.ci|conf|inscal|pipeline|results|tests)/[\w./]*)`", text)
    assert len(named) > 8
    for name in named:
        assert (REPOSITORY / name).exists(), name
