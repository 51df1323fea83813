"""The bar in the picture: each term as wide as its share of the variance."""

import numpy as np
import pytest
from PIL import Image, ImageDraw

from planning.model.document.coverage_records import PredictedSigma
from planning.report.drawing.error_bar import draw_error_bar
from planning.report.drawing.picture_view import SUPERSAMPLING

TERMS = {"edges": 1e-4, "camera": 2e-4, "projector": 2e-4}
WIDTH = 900 * SUPERSAMPLING


def bottom_row(terms, width=WIDTH):
    sigma = PredictedSigma(median_m=1e-4, p95_m=2e-4, terms_rms_m=terms)
    picture = Image.new("RGB", (width, 60 * SUPERSAMPLING), (255, 255, 255))
    draw_error_bar(ImageDraw.Draw(picture), sigma, (0, 0, width, picture.height - 1))
    colours, counts = np.unique(np.array(picture)[-1], axis=0, return_counts=True)
    return dict(zip(map(tuple, colours.tolist()), counts.tolist(), strict=True))


def test_terms_are_as_wide_as_their_shares():
    widths = sorted(count / WIDTH for count in bottom_row(TERMS).values())
    assert widths == pytest.approx([1 / 9, 4 / 9, 4 / 9], abs=2e-3)


@pytest.mark.parametrize(("terms", "width"), [({}, WIDTH), (TERMS, 200)])
def test_nothing_is_drawn_without_terms_or_room(terms, width):
    assert set(bottom_row(terms, width)) == {(255, 255, 255)}
