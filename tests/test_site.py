"""The site of `make docs`: whole, and content with itself."""

import os
import re
import subprocess
import sys
from html.parser import HTMLParser
from urllib.parse import unquote, urlsplit

import pytest
import yaml

from tests.test_readme import ROOT

SITE = ROOT / "docs" / "site"
LOADING = {"src", "srcset", "poster", "data"}
"""Attributes whose address a browser asks for by itself; of <link> also href."""
NO_PROSE = ("code", "script", "style", "title", "h1", "h2", "h3", "a")


class Page(HTMLParser):
    """What a page loads, links to, and can be linked to at; `text` is the prose."""

    def __init__(self, path):
        super().__init__()
        self.loads, self.links, self.anchors, self.images, self.text = [], [], set(), [], ""
        self._code = 0
        self.feed(path.read_text())

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self._code += tag in NO_PROSE
        self.anchors |= {found[name] for name in ("id", "name") if found.get(name)}
        self.loads += [value for name, value in attributes if name in LOADING and value]
        if tag == "link" and found.get("rel") != "canonical":
            self.loads.append(found["href"])
        if tag == "a" and "href" in found:
            self.links.append(found["href"])
        if tag == "img":
            self.images.append(found)

    def handle_endtag(self, tag):
        self._code -= tag in NO_PROSE

    def handle_data(self, data):
        self.text += "" if self._code else data


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the built site, and its pages by path."""
    folder = tmp_path_factory.mktemp("site")
    build = (sys.executable, "-m", "mkdocs", "build", "--strict", "--config-file")
    done = subprocess.run(
        [*build, SITE / "mkdocs.yml", "--site-dir", folder],
        cwd=ROOT,
        env=os.environ | {"NO_MKDOCS_2_WARNING": "1"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr
    return folder, {path: Page(path) for path in sorted(folder.rglob("*.html"))}


def is_outside(address):
    return bool(urlsplit(address).scheme or urlsplit(address).netloc)


def test_every_page_of_docs_and_the_readme_is_on_the_site(site):
    folder, pages = site
    written = {path.relative_to(ROOT / "docs") for path in (ROOT / "docs").rglob("*.md")}
    for name in [*(path.with_suffix(".html") for path in written), "index.html"]:
        assert folder / name in pages, name
    assert "never tell each other where they are" in (folder / "index.html").read_text()


def test_no_page_asks_for_anything_outside_of_the_site(site):
    folder, pages = site
    for path, page in pages.items():
        assert [address for address in page.loads if is_outside(address)] == [], path
    for style in folder.rglob("*.css"):
        text = style.read_text()
        asked = re.findall(r"@import\s+([^;]+)|url\(\s*[\"']?([^)\"']+)", text)
        assert not [a for pair in asked for a in pair if a.startswith(("http", "//"))], style


def test_every_link_of_the_site_leads_somewhere(site):
    folder, pages = site
    count = 0
    for path, page in pages.items():
        for address in (*page.links, *page.loads):
            parts = urlsplit(address)
            if is_outside(address) or path.name == "404.html" or address.startswith("data:"):
                continue
            target = (path.parent / unquote(parts.path)).resolve() if parts.path else path
            target = target / "index.html" if target.is_dir() else target
            assert target.is_file(), f"{path.relative_to(folder)}: {address}"
            if parts.fragment and target in pages and not parts.fragment.startswith("__"):
                assert unquote(parts.fragment) in pages[target].anchors, f"{path}: {address}"
            count += 1
    assert count > 500


def test_every_picture_is_there_and_says_what_it_shows(site):
    _, pages = site
    shown = {}
    for path, page in pages.items():
        for image in page.images:
            assert image.get("alt"), path
            shown[(path.parent / image["src"]).resolve()] = path
    assert len(shown) >= 14
    assert all(image.stat().st_size > 1_000 for image in shown)


def test_no_list_or_table_is_taken_for_prose(site):
    for path, page in site[1].items():
        assert re.findall(r"\n(?:- |\d+\. |\|).*", page.text) == [], path


def test_the_navigation_names_every_page():
    text = (SITE / "mkdocs.yml").read_text().replace("!relative ", "")
    named = set()
    for section in yaml.safe_load(text)["nav"]:
        for pages in section.values():
            found = pages if isinstance(pages, list) else [{"": pages}]
            named |= {place for page in found for place in page.values()}
    there = {path.name for path in (ROOT / "docs").glob("*.md")}
    assert there | {"keys.md"} == named - {"index.md", "decisions/index.md"} | {"keys.md"}
