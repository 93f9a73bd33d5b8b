"""How a result shows itself: a line as ``repr``, a table as ``str``, a table and a figure in a notebook."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def page(text: str, figure: Figure | None = None) -> str:
    """HTML of a table that is text, with a figure below it."""
    # A table's lines must not wrap, whatever style the notebook has.
    style = "line-height:1.25;font-size:0.8em;white-space:pre;overflow-x:auto"
    shown = f'<pre style="{style}">{escape(text)}</pre>'
    if figure is None:
        return shown
    import base64
    import io

    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=90)
    return f'{shown}<img alt="" src="data:image/png;base64,{base64.b64encode(png.getvalue()).decode()}">'
