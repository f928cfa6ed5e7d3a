"""A report as one HTML page that needs no network."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from pathlib import Path

from rsmkit.io.files.atomic_files import write_text
from rsmkit.report.paper.blocks import Block, Grid, Heading, NewPage, Paper, Picture, cell_text

__all__ = ["html_text", "write_html"]

STYLE = """
@page { size: A4; margin: 20mm 18mm;
  @bottom-right { content: counter(page) " / " counter(pages); font-size: 8pt } }
body { font: 10pt/1.45 "DejaVu Sans", Helvetica, Arial, sans-serif; color: #222; max-width: 50em;
  margin: 2em auto }
@media print { body { margin: 0; max-width: none } }
h1 { font-size: 19pt; margin: 0 0 .4em } h2 { font-size: 14pt; margin: 1.4em 0 .4em; break-after: avoid }
h3 { font-size: 11pt; margin: 1.2em 0 .3em; break-after: avoid }
table { border-collapse: collapse; margin: .4em 0 1em; font-size: 8.5pt }
caption { text-align: left; font-weight: bold; padding: .3em 0; break-after: avoid }
thead { break-after: avoid }
th, td { border-bottom: 1px solid #ccc; padding: .2em .6em; text-align: right; vertical-align: top }
th { background: #dde6f0 } th:first-child, td:first-child { text-align: left }
tr { break-inside: avoid } tr.grey td { color: #999 }
p { overflow-wrap: anywhere } p.strong { font-weight: bold; border-left: 4px solid #356; padding-left: .7em }
figure { margin: .6em 0 1.2em; break-inside: avoid } img { max-width: 100% }
figcaption { font-size: 8.5pt; color: #555 } .new { break-before: page }
"""


def html_text(paper: Paper) -> str:
    """Make the text of the page; every text of the user is escaped."""
    parts, breaks = [], False
    for block in paper.blocks:
        if isinstance(block, NewPage):
            breaks = True
            continue
        parts.append(_part(block, ' class="new"' if breaks else ""))
        breaks = False
    policy = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(paper.title)}</title>'
        f'<meta http-equiv="Content-Security-Policy" content="{escape(policy)}"><style>{STYLE}</style></head>'
        f"<body><h1>{escape(paper.title)}</h1>\n" + "\n".join(parts) + "\n</body></html>\n"
    )


def write_html(paper: Paper, path: Path) -> None:
    """Write the page in one step."""
    write_text(path, html_text(paper).encode(errors="backslashreplace").decode())


def _part(block: Block, mark: str) -> str:
    if isinstance(block, Heading):
        level = block.level + 1
        return f"<h{level}{mark}>{escape(block.text)}</h{level}>"
    if isinstance(block, Grid):
        return _table(block, mark)
    if isinstance(block, Picture):
        data = b64encode(block.png).decode()
        caption = escape(block.caption)
        image = f'<img src="data:image/png;base64,{data}" alt="{caption}">'
        return f"<figure{mark}>{image}<figcaption>{caption}</figcaption></figure>"
    assert not isinstance(block, NewPage)
    return (
        f'<p class="strong">{escape(block.text)}</p>'
        if block.strong
        else f"<p{mark}>{escape(block.text)}</p>"
    )


def _table(grid: Grid, mark: str) -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in grid.heads)
    rows = "".join(
        f"<tr{' class=grey' if i in grid.greyed else ''}>"
        + "".join(f"<td>{escape(cell_text(cell))}</td>" for cell in row)
        + "</tr>"
        for i, row in enumerate(grid.rows)
    )
    caption = f"<caption>{escape(grid.title)}</caption>" if grid.title else ""
    return f"<table{mark}>{caption}<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>"
