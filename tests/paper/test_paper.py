import pytest

from pipeline.console.errors import DataError
from pipeline.paper import claims as paper
from pipeline.study.verdict import MET, NOT_MET, Verdict


def page(word, **more):
    return paper.page_of("What is claimed", [Verdict("a", "1", word)], **more)


def test_page_holds_every_claim():
    pages = {"accuracy": page(MET), "effects": page(NOT_MET), "path": page(MET, bold=(NOT_MET,))}
    text = paper.page_of_claims(pages)
    assert text.count("## What is claimed") == 3
    assert text.count("| claim | found | verdict |\n| --- | --- | --- |\n") == 3
    for row in ("| a | 1 | **met** |", "| a | 1 | **not met** |", "| a | 1 | met |"):
        assert text.count(row) == 1
    assert "[effects.md](effects.md)" in text


def test_missing_page_is_named(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in paper.PAGES[1:]:
        paper.write(name, page(MET))
    with pytest.raises(DataError, match=r"observability\.json: not found"):
        paper.read_pages()
    paper.write("observability", page(NOT_MET))
    found = paper.read_pages()
    assert list(found) == list(paper.PAGES)
    assert found["observability"].table == page(NOT_MET).table
    paper.path_of("observability").write_text("{}")
    with pytest.raises(DataError, match="cannot be read"):
        paper.read_pages()
