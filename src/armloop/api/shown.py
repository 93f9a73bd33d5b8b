"""Display of results: a line as ``repr``, a table as ``str``, a table and a figure in a notebook."""

from __future__ import annotations

from functools import partial
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

    return f'{shown}<img alt="" src="data:image/png;base64,{base64.b64encode(_png(figure)).decode()}">'


def displayed(figure: Figure) -> Figure:
    """The same figure, which a notebook displays as a picture even where nobody has imported pyplot."""
    setattr(figure, "_repr_png_", partial(_png, figure))  # noqa: B010 (no attribute of the class)
    return figure


def _png(figure: Figure) -> bytes:
    import io

    png = io.BytesIO()
    figure.savefig(png, format="png", dpi=90)
    return png.getvalue()
