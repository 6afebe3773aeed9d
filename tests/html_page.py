"""A reader of pages for tests: nesting, tags, words."""

import re
from html.parser import HTMLParser

VOID = {"meta", "br", "wbr", "link", "img", "input", "hr"}


class Page(HTMLParser):
    """Checks nesting and collects what is needed."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.errors: list[str] = []
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)
        self.close()
        self.errors += [f"{tag} is never closed" for tag in self.open]

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.errors.append(f"{tag} closes something else")

    def handle_data(self, data):
        if not self.open or self.open[-1] not in {"style", "script"}:
            self.words.append(data)

    @property
    def text(self) -> str:
        return re.sub(r"\s+", " ", "".join(self.words))

    def all(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.tags if name == tag]


def assert_loads_nothing(page: Page) -> None:
    """Tags are nested, every link leads to a place in the page, and nothing is loaded."""
    assert page.errors == []
    links = [value for _, a in page.tags for key, value in a.items() if key in {"src", "href", "xlink:href"}]
    assert links and all(value is not None and value.startswith("#") for value in links)
    assert not {"link", "img", "iframe"} & {tag for tag, _ in page.tags}


def assert_references_lead_somewhere(page: Page) -> None:
    """Identifiers are unique, and what is referred to is there."""
    ids = [a["id"] for _, a in page.tags if "id" in a]
    assert len(ids) == len(set(ids))
    wanted = [key for _, a in page.tags for key in (a.get("aria-labelledby") or "").split()]
    wanted += [a["href"].removeprefix("#") for _, a in page.tags if a.get("href")]
    assert wanted and set(wanted) <= set(ids)


def assert_speaks_to_screen_readers(page: Page) -> list[dict[str, str | None]]:
    """Drawings and tables are described; returns the drawings."""
    drawings = [a for a in page.all("svg") if a.get("aria-hidden") != "true"]
    assert all(a.get("role") == "img" and a.get("aria-labelledby") for a in drawings)
    assert len(page.all("desc")) == len(drawings)
    assert len(page.all("caption")) == len(page.all("table"))
    return drawings
