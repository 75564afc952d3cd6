"""Every command of the pages can be typed, every link leads somewhere, every word has one sentence."""

import importlib.util
import re
import shlex
import tomllib
from functools import cache
from pathlib import Path

import pytest

import planner
from docs import options_tables
from planner.cell.reading import load_cell, shipped_cells
from planner.cli.app import load_command, verbs
from planner.effects.catalogue import effect_kinds
from tests.command import edbb

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
_PAGES = (ROOT / "README.md", *sorted(DOCS.rglob("*.md")))
PAGES = {p.relative_to(ROOT).as_posix(): p.read_text(encoding="utf-8") for p in _PAGES}
TYPED = re.compile(r"^\$ (?:\w+=(?:\$\([^)]*\)|\S+) )*edbb (.+)$", re.MULTILINE)
ON_A_SERVER = ("--server", "http://planner:8017")
LINK = re.compile(r"\[(?:[^\[\]]|\[[^\]]*\])*\]\(([^)\s]+)\)")
GLOSSARY_ROW = re.compile(r'^\| <a id="([^"]+)"></a>([^|]+?) \| ([^|]+?) \|$', re.MULTILINE)


def commands(text):
    """The words behind ``edbb`` of every command that is typed in a text."""
    for line in TYPED.findall(text):
        words = shlex.split(line.split(" && ")[0].replace("…", ""), comments=True)
        yield words[2:] if words[:1] == ["--server"] else words


TYPED_WORDS = [pytest.param(w, id=f"{page}: {' '.join(w)}") for page, t in PAGES.items() for w in commands(t)]


@cache
def command(verb):
    return load_command(verb)


@pytest.mark.parametrize("words", TYPED_WORDS)
def test_every_command_of_the_pages_can_be_typed(words):
    verb, *rest = words
    assert verb in verbs()
    command(verb).make_context(verb, list(rest))


def test_an_option_that_is_not_there_would_be_seen():
    with pytest.raises(Exception, match="--candles"):
        command("plan").make_context("plan", ["CELL", "-o", "DIR", "--candles", "3"])


@pytest.mark.parametrize("verb", verbs())
def test_every_command_has_a_page_with_an_example_and_its_options(verb):
    text = PAGES[f"docs/commands/{verb}.md"]
    assert text.startswith(f"# edbb {verb}\n")
    assert any(words[0] == verb for words in commands(text))
    assert f"<!-- options: {verb} -->" in text
    assert f"(commands/{verb}.md)" in PAGES["docs/commands.md"]


@pytest.mark.parametrize("page", [p for p, text in PAGES.items() if re.search(r"^<!-- /\w+ -->$", text, re.MULTILINE)])
def test_what_is_made_stands_in_the_page_itself(page):
    """Who reads it on a forge sees no site: renew it by ``python -m docs.options_tables``."""
    assert options_tables.page_in_place(PAGES[page]) == PAGES[page]
    assert "<!--" not in options_tables.on_page_markdown(PAGES[page])


def test_every_cause_stands_on_the_page_of_causes_and_an_option_on_that_of_its_command():
    assert all(re.search(rf"[|,] {kind}[ ,]", PAGES["docs/effects.md"]) for kind in effect_kinds())
    assert "| `--tolerance-mm` |" in PAGES["docs/commands/identify.md"]
    assert all(f"\n## {cell}\n" in PAGES["docs/gallery.md"] for cell in shipped_cells())


def test_the_cells_that_the_pages_name_are_shipped():
    named = {
        w for text in PAGES.values() for words in commands(text) for w in words if re.fullmatch(r"[\w-]+/[\w-]+", w)
    }
    cells = {w for w in named if w.split("/")[0] in {c.split("/")[0] for c in shipped_cells()}}
    assert cells
    assert cells <= set(shipped_cells())


@pytest.mark.parametrize("page", PAGES)
def test_every_link_and_picture_is_there(page):
    text = re.sub(r"^```.*?^```|`[^`\n]*`", "", PAGES[page], flags=re.MULTILINE | re.DOTALL)
    for target in LINK.findall(text):
        path, _, anchor = target.partition("#")
        if re.match(r"[a-z]+:", path):
            continue
        there = (ROOT / page).parent / path if path else ROOT / page
        assert there.exists(), target
        if anchor and there.suffix == ".md":
            assert anchor in anchors(there.resolve().relative_to(ROOT).as_posix()), target


@cache
def anchors(page):
    """Headings as they are linked, and anchors that are written."""
    heads = re.findall(r"^#+ (.+)$", PAGES[page], re.MULTILINE)
    slugs = {re.sub(r"[\s]+", "-", re.sub(r"[^\w\s-]", "", h.lower()).strip()) for h in heads}
    return slugs | {s.replace("--", "-") for s in slugs} | set(re.findall(r'<a id="([^"]+)"', PAGES[page]))


def test_every_page_is_in_the_contents():
    contents = set(re.findall(r"([\w/-]+\.md)\s*$", (ROOT / "mkdocs.yml").read_text(), re.MULTILINE))
    assert contents == {p.removeprefix("docs/") for p in PAGES if p.startswith("docs/")}


def test_the_readme_is_read_in_a_minute():
    lines = PAGES["README.md"].splitlines()
    assert len(lines) <= 60
    assert PAGES["README.md"].count("```sh\n") == 2  # install and test, which .ci/run runs
    assert len(LINK.findall(PAGES["README.md"].split("## Three doors")[1].split("## A real robot")[0])) >= 3


def test_the_version_is_the_same_wherever_it_stands():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (heading,) = re.findall(r"^## (\d+\.\d+\.\d+)", (ROOT / "CHANGELOG.md").read_text(), re.MULTILINE)[:1]
    assert project["version"] == planner.__version__ == heading


def test_the_glossary_has_one_sentence_a_word():
    rows = GLOSSARY_ROW.findall(PAGES["docs/glossary.md"])
    assert len(rows) >= 60
    assert len({anchor for anchor, *_ in rows}) == len(rows)
    assert [name.lower() for _, name, _ in rows] == sorted(name.lower() for _, name, _ in rows)
    for _, name, sentence in rows:
        assert sentence[0].islower(), name
        assert not re.search(r"\. ", sentence), name


def test_a_word_is_linked_once_and_only_in_running_text():
    text = "# A rival\n\nA rival, `rival` and [a rival](x.md) of a finding.\n\nrivals\n\n| rival |\n"
    assert glossary_links().link_terms(text, "../glossary.md") == (
        "# A rival\n\nA [rival](../glossary.md#rival), `rival` and [a rival](x.md) of a "
        "[finding](../glossary.md#finding).\n\nrivals\n\n| rival |\n"
    )


@cache
def glossary_links():
    spec = importlib.util.spec_from_file_location("glossary_links", DOCS / "glossary_links.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_panda_s_cell_is_the_one_that_is_shown():
    (shown,) = re.findall(r"^```toml\n(.*?)^```", PAGES["docs/tutorials/panda.md"], re.MULTILINE | re.DOTALL)
    file = ROOT / "examples" / "panda_ball.toml"
    assert file.read_text() == shown
    assert load_cell(file, planning=False).robot.n_joints == 7


CHAIN = ("plan", "export", "simulate", "identify", "compensate", "plan-check", "check", "record", "robots", "dialects")


@pytest.mark.long
def test_the_examples_of_the_commands_run_in_their_order(tmp_path, monkeypatch):
    """With few poses at rest in place of the cell's, whose plan takes minutes; the first example of each page."""
    text = load_cell("comau-nj130/edbb").path.read_text().replace('measure = "continuous"', 'measure = "static"')
    small = tmp_path / "small.toml"
    small.write_text(text.partition("\n[plan]\n")[0] + "\n[plan]\ncandidates = 250\nposes = 36\nrefine = false\n")
    (tmp_path / "empty").mkdir()
    monkeypatch.chdir(tmp_path / "empty")
    for verb in CHAIN:
        page = PAGES[f"docs/commands/{verb}.md"]
        if targets := re.findall(r"```text\n(q1_deg.*?)```", page, re.DOTALL):
            Path("targets.csv").write_text(*targets)
        first = re.findall(r"```console\n(.*?)```", page, re.DOTALL)[0]
        for words in commands(first):
            done = edbb(*(str(small) if w == "comau-nj130/edbb" else w for w in words))
            assert done.returncode == (3 if words[0] == "check" else 0), f"{words}: {done.stderr}"  # axis 3 has slipped
    for name in ("report.html", "robot.toml", "identification.json", "residuals.csv", "expected_error.csv"):
        assert (Path("calibrated") / name).is_file()
