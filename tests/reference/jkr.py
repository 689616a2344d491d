"""Points of the JKR curve, and the fit behind `sand.contact.jkr.POLYNOMIAL`.

The table was computed from F/Fc = 4(x³ − x^1.5), δ/δc = 6^(1/3)(2x² − (4/3)√x) and
U/(Fcδc) = 4·6^(1/3)[(4/5)x⁵ − (4/3)x^3.5 + (1/3)x²], x = a/a0, by two independent programs.
Print the coefficients again:  python -m tests.reference.jkr
"""

import numpy as np

# x = a/a0, F/Fc, δ/δc, U/(Fcδc) (None: not tabulated)
TABLE = (
    (6.0 ** (-2 / 3), -5 / 9, -1.0, 4 / 45),  # break
    (2.0 ** (-2 / 3), -1.0, -0.480750, -0.384600),  # force minimum
    ((2 / 3) ** (2 / 3), -8 / 9, 0.0, -0.846614),  # first contact
    (1.0, 0.0, 1.211414, -1.453696),  # equilibrium
    (1.47867319, 5.74001609, 5.0, None),
    (3.88221404, 203.44746371, 50.0, None),
)
E_BREAK, E_CYCLE = 1.542585, 0.935503  # in Fc δc


def root_by_bisection(overlap: np.ndarray) -> np.ndarray:
    """y = √(a/a0) at overlaps δ/δc ≥ −1, by bisection in extended precision."""
    d = np.asarray(overlap, np.longdouble)
    third = np.longdouble(1) / 3
    low = np.full(d.shape, np.longdouble(6) ** -third)
    high = np.full(d.shape, np.longdouble(10))
    for _ in range(80):
        middle = (low + high) / 2
        right = np.longdouble(6) ** third * (2 * middle**4 - 4 * third * middle) > d
        low, high = np.where(right, low, middle), np.where(right, middle, high)
    return (low + high) / 2


def fitted_polynomial(degree: int = 10, reach: float = 3.5, nodes: int = 400) -> np.ndarray:
    """Coefficients of p(s), y = y_m + s p(s), low order first: least squares on Chebyshev nodes."""
    s = 0.5 * reach * (1 - np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes))
    y = root_by_bisection(s.astype(np.longdouble) ** 2 - 1)
    p = ((y - np.longdouble(6) ** (-np.longdouble(1) / 3)) / s).astype(float)
    fit = np.polynomial.chebyshev.Chebyshev.fit(s, p, degree, domain=[0, reach])
    return fit.convert(kind=np.polynomial.Polynomial).coef


if __name__ == "__main__":
    print("\n".join(map(repr, fitted_polynomial().tolist())))
