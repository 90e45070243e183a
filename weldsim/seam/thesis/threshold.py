"""Threshold: the descriptor value that parts groove from plate, chosen from the cloud where the operator types none."""

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.seam.thesis.config import Descriptor

LEAST: dict[Descriptor, float] = {"code": 1e-10, "thesis": 1e-6}
"""Least threshold: the low end of what the published program's operator uses, and its like for the printed equations
(their descriptor goes with the square root of the code's). Without it a plain plate is cut in its own noise."""

FLOOR = 1e-6  # of the greatest value: below it the descriptor is rounding, not surface
BINS = 256


def choose(descriptor: Float[ndarray, "n"], kind: Descriptor) -> float:
    """Half the median descriptor of the points that Otsu's cut calls groove, at least `LEAST`.

    The thesis leaves the value to its operator, who looks at the region. Otsu's cut on the logarithm parts the plate from
    everything within two radii of the groove, a band wider than the search for the opposite edge reaches; half the
    median of that band keeps its bright core, about one radius beyond the lips.
    """
    top = float(np.percentile(descriptor, 99.9)) if len(descriptor) else 0.0
    if top <= 0.0:
        return LEAST[kind]
    logs = np.log10(np.clip(descriptor, FLOOR * top, top))
    above = logs > otsu(logs)
    return max(0.5 * float(np.median(descriptor[above])), LEAST[kind]) if above.any() else LEAST[kind]


def otsu(values: Float[ndarray, "n"]) -> float:
    """The cut with the greatest variance between the two classes (Otsu 1979), on a histogram of `BINS` bins."""
    counts, edges = np.histogram(values, BINS)
    middle = (edges[:-1] + edges[1:]) / 2
    low, moment = np.cumsum(counts)[:-1], np.cumsum(counts * middle)[:-1]
    high, rest = len(values) - low, float(counts @ middle) - moment
    between = np.where((low > 0) & (high > 0), low * high * (moment / np.maximum(low, 1) - rest / np.maximum(high, 1)) ** 2, -1.0)
    return float(edges[int(between.argmax()) + 1])
