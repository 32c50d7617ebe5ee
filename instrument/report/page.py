"""The page of a report: one HTML file, pictures inside it, readable on a phone, no request to anywhere."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from pathlib import Path

_STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 62rem; background: #fff; color: #1f2933;
  font: 16px/1.5 system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif; }
h1 { font-size: 1.15rem; margin: 0 0 .8rem; font-weight: 600; }
h2 { font-size: 1.1rem; margin: 2rem 0 .6rem; }
.banner { border: 2px solid; border-left-width: 14px; border-radius: 8px; padding: .8rem 1.1rem; margin: 0 0 1rem; }
.banner .word { font-size: 1.9rem; font-weight: 700; line-height: 1.2; }
.banner p { margin: .3rem 0 0; }
.pass { background: #e8f5ec; border-color: #1b7f3b; } .pass .word { color: #14602c; }
.caution { background: #fff5dc; border-color: #b57600; } .caution .word { color: #7a4f00; }
.fail { background: #fdeaea; border-color: #b3180f; } .fail .word { color: #8f130c; }
.plain { background: #eef3f8; border-color: #4a6785; } .plain .word { color: #2c4560; }
.figures { display: grid; grid-template-columns: repeat(auto-fit, minmax(11rem, 1fr)); gap: .7rem; margin: 0 0 1.2rem; }
.figures div { border: 1px solid #cbd2d9; border-radius: 8px; padding: .6rem .8rem; }
.figures b { display: block; font-size: 1.5rem; line-height: 1.25; } .figures span { color: #52606d; font-size: .9rem; }
figure { margin: 0 0 1.6rem; } figure img { width: 100%; height: auto; display: block; }
figcaption { color: #3e4c59; font-size: .95rem; }
table { border-collapse: collapse; width: 100%; font-size: .95rem; }
td, th { text-align: left; padding: .3rem .6rem .3rem 0; border-bottom: 1px solid #e4e7eb; vertical-align: top; }
th { font-weight: 500; color: #52606d; width: 42%; } td { overflow-wrap: anywhere; }
details { margin: 1rem 0; } summary { cursor: pointer; font-weight: 600; }
pre { overflow-x: auto; background: #f5f7fa; padding: .8rem; border-radius: 6px; font-size: .8rem; }
footer { color: #616e7c; font-size: .85rem; margin-top: 2rem; }
"""


@dataclass(frozen=True)
class Banner:
    """What one sees first; `kind` is pass, caution, fail or plain."""

    kind: str
    symbol: str
    word: str
    sentences: Sequence[str]


@dataclass(frozen=True)
class Picture:
    """A PNG file, what it is called, and what one sees in it."""

    file: Path
    title: str
    caption: str


@dataclass(frozen=True)
class Page:
    """All that is on the page, from top to bottom; texts are plain, the page escapes them."""

    title: str
    banners: Sequence[Banner]
    figures: Sequence[tuple[str, str]]
    pictures: Sequence[Picture]
    facts: Sequence[tuple[str, str]]
    details: Sequence[tuple[str, str]]
    footer: str

    def html(self) -> str:
        """Return the page."""
        parts = [
            '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n',
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n',
            '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src data:; '
            "style-src 'unsafe-inline'\">\n",
            f"<title>{escape(self.title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n",
            f"<h1>{escape(self.title)}</h1>\n",
            *map(_banner, self.banners),
            '<div class="figures">\n',
            *(f"<div><b>{_tied(value)}</b><span>{_tied(name)}</span></div>\n" for value, name in self.figures),
            "</div>\n",
            *map(_picture, self.pictures),
            "<h2>All figures</h2>\n<table>\n",
            *(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>\n" for name, value in self.facts),
            "</table>\n",
            *(
                f"<details><summary>{escape(name)}</summary><pre>{escape(text)}</pre></details>\n"
                for name, text in self.details
            ),
            f"<footer>{escape(self.footer)}</footer>\n</body>\n</html>\n",
        ]
        return "".join(parts)


def _tied(text: str) -> str:
    """Return a text in which no number is torn from its unit."""
    return escape(text).replace(" %", "&nbsp;%").replace(" mm", "&nbsp;mm")


def _banner(banner: Banner) -> str:
    sentences = "".join(f"<p>{escape(text)}</p>" for text in banner.sentences)
    word = f'<div class="word"><span aria-hidden="true">{banner.symbol}</span> {escape(banner.word)}</div>'
    return f'<div class="banner {banner.kind}" role="status">{word}{sentences}</div>\n'


def _picture(picture: Picture) -> str:
    data = base64.b64encode(picture.file.read_bytes()).decode("ascii")
    return (
        f"<h2>{escape(picture.title)}</h2>\n<figure>"
        f'<img src="data:image/png;base64,{data}" alt="{escape(picture.caption)}">'
        f"<figcaption>{escape(picture.caption)}</figcaption></figure>\n"
    )
