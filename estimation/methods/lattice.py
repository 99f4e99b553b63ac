"""Find the minimum of a positive definite quadratic function over the integer points of a box.

The quadratic function is

    q(i, j) = a i^2 + 2 b i j + c j^2 + 2 g i + 2 h j,

and the box is the rectangle 0 <= i <= i_last, 0 <= j <= j_last. The multi-estimator uses these
functions. It selects one pair (damping, stiffness) from a grid of candidates. The grid is the box:
i and j are the indices of the candidate values of damping and stiffness. Up to a constant, q is the
weighted sum of the squared force errors, which is minimised over the grid.

The computing time does not depend on the size of the box. The search has three steps:

1. A Lagrange-Gauss reduced basis (u, w) of the integer points is computed. u is the integer vector,
   other than zero, for which the quadratic part of q is smallest. Each integer point is
   s w + m u with integers s and m. All points with the same s are on a line, which is called a row.
2. The minimum is first computed without the limits of the box. The point of the minimum over all
   real (i, j) is between two rows. The best integer point is on one of these two rows. If this
   integer point is in the box, it is the result.
3. Otherwise, the real point on the border of the box where q is smallest is computed. It is between
   two rows. A first search starts at one of these two rows and continues with decreasing s. A
   second search starts at the other row and continues with increasing s. In each row, the integer
   point in the box with the smallest q is found. The minimum of q over the real points of the row
   in the box is also computed. A search ends when this minimum is not smaller than q at the best
   integer point found so far. It also ends when a row has no point in the box.

All functions use only scalars, so that both the Python interpreter and numba can run them.

References: P. Q. Nguyen, D. Stehle, "Low-dimensional lattice basis reduction revisited", ACM
Trans. Algorithms 5(4), 2009 (reduction); U. Fincke, M. Pohst, Math. Comp. 44, 1985 (search).
"""

from __future__ import annotations

from math import ceil, floor, inf


def least_in_box(
    a: float, b: float, c: float, g: float, h: float, i_last: int, j_last: int
) -> tuple[int, int]:
    """Return the integers (i, j) with 0 <= i <= i_last, 0 <= j <= j_last for which q is smallest.

    The function is q(i, j) = a i^2 + 2 b i j + c j^2 + 2 g i + 2 h j. Its quadratic part must be
    positive definite.
    """
    ui, uj, wi, wj = 1, 0, 0, 1
    uu, uw, ww = a, b, c
    if ww < uu:
        ui, uj, wi, wj = 0, 1, 1, 0
        uu, ww = c, a
    while True:
        multiple = uw / uu + 0.5
        if 0.0 <= multiple < 1.0:
            break
        m = floor(multiple)
        wi -= m * ui
        wj -= m * uj
        uw = a * ui * wi + b * (ui * wj + uj * wi) + c * uj * wj
        ww = a * wi * wi + 2.0 * b * wi * wj + c * wj * wj
        if ww >= uu:
            break
        ui, uj, wi, wj = wi, wj, ui, uj
        uu, ww = ww, uu
    gu = g * ui + h * uj
    gw = g * wi + h * wj

    s = floor((uw * gu - uu * gw) / (uu * ww - uw * uw))
    slope = gu + s * uw
    m = floor(0.5 - slope / uu)
    q = s * (s * ww + 2.0 * gw) + m * (m * uu + 2.0 * slope)
    t = s + 1
    slope = gu + t * uw
    n = floor(0.5 - slope / uu)
    if t * (t * ww + 2.0 * gw) + n * (n * uu + 2.0 * slope) < q:
        s, m = t, n
    i = s * wi + m * ui
    j = s * wj + m * uj
    if 0 <= i <= i_last and 0 <= j <= j_last:
        return i, j

    i_low, j_low = lowest_on_border(a, b, c, g, h, i_last, j_last)
    centre = floor((ui * j_low - uj * i_low) * (ui * wj - uj * wi))
    best = inf
    i = j = 0
    for side in range(2):
        s = centre + side
        while True:
            q = s * (s * ww + 2.0 * gw)
            slope = gu + s * uw
            low, high = inside(s * wi, ui, i_last, s * wj, uj, j_last)
            lowest = min(max(-slope / uu, low), high)
            if low > high or q + lowest * (lowest * uu + 2.0 * slope) >= best:
                break
            first, last = ceil(low), floor(high)
            m = min(max(floor(lowest + 0.5), first), last)
            q += m * (m * uu + 2.0 * slope)
            if first <= last and q < best:
                best = q
                i = s * wi + m * ui
                j = s * wj + m * uj
            s += 2 * side - 1
    return i, j


def lowest_on_border(
    a: float, b: float, c: float, g: float, h: float, i_last: int, j_last: int
) -> tuple[float, float]:
    """Return the real numbers (i, j) on the border of a rectangle for which q is smallest.

    The rectangle is 0 <= i <= i_last, 0 <= j <= j_last. The function is
    q(i, j) = a i^2 + 2 b i j + c j^2 + 2 g i + 2 h j.
    """
    least = inf
    i_least = j_least = 0.0
    for side in range(4):
        if side < 2:
            i = float(side * i_last)
            j = min(max(-(h + b * i) / c, 0.0), float(j_last))
        else:
            j = float((side - 2) * j_last)
            i = min(max(-(g + b * j) / a, 0.0), float(i_last))
        q = i * (i * a + 2.0 * (j * b + g)) + j * (j * c + 2.0 * h)
        if q < least:
            least, i_least, j_least = q, i, j
    return i_least, j_least


def inside(
    i: int, i_step: int, i_last: int, j: int, j_step: int, j_last: int
) -> tuple[float, float]:
    """Return the range (low, high) of m in which a line is inside a rectangle.

    The points of the line are (i + m i_step, j + m j_step), with real m. The rectangle has the
    corners (0, 0) and (i_last, j_last). If no point of the line is in the rectangle, low > high.
    """
    low, high = -inf, inf
    for start, step, last in ((i, i_step, i_last), (j, j_step, j_last)):
        if step > 0:
            low, high = max(low, -start / step), min(high, (last - start) / step)
        elif step < 0:
            low, high = max(low, (last - start) / step), min(high, -start / step)
        elif start < 0 or start > last:
            return 1.0, 0.0
    return low, high
