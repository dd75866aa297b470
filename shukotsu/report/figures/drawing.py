"""Panels, which are drawn alone as SVG in a page or in a grid for print, and figures with captions.

Most panels are named rows of dots over a common horizontal scale; one shows a hand in a single frame from its
back and from its thumb's side. Equal figures give files with equal bytes.
"""

from __future__ import annotations

import io
import re
import traceback
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from string import ascii_lowercase

import matplotlib
import numpy as np
import numpy.typing as npt
from markupsafe import Markup, escape
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.ticker import FixedFormatter, FuncFormatter, Locator, LogLocator, MaxNLocator, NullLocator

from shukotsu.arrays import Array
from shukotsu.errors import INTERNAL, on_one_line
from shukotsu.report import palette, table_cells, templates
from shukotsu.report.belief import BELIEF_MARKS, BELIEVED
from shukotsu.report.figures import style
from shukotsu.report.figures.style import ONE_COLUMN_MM, SMALL_PT, TWO_COLUMNS_MM
from shukotsu.report.hand_motion import BoneLine, HandMotion, ShownSkeleton, view_points
from shukotsu.report.palette import INK, PAPER, SOFT, Look, PlotMark, as_custom_property
from shukotsu.report.study_results import StudyResults
from shukotsu.resources import PROGRAM, VERSION
from shukotsu.tables.whole_files import replacing, write_text
from shukotsu.translation import ENGLISH, N_, language, listed, ngettext, punctuated, tr, translated, word

PAGE_MM = 84.0
"""Width of a picture for a page, before the page scales it."""
ROW_MM, FOOT_MM = 3.6, 9.0
"""Heights of a row, and of the text below the axes."""
FEWEST_FOR_QUARTILES = 4
LINE_MM, ROW_LETTERS = 3.2, int(42.0 / style.width_mm("m"))
"""Height of a line of a row's name, and its largest number of letters."""
_LEGEND_LINE_MM, _KEY_MM, _GAP_MM, _PAD_MM = 4.2, 9.0, 2.0, 1.6
_SCATTER, _GOLDEN = 0.6, (5**0.5 - 1) / 2
_GROSS, _DECADES, _ROUNDING, _MARGIN = 8.0, 4.0, 1e-6, 0.06
"""Ratio of the largest number to the median above which a scale is logarithmic; powers of ten on a
logarithmic scale; numbers that are zero up to rounding, mm or degrees; share of a scale kept free at each
end.
"""


@dataclass(frozen=True)
class Panel:
    """A panel: heading, title for screen readers, heights of axes and text below, and drawing function."""

    heading: str
    title: str
    height_mm: float
    foot_mm: float
    draw: Callable[[Axes], None]


def in_rows(panels: Sequence[Panel], across: int) -> list[Sequence[Panel]]:
    """Split the panels into rows of `across`."""
    return [panels[start : start + across] for start in range(0, len(panels), across)]


def print_figure(
    rows: Sequence[Sequence[Panel]], handles: Sequence[Artist] = (), figure_mm: float = TWO_COLUMNS_MM
) -> Figure:
    """Return a figure of rows of panels, each with a letter and a heading, below a legend."""
    across, names = max(map(len, rows)), iter(panel_names(sum(map(len, rows))))
    widest = max((style.width_mm(str(handle.get_label())) for handle in handles), default=0.0) + _KEY_MM
    columns = max(1, min(len(handles), int(figure_mm / widest)))
    letters = int((figure_mm / across - 12.0) / style.width_mm("m"))
    headings = [["\n".join(style.wrap_text(panel.heading, letters)) for panel in row] for row in rows]
    heights = [max(panel.height_mm for panel in row) for row in rows]
    down = sum(heights) + _LEGEND_LINE_MM * -(-len(handles) // columns)
    for row, texts in zip(rows, headings, strict=True):
        down += max(panel.foot_mm for panel in row) + _GAP_MM
        down += LINE_MM * (1 + max(text.count("\n") for text in texts))
    figure = _blank(figure_mm, down)
    grid = figure.add_gridspec(len(rows), across, height_ratios=heights)
    for row_index, row in enumerate(rows):
        drawn = [figure.add_subplot(grid[row_index, column]) for column in range(len(row))]
        for axes, panel, heading in zip(drawn, row, headings[row_index], strict=True):
            panel.draw(axes)
            weight = "bold" if language() == ENGLISH else "normal"
            axes.set_title(next(names), loc="left", fontweight=weight)
            axes.set_title(heading, loc="right", fontsize=SMALL_PT)
        lines = [[label.get_text() for label in axes.get_yticklabels()] for axes in drawn]
        for (before, after), axes in zip(pairwise(lines), drawn[1:], strict=True):
            axes.tick_params(labelleft=before != after)
            axes.set_ylabel(axes.get_ylabel() if before != after else "")
    if handles:
        figure.legend(handles=handles, loc="outside upper center", ncols=columns)
    return figure


def page_figure(panel: Panel) -> Figure:
    """Return a figure of one panel for a page, without the heading, which the page itself shows."""
    figure = _blank(PAGE_MM, panel.height_mm + panel.foot_mm)
    figure.patch.set_visible(False)
    panel.draw(figure.add_subplot())
    return figure


def _blank(width_mm: float, height_mm: float) -> Figure:
    engine = ConstrainedLayoutEngine(w_pad=_PAD_MM / 25.4)
    return Figure(figsize=(width_mm / 25.4, height_mm / 25.4), layout=engine)


def lay_out(figure: Figure, writable: Callable[[str], str]) -> None:
    """Replace characters that cannot be written, then compute the layout once for all files.

    writable : function that returns a text with such characters replaced.
    """
    style.rewrite(figure, writable)
    for axis in (axis for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)):
        if not axis.get_label_text():  # avoids measuring all tick labels to place an empty label
            axis.set_label_coords(0.0, 0.0)
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.execute(figure)
    figure.set_layout_engine(None)


def panel_names(n: int) -> list[str]:
    """Return the names of n panels: a to z, then aa and so on; a single panel has no name."""
    names = [*ascii_lowercase, *(a + b for a in ascii_lowercase for b in ascii_lowercase)]
    return names[:n] if n > 1 else [""]


_LEFT_OUT = re.compile(
    r'<style.*?</style>| id="(?:[A-Za-z.]+(?:2d)?_|dots)\d+"|font-family: [^;"]*; |\n *', re.DOTALL
)
"""Parts of an SVG to remove: global styles, identifiers that other pictures share, fonts and indentation."""
_ROOT = re.compile(r'<svg [^>]*?(viewBox="[^"]*")[^>]*>(.*)</svg>', re.DOTALL)
_COLOUR, _DECIMALS = re.compile(r"#[0-9a-f]{6}\b"), re.compile(r"(\.\d\d)\d+")
_UNDRAWN: list[str] = []


def taken_failures() -> list[str]:
    """Return the messages about pictures that could not be drawn since the last call."""
    messages = [*_UNDRAWN]
    _UNDRAWN.clear()
    return messages


def page_picture(panel: Panel) -> Markup:
    """Return the panel as an SVG element in the page's theme, or a sentence that states why it failed.

    Every light value of the palette becomes the custom property of its hue. Equal panels give equal text.
    """
    written = io.BytesIO()
    try:
        with style.apply_style({"svg.hashsalt": panel.title}), warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Glyph .* missing")  # the browser has one
            figure = page_figure(panel)
            lay_out(figure, style.without_controls)
            metadata = dict.fromkeys(("Date", "Creator", "Format", "Type"))
            figure.savefig(written, format="svg", metadata=metadata)
    except MemoryError:
        raise
    except Exception as error:  # a page must not be lost to one picture
        traceback.print_exc()
        text = on_one_line(f"{panel.title}: {type(error).__name__}: {error}")
        message = f"{INTERNAL} report ({text}); please report it with the log"
        _UNDRAWN.append(message)
        return Markup("<p>{}</p>").format(tr("Not drawn: {reason}.", reason=translated(message)))
    ((size, body),) = _ROOT.findall(written.getvalue().decode())
    body = _COLOUR.sub(lambda colour: as_custom_property(colour[0]), _LEFT_OUT.sub("", body))
    body = _DECIMALS.sub(r"\1", body)
    return Markup(f'<svg {size} role="img"><title>{escape(panel.title)}</title>{body}</svg>')


def page_pictures(panels: Iterable[Panel]) -> list[tuple[str, Markup]]:
    """Return the headings and pictures of panels that are side by side on a page."""
    return [(panel.heading, page_picture(panel)) for panel in panels]


@dataclass(frozen=True)
class Scale:
    """A scale from `low` to `high`; `kind` is linear or log."""

    low: float
    high: float
    kind: str = "linear"


def value_scale(values: npt.ArrayLike) -> Scale:
    """Return a scale for non-negative values, logarithmic if the largest exceeds _GROSS medians."""
    sizes = np.asarray(values, float)
    sizes = np.where(sizes < _ROUNDING, 0.0, sizes)[np.isfinite(sizes)]
    highest, usual = float(sizes.max(initial=0.0)), float(np.median(sizes)) if len(sizes) else 0.0
    if highest <= _GROSS * usual or highest <= 0.0:
        return Scale(0.0, highest * (1 + _MARGIN) or 1.0)
    lowest = max(float(sizes[sizes > 0].min()), highest / 10.0**_DECADES)
    return Scale(lowest / 1.1, highest * 1.1, "log")


@dataclass(frozen=True)
class PanelRow:
    """A named row: numbers by subject or hand, with a mean and its interval.

    Without a mean, the median and quartiles are marked.
    """

    name: str
    look: Look
    numbers: Mapping[str, float] = field(default_factory=dict)
    mean: float | None = None
    interval: tuple[float, float] | None = None

    def values(self) -> list[float]:
        """All values of the row that its scale must include."""
        return [*self.numbers.values(), *([] if self.mean is None else [self.mean]), *(self.interval or ())]


def draw_rows(
    axes: Axes, rows: Sequence[PanelRow], axis: str, scale: Scale, of_all: int = 0, decimals: int = 1
) -> None:
    """Draw named rows, the first on top, with a dot for each number.

    The dots of a subject or hand have the same vertical offset in every row. of_all : the number of dots in a
    complete row; rows with fewer state their number. If it is 0, means and medians are not written. decimals
    : number of decimals of means and medians.
    """
    row_axes(axes, [word(row.name) for row in rows], axis, scale, top=bool(of_all))
    names = list(dict.fromkeys(name for row in rows for name in row.numbers))
    aside_of = dict(zip(names, scatter_steps(len(names)), strict=True))
    size = 3.4 if len(names) <= 12 else 2.6 if len(names) <= 40 else 1.8
    for y, row in enumerate(rows):
        values = np.array(list(row.numbers.values()))
        middle, bar, colour = row.mean, row.interval, INK
        if middle is None and len(values):
            low, middle, high = np.quantile(values, [0.25, 0.5, 0.75]).tolist()
            bar, colour = ((low, high) if len(values) >= FEWEST_FOR_QUARTILES else None), row.look.colour
        if len(values):
            x = np.maximum(values, scale.low)  # matplotlib omits dots far below a logarithmic scale
            axes.plot(
                x, [y + aside_of[name] for name in row.numbers], "o", color=row.look.colour, markersize=size,
                alpha=0.6, markeredgewidth=0.0, clip_on=False, zorder=2.2, gid=f"dots{y}",
                label="\n".join(row.numbers),
            )  # fmt: skip
        if middle is None:
            continue
        if bar is not None:
            axes.plot(bar, [y, y], color=colour, linewidth=1.4, solid_capstyle="butt", zorder=2.4)
        axes.plot(
            middle, y, row.look.marker, color=row.look.colour, markersize=row.look.size + 1.0, zorder=2.6,
            markeredgewidth=0.6, markeredgecolor=PAPER,
        )  # fmt: skip
        if of_all:
            note = table_cells.number(middle, decimals).replace("-", "−")
            note += f" (n = {len(values)})" if 0 < len(values) < of_all else ""
            _write_aside(axes, y, note, INK)
    if of_all:
        words = tr("mean") if any(row.mean is not None for row in rows) else tr("median")
        _write_aside(axes, -1, words, SOFT)


def _write_aside(axes: Axes, y: int, words: str, colour: str) -> None:
    """Write text to the right of the axes, in line with a row."""
    across = axes.get_yaxis_transform()
    axes.text(1.03, y, words, va="center_baseline", fontsize=SMALL_PT, color=colour, transform=across)


def row_axes(axes: Axes, names: Sequence[str], axis: str, scale: Scale, *, top: bool = False) -> None:
    """Label rows from the top, below a free row if `top`, over a horizontal axis with a grid."""
    axes.set_ylim(len(names) - 0.5, -1.5 if top else -0.5)
    axes.set_yticks(range(len(names)))
    lines = [name.split("\n") for name in names]
    short = [[w if len(w) <= ROW_LETTERS else w[: ROW_LETTERS - 1] + "…" for w in words] for words in lines]
    axes.yaxis.set_major_formatter(FixedFormatter(["\n".join(words) for words in short]))
    axes.spines["left"].set_visible(False)
    axes.set_xscale(scale.kind)
    axes.set_xlim(scale.low, scale.high)
    axes.xaxis.set_major_locator(locator(scale))
    axes.xaxis.set_major_formatter(PLAIN)
    axes.xaxis.set_minor_locator(NullLocator())
    axes.grid(axis="x", clip_on=False)
    axes.tick_params(length=0)
    axes.set_xlabel(axis)


def locator(scale: Scale) -> Locator:
    """Return a locator that puts ticks at round numbers of the scale."""
    if scale.kind == "linear":
        return MaxNLocator(6, steps=[1, 2, 5, 10])
    span = scale.high / scale.low
    steps = (1.0, 2.0, 5.0) if span < 100 else (1.0, 3.0) if span < 2000 else (1.0,)
    return LogLocator(subs=steps, numticks=9)


PLAIN = FuncFormatter(lambda value, _: f"{round(value, 9) + 0.0:g}".replace("-", "−"))
"""Format of a number without trailing zeros, with a typographic minus sign."""


def scatter_steps(n: int) -> Array:
    """Return n reproducible vertical offsets of dots within a row, evenly spread about its middle."""
    steps = (np.arange(n) * _GOLDEN) % 1.0
    return np.asarray((steps - steps.mean()) * _SCATTER) if n else np.zeros(0)


_GUTTER_MM, _BAR_MM, _ROUND_MM, _NEAR_MM = 14.0, 20.0, 10.0, 45.0
"""Lengths, mm: gap between the views, scale bar, margin of the hand, and largest distance of a displayed
joint from the box around the receivers. A joint that is farther away is a gross failure, which is not drawn.
"""
_HIGHEST_MM, _FOOT_MM = 92.0, 10.0
"""Sizes in the picture, mm: largest height of the views, and height of the text below them."""


def hand_panel(title: str, motion: HandMotion, skeleton: ShownSkeleton, frame: int) -> Panel:
    """Return the panel of the hand under a skeleton in the frame with index `frame`."""
    joints = view_points(motion, np.array([frame]), skeleton.position_mm[frame : frame + 1])[0]
    receivers = view_points(motion, np.array([frame]), motion.receiver_mm[frame : frame + 1])[0]
    receivers = np.asarray(receivers[np.isfinite(receivers).all(-1)])
    low, high = receivers.min(axis=0) - _NEAR_MM, receivers.max(axis=0) + _NEAR_MM
    near = np.asarray(((joints >= low) & (joints <= high)).all(axis=1))
    everything = np.concatenate([receivers, joints[near]])
    low, high = everything.min(axis=0) - _ROUND_MM, everything.max(axis=0) + _ROUND_MM
    wide, tall, deep = (high - low).tolist()
    scale = min((PAGE_MM - 4.0) / (wide + _GUTTER_MM + deep), _HIGHEST_MM / tall)
    side = -1.0 if motion.hand == "left" else 1.0  # a left hand's back faces left; no hand is mirrored
    start = wide + _GUTTER_MM + (deep if side < 0 else 0.0)

    def flat(position_mm: Array) -> tuple[Array, Array]:
        """Return the points (n, 2), in mm of the picture, of positions (n, 3) in both views."""
        across, up, towards = (position_mm - low).T
        return np.column_stack([across, up]) * scale, np.column_stack([start + side * towards, up]) * scale

    names = [name for name, inside in zip(skeleton.points, near, strict=True) if not inside]
    absent = tr("Not shown: {names}.", names=listed(map(word, names))) if names else ""
    lines = style.wrap_text(absent, int((PAGE_MM - 4.0) / style.width_mm("m"))) if absent else []
    views = _HandViews(
        joints=flat(np.where(near[:, None], joints, np.nan)),
        receivers=flat(receivers),
        middles=(wide * scale / 2, (wide + _GUTTER_MM + deep / 2) * scale),
        size=((wide + _GUTTER_MM + deep) * scale, tall * scale),
        scale=scale,
        lines=lines,
    )
    draw = partial(_draw_hand, motion=motion, skeleton=skeleton, views=views)
    return Panel("", title, tall * scale + _FOOT_MM + LINE_MM * len(lines), 0.0, draw)


@dataclass(frozen=True)
class _HandViews:
    """Two views of a hand, from its back and its side, in mm of the picture.

    joints, receivers : positions (n, 2) in each view. middles : horizontal positions of the views' names.
    size : width and height. scale : mm in the picture per mm of the hand. lines : text below.
    """

    joints: tuple[Array, Array]
    receivers: tuple[Array, Array]
    middles: tuple[float, float]
    size: tuple[float, float]
    scale: float
    lines: list[str]


def _draw_hand(axes: Axes, motion: HandMotion, skeleton: ShownSkeleton, views: _HandViews) -> None:
    """Draw bones in the colours of digits, joints by verdict, receivers, names of digits and a scale bar."""
    size, lines, scale = views.size, views.lines, views.scale
    colours = [look.colour for look in palette.looks(motion.digits, palette.DIGITS).values()]
    axes.set(xlim=(0, size[0]), ylim=(-_FOOT_MM - LINE_MM * len(lines), size[1]), aspect="equal")
    axes.axis("off")
    digit_of = {bone.end: bone.digit for bone in skeleton.bones}
    of_line: dict[tuple[float, str], list[BoneLine]] = {}  # bones that look alike are drawn together
    for bone in skeleton.bones:
        of_line.setdefault((2.2, colours[bone.digit]) if bone.level >= 0 else (1.0, SOFT), []).append(bone)
    of_mark: dict[tuple[PlotMark, float], list[int]] = {}
    for index, (name, believed) in enumerate(zip(skeleton.points, skeleton.believed, strict=True)):
        if not name.endswith("_tip") and np.isfinite(views.joints[0][index]).all():
            mark, mark_size = BELIEF_MARKS[believed], 5.6
            if believed == BELIEVED:
                edge = colours[digit_of[index]] if index in digit_of else INK
                mark, mark_size = PlotMark("o", PAPER, edge), 4.2
            of_mark.setdefault((mark, mark_size), []).append(index)
    for joints, worn in zip(views.joints, views.receivers, strict=True):
        axes.plot(*worn.T, "s", color=SOFT, markersize=2.6, markeredgewidth=0.0, alpha=0.5, zorder=1)
        for (thick, colour), bones in of_line.items():
            ends = np.stack([joints[[bone.start for bone in bones]], joints[[bone.end for bone in bones]]], 1)
            apart = np.pad(ends, ((0, 0), (0, 1), (0, 0)), constant_values=np.nan).reshape(-1, 2)
            axes.plot(*apart.T, color=colour, linewidth=thick, solid_capstyle="round", zorder=2)
        for (mark, mark_size), indices in of_mark.items():
            axes.plot(
                *joints[indices].T, mark.shape, markerfacecolor=mark.face, markeredgecolor=mark.edge,
                markersize=mark_size, markeredgewidth=1.0, zorder=3,
            )  # fmt: skip
    taken: list[tuple[float, float, float]] = []
    for digit in motion.digits:
        x, y = views.joints[0][skeleton.points.index(f"{digit}_tip")]
        wide = style.width_mm(word(digit)) / 2 + 0.5
        y += 3.0
        while any(abs(x - at) < wide + reach and abs(y - height) < LINE_MM for at, height, reach in taken):
            y += 0.5
        if np.isfinite(x):
            taken.append((x, y, wide))
            axes.text(x, y, word(digit), ha="center", va="center", fontsize=SMALL_PT)
    turned = tr("from the thumb's side") if "thumb" in motion.digits else tr("from the side")
    for words, middle in zip((tr("from the back"), turned), views.middles, strict=True):
        axes.text(middle, -1.0, words, ha="center", va="top", color=SOFT, fontsize=SMALL_PT)
    bar = size[0] - _BAR_MM * scale - 1.0, size[0] - 1.0
    axes.plot(bar, [-6.5, -6.5], marker="|", color=SOFT, linewidth=0.8, markersize=4.0)
    words = f"{_BAR_MM:g} mm"
    axes.text(bar[0] - 1.0, -6.5, words, ha="right", va="center", color=SOFT, fontsize=SMALL_PT)
    if lines:
        axes.text(0.0, -_FOOT_MM, "\n".join(lines), ha="left", va="top", color=SOFT, fontsize=SMALL_PT)


class NoDataError(Exception):
    """Raised with the reason why a figure cannot be drawn, as a sentence without a full stop."""


@dataclass(frozen=True)
class Drawing:
    """A figure with its name in paths and its caption; missing : why it shows only a sentence, or empty."""

    name: str
    figure: Figure
    caption: str
    missing: str = ""


def draw_figure(name: str, draw: Callable[[], tuple[Figure, str]]) -> Drawing:
    """Draw a figure in the common style, or a figure that states why it cannot be drawn."""
    try:
        with style.apply_style():
            figure, caption = draw()
            lay_out(figure, style.label)
    except NoDataError as error:
        return not_drawn(name, str(error))
    except MemoryError:
        raise
    except Exception as error:  # other figures must not be lost to this one
        traceback.print_exc()
        return not_drawn(name, on_one_line(f"{type(error).__name__}: {error}"))
    text = N_("Drawn by {PROGRAM} {VERSION} with matplotlib {version}.")
    versions = tr(text, PROGRAM=PROGRAM, VERSION=VERSION, version=matplotlib.__version__)
    return Drawing(name, figure, punctuated(templates.plain(f"{caption} {versions}")))


def not_drawn(name: str, reason: str) -> Drawing:
    """Draw a figure that states why the figure `name` could not be drawn."""
    sentence = templates.plain(tr("Not drawn: {reason}.", reason=reason.rstrip(".")))
    with style.apply_style():
        lines = style.wrap_text(sentence, 52)
        figure = Figure(figsize=(ONE_COLUMN_MM / 25.4, (10.0 + 4.0 * len(lines)) / 25.4))
        figure.text(0.5, 0.5, "\n".join(lines), ha="center", va="center", fontsize=SMALL_PT)
    return Drawing(name, figure, sentence, sentence)


def save(folder: Path, drawing: Drawing) -> None:
    """Write NAME.svg, NAME.pdf and NAME.txt, each atomically. Raises InputError if that is impossible.

    Figures are drawn in memory first, so that a full disk is not reported by matplotlib.
    """
    for kind, date in (("svg", "Date"), ("pdf", "CreationDate")):
        written = io.BytesIO()
        with style.apply_style():
            drawing.figure.savefig(written, format=kind, metadata={date: None})
        with replacing(folder / f"{drawing.name}.{kind}") as temporary:
            temporary.write_bytes(written.getvalue())
    write_text(folder / f"{drawing.name}.txt", drawing.caption + "\n")


def study_text(results: StudyResults) -> str:
    """Return a sentence with the study's name, numbers of subjects and hands, and whether it is simulated."""
    return tr(
        "Study {name}: {kind}{subjects}, {hands}{each}.",
        name=results.name,
        kind=tr("simulated recordings of ") if results.simulated else "",
        subjects=ngettext("{n} subject", "{n} subjects", len(results.subjects)),
        hands=ngettext("{n} hand", "{n} hands", len(results.hands)),
        each=tr(" (each counted once per session)") if results.has_sessions else "",
    )


def count_range(counts: Iterable[int]) -> str:
    """Return the numbers of subjects or hands behind several marks as one number or a range."""
    low, high = min(counts := list(counts)), max(counts)
    return f"{low}" if low == high else f"{low}–{high}"
