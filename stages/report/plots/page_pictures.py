"""A panel as SVG inside a page, as matplotlib writes it, but in the theme's colours.

Every light value of the palette becomes the custom property of its hue.
"""

from __future__ import annotations

import io
import re
import traceback
import warnings

from markupsafe import Markup, escape

from shukotsu.errors import INTERNAL, on_one_line
from shukotsu.sentences.translation import tr, translated
from shukotsu.stages.report.palette import as_custom_property
from shukotsu.stages.report.plots.panels import Panel, page_figure
from shukotsu.stages.report.plots.style import applied, rewrite, without_controls

_LEFT_OUT = re.compile(
    r'<style.*?</style>| id="(?:[A-Za-z.]+(?:2d)?_|dots)\d+"|font-family: [^;"]*; |\n *', re.DOTALL
)
"""A style of the whole page, identifiers that other pictures have too, fonts, and indentation."""
_ROOT = re.compile(r'<svg [^>]*?(viewBox="[^"]*")[^>]*>(.*)</svg>', re.DOTALL)
_COLOUR, _DECIMALS = re.compile(r"#[0-9a-f]{6}\b"), re.compile(r"(\.\d\d)\d+")
_UNDRAWN: list[str] = []


def taken_failures() -> list[str]:
    """Why pictures could not be drawn since this was last asked."""
    messages = [*_UNDRAWN]
    _UNDRAWN.clear()
    return messages


def page_picture(panel: Panel) -> Markup:
    """The picture as an element of a page, or the sentence why there is none; the same for the same panel."""
    try:
        return _svg(panel)
    except MemoryError:
        raise
    except Exception as error:  # a picture must not cost a study its page
        traceback.print_exc()
        text = on_one_line(f"{panel.title}: {type(error).__name__}: {error}")
        message = f"{INTERNAL} report ({text}); please report it with the log"
        _UNDRAWN.append(message)
        return Markup("<p>{}</p>").format(tr("Not drawn: {reason}.", reason=translated(message)))


def _svg(panel: Panel) -> Markup:
    written = io.BytesIO()
    with applied({"svg.hashsalt": panel.title}), warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # the browser has it
        figure = page_figure(panel)
        rewrite(figure, without_controls)
        engine = figure.get_layout_engine()
        assert engine is not None
        engine.execute(figure)
        figure.set_layout_engine(None)  # else matplotlib draws the figure once more
        figure.savefig(written, format="svg", metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    ((size, body),) = _ROOT.findall(written.getvalue().decode())
    body = _COLOUR.sub(lambda colour: as_custom_property(colour[0]), _LEFT_OUT.sub("", body))
    body = _DECIMALS.sub(r"\1", body)
    return Markup(f'<svg {size} role="img"><title>{escape(panel.title)}</title>{body}</svg>')
