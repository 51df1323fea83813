"""The picture of a front: coverage and deviation over cameras, a line a projector."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from planning.model.front import Front, FrontPoint
from planning.model.words import count_words

from .panel import INK, PALE, font
from .picture_view import BACKGROUND, SUPERSAMPLING, Colour

# Told apart by lightness too, so that a grey print still does.
_LINES: tuple[Colour, ...] = (
    *((150, 190, 230), (230, 150, 40), (70, 130, 190), (190, 70, 60)),
    *((110, 90, 160), (60, 140, 90), (30, 60, 120), (70, 70, 76)),
)
_PALER = (214, 214, 220)
_PANEL, _HEIGHT, _HEAD = 460, 400, 58
_LEFT, _RIGHT, _TOP, _BOTTOM = 62, 64, 56, 52
# Lines of the grid, at least.
_TICKS = 4


@dataclass(frozen=True)
class _Chart:
    """A panel's title, what it shows of a point (None: nothing), and its range."""

    title: str
    value: Callable[[FrontPoint], float | None]
    top: float
    form: str
    limit: Callable[[FrontPoint], float] | None = None


def draw_front(front: Front) -> Image.Image:
    """Return the picture: filled dots are on the front, ringed ones meet what is asked.

    Ticks over the dots are what no candidates of these numbers exceed.
    """
    sigmas = [1e3 * (p.sigma_p95_m or 0.0) for p in front.points]
    charts = (
        _Chart(
            "measured, % of the target",
            lambda p: 100.0 * p.measured_m2 / front.area_m2,
            100.0,
            "{:.0f}",
            lambda p: 100.0 * front.at_most_share(p),
        ),
        _Chart(
            "standard deviation, 95 % within [mm]",
            lambda p: None if p.sigma_p95_m is None else 1e3 * p.sigma_p95_m,
            1.1 * max(sigmas),
            "{:.2f}",
        ),
    )
    unit = SUPERSAMPLING
    size = (len(charts) * _PANEL * unit, (_HEIGHT + _HEAD) * unit)
    picture = Image.new("RGB", size, BACKGROUND)
    draw = ImageDraw.Draw(picture)
    for k, chart in enumerate(charts):
        _Axes(draw, (k * _PANEL, _HEAD), front.points, chart).draw()
    _legend(draw, front.points)
    return picture.resize(
        (size[0] // unit, size[1] // unit), resample=Image.Resampling.BOX
    )


@dataclass(frozen=True, eq=False)
class _Axes:
    """One chart in its place of the picture, whose corner is in final pixels."""

    canvas: ImageDraw.ImageDraw
    corner: tuple[int, int]
    points: Sequence[FrontPoint]
    chart: _Chart

    def draw(self) -> None:
        """Draw grid, lines and dots."""
        most = max(p.cameras for p in self.points)
        for value in _ticks(self.chart.top):
            self._line((0.7, value), (most + 0.3, value), _PALER, 1.0)
            x, y = self._at(0.7, value)
            self._text((x - 8 * SUPERSAMPLING, y), self.chart.form.format(value), "rm")
        for cameras in range(1, most + 1):
            x, y = self._at(cameras, 0.0)
            self._text((x, y + 8 * SUPERSAMPLING), str(cameras), "mt")
        x, y = self._at(0.5 * (1 + most), 0.0)
        self._text((x, y + 26 * SUPERSAMPLING), "cameras", "mt", PALE)
        left, top = (SUPERSAMPLING * side for side in self.corner)
        spot = (left + _LEFT * SUPERSAMPLING, top + 0.55 * _TOP * SUPERSAMPLING)
        self._text(spot, self.chart.title, "lm", size=14.0)
        for projectors in sorted({p.projectors for p in self.points}):
            self._row([p for p in self.points if p.projectors == projectors])

    def _row(self, row: Sequence[FrontPoint]) -> None:
        colour = colour_of(row[0].projectors)
        shown = [(p, v) for p in row if (v := self.chart.value(p)) is not None]
        ends = [self._at(p.cameras, v) for p, v in shown]
        if not ends:
            return
        self.canvas.line(ends, fill=colour, width=2 * SUPERSAMPLING)
        for (point, _), (x, y) in zip(shown, ends, strict=True):
            if self.chart.limit is not None:
                _, cap = self._at(point.cameras, self.chart.limit(point))
                r = 6 * SUPERSAMPLING
                self.canvas.line(
                    [(x - r, cap), (x + r, cap)], fill=colour, width=SUPERSAMPLING
                )
            _dot(self.canvas, (x, y), colour, point)

    def _at(self, cameras: float, value: float) -> tuple[float, float]:
        most = max(p.cameras for p in self.points)
        across = (cameras - 0.7) / (most + 0.3 - 0.7)
        x = self.corner[0] + _LEFT + across * (_PANEL - _LEFT - _RIGHT)
        rise = value / self.chart.top
        y = self.corner[1] + _HEIGHT - _BOTTOM - rise * (_HEIGHT - _BOTTOM - _TOP)
        return SUPERSAMPLING * x, SUPERSAMPLING * y

    def _line(
        self,
        start: tuple[float, float],
        end: tuple[float, float],
        colour: Colour,
        width: float,
    ) -> None:
        ends = [self._at(*start), self._at(*end)]
        self.canvas.line(ends, fill=colour, width=round(width * SUPERSAMPLING))

    def _text(
        self,
        spot: tuple[float, float],
        text: str,
        anchor: str,
        colour: Colour = INK,
        size: float = 12.0,
    ) -> None:
        self.canvas.text(spot, text, colour, font=font(size), anchor=anchor)


def colour_of(projectors: int) -> Colour:
    """Return the colour of a number of projectors."""
    return _LINES[(projectors - 1) % len(_LINES)]


def _legend(canvas: ImageDraw.ImageDraw, points: Sequence[FrontPoint]) -> None:
    """Which colour is how many projectors, and what dots and ticks say."""
    unit, x = SUPERSAMPLING, _LEFT * SUPERSAMPLING
    for projectors in sorted({p.projectors for p in points}):
        text = count_words(projectors, "projector")
        canvas.line(
            [(x, 20 * unit), (x + 22 * unit, 20 * unit)],
            fill=colour_of(projectors),
            width=3 * unit,
        )
        x += 28 * unit
        canvas.text((x, 20 * unit), text, INK, font=font(12.0), anchor="lm")
        x += canvas.textlength(text, font=font(12.0)) + 18 * unit
    words = "filled: on the front    ringed: meets what is asked    ticks: at most"
    spot = (_LEFT * unit, 44 * unit)
    canvas.text(spot, words, PALE, font=font(12.0), anchor="lm")


def _dot(
    canvas: ImageDraw.ImageDraw,
    spot: tuple[float, float],
    colour: Colour,
    point: FrontPoint,
) -> None:
    def circle(radius: float, **how: object) -> None:
        r, (x, y) = radius * SUPERSAMPLING, spot
        canvas.ellipse((x - r, y - r, x + r, y + r), **how)  # type: ignore[arg-type]

    fill = colour if point.on_front else BACKGROUND
    circle(4.0, fill=fill, outline=colour, width=2 * SUPERSAMPLING)
    if point.meets:
        circle(7.5, outline=INK, width=round(1.5 * SUPERSAMPLING))


def _ticks(top: float) -> list[float]:
    """Round values from 0 to the top."""
    decade = 10.0 ** np.floor(np.log10(top))
    steps = [decade * s for s in (0.1, 0.2, 0.25, 0.5, 1.0)]
    step = max(s for s in steps if top / s >= _TICKS)
    return np.arange(0.0, top + 1e-9 * top, step).tolist()
