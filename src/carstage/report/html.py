"""Small pieces of HTML; everything that is not markup is escaped here."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape

STYLE = """
:root { color-scheme: light dark; --bg: #f6f7f9; --card: #fff; --text: #1b1f27; --soft: #5d6675;
  --line: #dfe3ea; --bar: #3a78d6; --good: #1a7f4b; --bad: #c0362c; --warn: #9a6700; }
@media (prefers-color-scheme: dark) { :root { --bg: #101319; --card: #191d26; --text: #e7eaf0;
  --soft: #98a1b2; --line: #2b313d; --bar: #5b95ee; --good: #4ccb85; --bad: #ff7a6e;
  --warn: #e2b04a; } }
* { box-sizing: border-box; }
body { margin: 0; background: var(--bg); color: var(--text); line-height: 1.45;
  font: 15px/1.45 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
main { max-width: 1240px; margin: 0 auto; padding: 32px 20px 64px; }
h1 { font-size: 28px; margin: 0; letter-spacing: -.01em; }
h2 { font-size: 20px; margin: 40px 0 12px; }
h3 { font-size: 15px; margin: 22px 0 8px; }
p { margin: 6px 0 12px; max-width: 78ch; } .soft { color: var(--soft); }
code { font: 13px ui-monospace, SFMono-Regular, Menlo, monospace; overflow-wrap: anywhere; }
.head { display: flex; gap: 14px; align-items: center; flex-wrap: wrap; }
.badge { border-radius: 999px; padding: 3px 12px; font-weight: 600; font-size: 14px;
  border: 1.5px solid currentColor; }
.good { color: var(--good); } .bad { color: var(--bad); } .warn { color: var(--warn); }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(130px, 1fr)); gap: 12px;
  margin: 20px 0; }
.tile, .card { background: var(--card); border: 1px solid var(--line); border-radius: 10px; }
.tile { padding: 12px 14px; } .tile b { display: block; font-size: 22px;
  font-variant-numeric: tabular-nums; } .tile span { color: var(--soft); font-size: 13px; }
.card { padding: 14px 16px; overflow-x: auto; }
.grid { display: grid; gap: 12px; grid-template-columns: repeat(auto-fit, minmax(300px, 1fr)); }
.below { margin-top: 12px; }
.maps { grid-template-columns: repeat(auto-fill, minmax(min(100%, 380px), 594px)); }
.showcase { grid-template-columns: repeat(auto-fit, minmax(min(100%, 380px), 1fr));
  margin: 18px 0 4px; align-items: start; }
.showcase figure:has(img[alt^="LiDAR from above"]) { grid-row: span 2; }
.wide { grid-template-columns: repeat(auto-fit, minmax(min(100%, 380px), 1fr)); }
figure { margin: 0; } figure img { width: 100%; height: auto; display: block; border-radius: 8px;
  border: 1px solid var(--line); background: #000; }
figcaption { color: var(--soft); font-size: 13px; margin: 4px 2px 0; }
.film { max-width: 640px; margin: 12px 0; } .film video { width: 100%; display: block;
  border-radius: 8px; background: #000; }
table { border-collapse: collapse; width: 100%; font-size: 14px; }
th { text-align: left; font-weight: 600; color: var(--soft); }
th, td { padding: 5px 12px 5px 0; border-bottom: 1px solid var(--line); vertical-align: top; }
tr:last-child td { border-bottom: 0; } td.n { font-variant-numeric: tabular-nums; }
.legend { display: flex; flex-wrap: wrap; gap: 6px 16px; margin: 8px 0 12px; font-size: 13px; }
.legend i { display: inline-block; width: 11px; height: 11px; border-radius: 3px;
  margin-right: 6px; vertical-align: -1px; }
svg { display: block; width: 100%; height: auto; }
svg text { fill: var(--text); font-size: 12px; } svg .v { fill: var(--soft); }
details summary { cursor: pointer; color: var(--soft); margin: 8px 0; }
footer { color: var(--soft); font-size: 13px; margin-top: 48px; }
"""

_LABEL_PX, _BAR_PX, _VALUE_PX, _ROW_PX = 130, 230, 60, 22


def page(title: str, body: str) -> str:
    """A whole document; ``body`` is markup."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n"
        f"<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def counted(count: int, name: str) -> tuple[str, str]:
    """A tile that counts things of a name."""
    return f"{name}{'' if count == 1 else 's'}", f"{count:,}"


def tiles(figures: Iterable[tuple[str, str]]) -> str:
    """Big numbers with what they count."""
    cells = "".join(
        f'<div class="tile"><b>{escape(value)}</b><span>{escape(name)}</span></div>'
        for name, value in figures
    )
    return f'<div class="tiles">{cells}</div>'


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table in a card; numbers get figures of one width."""

    def cell(value: object) -> str:
        css = ' class="n"' if isinstance(value, (int, float)) else ""
        return f"<td{css}>{escape(str(value))}</td>"

    header = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(f"<tr>{''.join(cell(value) for value in row)}</tr>" for row in rows)
    return (
        f'<div class="card"><table><thead><tr>{header}</tr></thead><tbody>{body}</tbody></table>'
        "</div>"
    )


def figure(source: str, caption: str) -> str:
    """A picture with a caption; ``source`` is a ``data:`` address."""
    alt = escape(caption, quote=True)
    return (
        f'<figure><img src="{source}" alt="{alt}" loading="lazy">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def folded(summary: str, content: str) -> str:
    """Markup that opens at a click on its summary."""
    return f"<details><summary>{escape(summary)}</summary>{content}</details>"


def film(source: str, caption: str) -> str:
    """A film with a caption; ``source`` is a ``data:`` address."""
    return (
        f'<figure class="film"><video src="{source}" controls loop muted preload="metadata">'
        f"</video><figcaption>{escape(caption)}</figcaption></figure>"
    )


def legend(entries: Iterable[tuple[str, tuple[int, int, int]]]) -> str:
    """Names with their colours."""
    items = "".join(
        f'<span><i style="background:{css_colour(colour)}"></i>{escape(name)}</span>'
        for name, colour in entries
    )
    return f'<div class="legend">{items}</div>'


def size(count: float) -> str:
    """A number of bytes with its unit, three digits."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000:
            return f"{count:.3g} {unit}"
        count /= 1000
    return f"{count:.3g} TB"


def css_colour(colour: tuple[int, int, int]) -> str:
    """``#rrggbb``."""
    return "#{:02x}{:02x}{:02x}".format(*colour)


def bars(title: str, rows: Sequence[tuple[str, int, str | None]]) -> str:
    """A bar chart as inline SVG in a card.

    Args:
        title: heading.
        rows: label, value and CSS colour (``None``: the accent colour) of each bar.
    """
    most = max((value for _, value, _ in rows), default=0) or 1
    width, height = _LABEL_PX + _BAR_PX + _VALUE_PX, _ROW_PX * max(1, len(rows))
    parts = []
    for index, (label, value, colour) in enumerate(rows):
        y = index * _ROW_PX
        length = _BAR_PX * value / most
        parts.append(
            f'<text x="{_LABEL_PX - 8}" y="{y + 15}" text-anchor="end">{escape(label)}</text>'
            f'<rect x="{_LABEL_PX}" y="{y + 4}" width="{max(length, 1):.1f}" height="14" rx="3" '
            f'style="fill:{colour or "var(--bar)"}"/>'
            f'<text class="v" x="{_LABEL_PX + length + 7:.1f}" y="{y + 15}">{value:,}</text>'
        )
    return (
        f'<div class="card"><h3 style="margin-top:0">{escape(title)}</h3>'
        f'<svg viewBox="0 0 {width} {height}" role="img" aria-label="{escape(title, quote=True)}">'
        f"{''.join(parts)}</svg></div>"
    )
