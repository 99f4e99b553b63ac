"""Find the minimum of a positive definite quadratic function over the integer points of a box.

The multi-estimator uses these functions. Its grid is the box, and its monitoring signal, up to a
constant, is the quadratic function

    q(i, j) = a i^2 + 2 b i j + c j^2 + 2 g i + 2 h j,    0 <= i <= i_last, 0 <= j <= j_last.

The computing time does not depend on the size of the box. The search has three steps:

1. A Lagrange-Gauss reduced basis (u, w) of the integer points is computed. u is the integer vector,
   other than zero, for which the quadratic part of q is smallest. All integer points are on rows
   parallel to u.
2. The minimum is first computed without the limits of the box. The point of the minimum over all
   real (i, j) is between two rows. The best integer point is on one of these two rows. If this
   integer point is in the box, it is the result.
3. Otherwise, rows are searched one after the other, in both directions. The search starts at the
   two rows next to the point on the border of the box where q is smallest. For each row, the
   minimum of q over the real points in the box is computed. In each direction, the search ends when
   this minimum is not smaller than q at the best integer point found so far, or when a row has no
   point in the box.

All functions use only scalars, so that both the Python interpreter and numba can run them.

References: P. Q. Nguyen, D. Stehle, "Low-dimensional lattice basis reduction revisited", ACM
Trans. Algorithms 5(4), 2009 (reduction); U. Fincke, M. Pohst, Math. Comp. 44, 1985 (search).
"""

from __future__ import annotations

from math import ceil, floor, inf


def least_in_box(
    a: float, b: float, c: float, g: float, h: float, i_last: int, j_last: int
) -> tuple[int, int]:
    """Return the pair of integers (i, j) in the box for which q(i, j) is smallest.

    a, b, c, g and h are the coefficients of q; `i_last` and `j_last` are the upper limits of the
    box.
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
    """Return the pair of real numbers (i, j) on the border of the box for which q is smallest."""
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
    """Return the range (low, high) of real m for which (i + m i_step, j + m j_step) is in the box.

    If there is no such m, low > high.
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
