"""What the site adds to docs/: the README as its first page, and a list of the decisions.

Links between the README and the pages lead to the same places on the site as in the repository.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path
from typing import Final

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

_DOCS: Final = Path(__file__).resolve().parents[1]
_LINK: Final = re.compile(r"(?<=\]\()(?!\w+:|#)([^)#\s]+)")


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Leave the page on keys out of the navigation where there is none."""
    if not (_DOCS / "keys.md").exists():
        for section in config.nav:
            for pages in section.values():
                if isinstance(pages, list) and {"Keys": "keys.md"} in pages:
                    pages.remove({"Keys": "keys.md"})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the README and the list of the decisions."""
    readme = (_DOCS.parent / "README.md").read_text()
    files.append(File.generated(config, "index.md", content=readme))
    files.append(File.generated(config, "decisions/index.md", content=_decisions()))
    for decision in _decision_files():
        found = files.get_file_from_path(f"decisions/{decision.name}")
        if found is not None:
            found.inclusion = type(found.inclusion).NOT_IN_NAV
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:  # noqa: ARG001
    """Turn links of the repository into those of the site."""
    here = page.file.src_uri
    at = "README.md" if here == "index.md" else f"docs/{here}"

    def on_site(link: re.Match[str]) -> str:
        place = posixpath.normpath(posixpath.join(posixpath.dirname(at), link[1]))
        place = {"README.md": "docs/index.md", "docs/decisions": "docs/decisions/index.md"}.get(
            place, place
        )
        return posixpath.relpath(place, posixpath.dirname(f"docs/{here}"))

    return _LINK.sub(on_site, markdown)


def _decision_files() -> list[Path]:
    return sorted((_DOCS / "decisions").glob("*.md"))


def _decisions() -> str:
    """Return a page that lists the decisions by their headings."""
    lines = ["# Decisions", "", "What was decided, why, and what follows from it.", ""]
    for file in _decision_files():
        heading = file.read_text().splitlines()[0].removeprefix("# ")
        lines.append(f"- [{heading}]({file.name})")
    return "\n".join(lines) + "\n"
