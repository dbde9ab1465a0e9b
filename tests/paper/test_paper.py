import pytest

from pipeline.console.errors import DataError
from pipeline.paper import claims as paper

PAGE = """# What is claimed

Words.

| claim | found | verdict |
| --- | --- | --- |
| a | 1 | **met** |

| another | table |
| --- | --- |
"""


def test_page_holds_every_claim_and_no_other_table():
    other = PAGE.replace("**met**", "**not met**")
    text = paper.page_of_claims({"accuracy": PAGE, "effects": other})
    assert "## What is claimed" in text
    assert text.count("| a | 1 | **met** |") == 1
    assert text.count("| a | 1 | **not met** |") == 1
    assert "another" not in text
    assert "[effects.md](effects.md)" in text


def test_missing_page_is_named(tmp_path):
    for name in paper.PAGES[1:]:
        (tmp_path / f"{name}.md").write_text(PAGE)
    with pytest.raises(DataError, match=r"observability\.md: not found"):
        paper.read_pages(tmp_path)
    (tmp_path / "observability.md").write_text(PAGE)
    assert list(paper.read_pages(tmp_path)) == list(paper.PAGES)
