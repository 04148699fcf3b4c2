"""The tables of what notebooks show, read back."""

import html.parser

TAGS = ("table", "caption", "b", "i", "tr", "th", "td", "details", "summary", "pre", "progress", "div")


def cells(shown):
    """Rows of texts of all tables of an object; every tag must be closed, and known to be harmless."""
    return _Reader(shown._repr_html_()).rows


def pairs(shown):
    """dict of the rows of two cells."""
    return dict(row for row in cells(shown) if len(row) == 2)


class _Reader(html.parser.HTMLParser):
    def __init__(self, text):
        super().__init__()
        self.rows, self._open = [], []
        self.feed(text)
        self.close()
        assert not self._open

    def handle_starttag(self, tag, attributes):
        assert tag in TAGS and {name for name, _ in attributes} <= {"style", "colspan", "max", "value"}
        self._open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("th", "td"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self._open.pop() == tag

    def handle_data(self, data):
        if {"td", "th"} & set(self._open):
            self.rows[-1][-1] += data
