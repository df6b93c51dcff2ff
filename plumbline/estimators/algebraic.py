r"""Algebraic identification of the piecewise-affine law (Vidal, Soatto, Ma, Sastry 2003, CDC, pp. 167-172; GPCA).

Every frame z = (p, x, x', 1) lies on one of the planes :math:`b_i' z = 0`, hence on their union, the hybrid decoupling polynomial

.. math:: P(z) = \prod_{i=1}^{3} (b_i' z) = h' \nu_3(z) = 0 .

h is the null vector of the Veronese matrix of all frames (last right singular vector). In the published form the gradient of P at a
frame of plane i is parallel to b_i; the frames are those with the least :math:`|P|/|\nabla P|`, the second and third divided by their
distance to the planes already found. Each frame goes to the nearest plane (the regime, too: the method knows no regions), and
least squares per piece takes the place of b_i.

Noise-free it is exact. The full embedding has 20 monomials and breaks down under noise: with white noise of the ZMP alone it finds k1
to 0.5 % up to 0.2 mm (k1 2.204) or 0.5 mm (k1 4.038); at 1 mm the error is 4 to 9 %, and with 3 mm of feedback noise beside it 16 to
19 %, the limits unfound or millimetres off.

Two of the planes are known to be p = constant (`known_slopes`, the default). Then no monomial is of more than first degree in (x, x'),
10 are left, and P factors in closed form into :math:`q(p)\,(p - c - k_1 x - k_2 \dot x)`: the limits are the roots of q. This serves at
3 mm of feedback noise. Gradients at single frames would not: the polynomial is good, but in 3 of 10 subjects with limits of -0.06 and
0.15 m two frames of the same plane are chosen.
"""

import itertools

import numpy as np

from plumbline.estimators.pieces import Array, Labels, Law, Pieces, Regimes, answer, named, padded, thinned

PIECES = 3
FLAT = 0.1  # [1] of the largest gradient; where it is smaller two planes meet and their gradients mix


def estimate(x: Array, v: Array, p: Array, length: Labels, rate: float, *, seed: int = 0, known_slopes: bool = True) -> Pieces:
    """The law's pieces by the algebraic method; `own` is the last singular value over the one before [1].

    It is 0 for three planes without noise; where it is large h is not unique: fewer planes, or noise as large as what tells them apart.

    x [m], v [m/s], p [m]: CoM, its velocity, measured ZMP, (n, m), padded after length (m,).  rate [Hz] and seed are not used:
    nothing is random, frames are thinned over the plane (`pieces.thinned`).  known_slopes: False for the full embedding of degree 3.
    Raises ValueError with fewer than 50 frames.
    """
    frames = thinned(x, v, p, length)
    z = np.column_stack([frames.p / frames.p.std(), frames.unit[:, 1:], np.ones(len(frames.p))])
    powers = exponents(known_slopes)
    _, values, rows = np.linalg.svd(veronese(z, powers), full_matrices=False)
    planes = _factors(powers, rows[-1]) if known_slopes else _gradients(z, powers, rows[-1])
    law = named(frames, np.abs(z @ planes.T).argmin(1))
    regime = padded(_nearest(law, x, v, p), length)
    return answer(law, regime, 1, float(values[-1] / values[-2]))


def exponents(known_slopes: bool) -> Labels:
    """Exponents of the monomials of degree 3 in (p, x, x', 1), (20, 4); (10, 4) of at most first degree in (x, x')."""
    every = [e for e in itertools.product(range(PIECES + 1), repeat=4) if sum(e) == PIECES]
    return np.array([e for e in every if not known_slopes or e[1] + e[2] <= 1])


def veronese(z: Array, powers: Labels) -> Array:
    """Monomials of z (n, 4), shape (n, len(powers))."""
    return np.asarray(np.prod(z[:, None, :] ** powers, axis=2))


def _gradient(z: Array, powers: Labels, h: Array) -> Array:
    """Gradient of h' nu(z) at each frame, (n, 4)."""
    out = np.empty(z.shape)
    for j in range(z.shape[1]):
        lower = powers.copy()
        lower[:, j] = np.maximum(lower[:, j] - 1, 0)
        out[:, j] = veronese(z, lower) @ (powers[:, j] * h)
    return out


def _gradients(z: Array, powers: Labels, h: Array) -> Array:
    """b (3, 4) with b[:, 0] = 1: gradients at the frames nearest to one plane and far from those found before."""
    gradient = _gradient(z, powers, h)
    size = np.linalg.norm(gradient[:, :3], axis=1)
    distance = np.abs(veronese(z, powers) @ h) / np.maximum(size, np.finfo(float).tiny)
    usable = (size > FLAT * size.max()) & (np.abs(gradient[:, 0]) > 1e-3 * size)
    floor = 1e-6  # [1] keeps 0/0 finite where there is no noise
    planes, others = [], np.ones(len(z))
    for i in range(PIECES):
        score = (distance + floor) / (others + floor) if i else distance
        at = int(np.where(usable, score, np.inf).argmin())
        b = gradient[at] / gradient[at, 0]
        planes.append(b)
        others = others * np.abs(z @ b) / np.linalg.norm(b[:3])
    return np.array(planes)


def _factors(powers: Labels, h: Array) -> Array:
    """b (3, 4) of q(p) (p - c - k1 x - k2 x'): q from its copies before x and x', then the law by least squares over all of h."""
    of_x, of_v = (h[powers[:, j] == 1][::-1] for j in (1, 2))  # p^2, p, 1, as `exponents` sorts them
    of_p = h[powers[:, 1] + powers[:, 2] == 0][::-1]  # p^3, p^2, p, 1
    q = np.linalg.svd(np.stack([of_x, of_v]))[2][0]
    scale, constant = np.linalg.lstsq(np.column_stack([np.append(q, 0.0), -np.append(0.0, q)]), of_p, rcond=None)[0]
    law = np.array([scale, of_x @ q, of_v @ q, -constant]) / scale
    roots = np.real(np.roots(q))  # a conjugate pair, where no frame is at a limit, is one plane twice
    return np.vstack([law, *([1.0, 0.0, 0.0, -root] for root in roots)])


def _nearest(law: Law, x: Array, v: Array, p: Array) -> Regimes:
    """The piece whose ZMP is nearest to the measured one."""
    c, k1, k2 = law.theta
    error = np.abs(np.stack([p - law.left, p - c - k1 * x - k2 * v, p - law.right]))
    return np.asarray(np.where(np.isnan(error), np.inf, error).argmin(0) - 1).astype(np.int8)
