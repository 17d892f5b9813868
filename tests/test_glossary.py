"""docs/glossary.md: every word once, in order, in a few lines."""

import re

from protocol.phases import COMMAND_NAMES
from tests.test_readme import README, ROOT

TEXT = (ROOT / "docs" / "glossary.md").read_text()
ENTRIES = re.findall(r"^- \*\*(.+?)\*\*: ((?:.+\n)(?:  .+\n)*)", TEXT, re.MULTILINE)
WORDS = [word for word, _ in ENTRIES]


def test_words_are_in_order_and_stand_once():
    assert sorted(set(WORDS), key=str.lower) == WORDS
    assert len(WORDS) == TEXT.count("\n- **")
    assert set(COMMAND_NAMES) <= set(WORDS)


def test_an_entry_is_short():
    assert [word for word, text in ENTRIES if text.count("\n") > 3] == []


def test_a_word_in_italics_has_an_entry():
    for word, text in ENTRIES:
        for other in re.findall(r"(?<!\*)\*([^*]+?)\*(?!\*)", text):
            assert {other, other.rstrip("s")} & set(WORDS), f"{word}: {other}"


def test_the_readme_and_the_map_of_the_code_lead_to_it():
    assert "docs/glossary.md" in README
    assert "(glossary.md)" in (ROOT / "docs" / "architecture.md").read_text()
