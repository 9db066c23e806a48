"""Text in Markdown, and tables in it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence


def paragraphs(*parts: str) -> str:
    """Headings, paragraphs and tables, one after the other."""
    return "\n\n".join(parts) + "\n"


def table(header: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A table with a line for each row."""
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join(f"| {' | '.join(map(str, line))} |" for line in lines)


def with_spread(mean: float | None, sd: float | None) -> str:
    """A mean and its standard deviation, where there is one."""
    return number(mean) if sd is None else f"{number(mean)} ± {number(sd)}"


def number(value: float | None, digits: int = 3) -> str:
    """A figure, or a dash where there is none."""
    return "–" if value is None else f"{value:.{digits}f}"
