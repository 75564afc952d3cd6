"""Pages are plain: short sentences, no turns that stop a reader, words of the glossary linked where they mean that."""

import re

import pytest

from docs import glossary_links, plain_words
from tests.docs.test_pages import PAGES

MOST_IN_PROGRAM = 3  # long sentences and banned turns in messages: may fall, not rise
MOST_IN_DOCSTRINGS = 200  # long sentences among 19 000: may fall, not rise
MOST_WORDS_OF_PAGES = 30_000
MOST_WORDS_OF_CHANGELOG = 700


@pytest.mark.parametrize("page", plain_words.pages(), ids=lambda p: p.name)
def test_a_page_is_plain(page):
    assert [str(fault) for fault in plain_words.page_faults(page)] == []


@pytest.mark.slow
def test_messages_become_plainer():
    faults = [str(f) for module in plain_words.modules() for f in plain_words.program_faults(module)]
    faults += [str(f) for template in plain_words.templates() for f in plain_words.template_faults(template)]
    assert len(faults) <= MOST_IN_PROGRAM, "\n".join(faults)


@pytest.mark.slow
def test_docstrings_become_plainer():
    every = (s for module in plain_words.modules() for s in plain_words.docstring_sentences(module))
    long = [s for s in every if plain_words.count_words(s) > plain_words.MOST_WORDS]
    assert len(long) <= MOST_IN_DOCSTRINGS, "\n".join(long)


def test_the_pages_are_no_longer_than_they_need_be():
    written = [p for p in plain_words.pages() if p.is_relative_to(plain_words.ROOT / "docs")]
    assert sum(len(p.read_text().split()) for p in written) <= MOST_WORDS_OF_PAGES
    assert len((plain_words.ROOT / "CHANGELOG.md").read_text().split()) <= MOST_WORDS_OF_CHANGELOG


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("One idea a sentence.", []),
        (f"{'word ' * 26}.", ["26 words"]),
        (f"{'word ' * 13}: {'word ' * 13}.", []),  # a colon ends a sentence
        (f"| {'word ' * 20}| {'word ' * 20}|", []),  # a cell of a table by itself
        (f"```text\n{'word ' * 40}\n```", []),
        (f"[{'word ' * 26}](page.md)", ["26 words"]),
        ("What is told of it is gone.", ["'what is told'", "'is told of'", "'gone'"]),
        ("Somebody has foregone it.", []),
    ],
)
def test_what_is_not_plain_is_found(text, found):
    assert [f.what for f in plain_words.find_faults("page", plain_words.page_sentences(text))] == found


def test_texts_of_a_module_are_its_messages(tmp_path):
    (tmp_path / "one.py").write_text(
        '"""A docstring of the module, which nobody sees."""\nx = 1\nsay(f"{x} poses are left out here")\n'
    )
    assert [text for _, text in plain_words.program_texts(tmp_path / "one.py")] == ["X poses are left out here"]


@pytest.mark.parametrize(
    "text", ["It closes that gap.", "Screw it to the flange.", "Aim at it.", "a prior start", "the role of the proxy"]
)
def test_words_of_every_day_lead_nowhere(text):
    assert glossary_links.link_terms(text, "g.md") == text


def test_a_word_that_is_linked_is_a_term_and_not_a_word_of_every_day():
    """Who adds a word to the glossary decides whether it is one of every day."""
    unlinked = set(glossary_links.NOT_LINKED)
    assert unlinked <= set(glossary_links.terms()), "a word that is not linked is not in the glossary any more"
    linked = {
        word
        for text in PAGES.values()
        for word, _ in re.findall(r"\[([^\]]+)\]\(g\.md#([^)]+)\)", glossary_links.link_terms(text, "g.md"))
    }
    assert not linked & unlinked
    assert {"mastering", "dialect", "observability"} <= linked
