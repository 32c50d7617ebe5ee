"""Cramer-Rao-like floor of the pose error, with the inliers known and the true surface normals.

range floor: information sum J J^T / (sigma * max(|n.d|, clip))^2, i.e. every range is weighted rightly;
plain LS:    covariance of an unweighted point-to-plane least squares on the same inliers.
"""

import numpy as np
from scenes import SIGMA


def information(hit, nrm, dirs, sigma=SIGMA, clip=0.2):
    J = np.concatenate([nrm, np.cross(hit, nrm)], 1)  # shift at the cup centre, rotation about it
    s = sigma * np.maximum(np.abs(np.einsum("ij,ij->i", nrm, dirs)), clip)
    H = (J / s[:, None]).T @ (J / s[:, None])
    A = np.linalg.inv(J.T @ J)
    ls = A @ ((J * s[:, None]).T @ (J * s[:, None])) @ A
    return H, np.linalg.inv(H), ls


def tre_of(cov, targets, n=1000, seed=0):
    rng = np.random.default_rng(seed)
    xi = rng.multivariate_normal(np.zeros(6), cov, n)
    d = xi[:, None, :3] + np.cross(xi[:, None, 3:], targets[None])
    return np.linalg.norm(d, axis=2).max(1)


def scan_floor(scan, targets, sigma=SIGMA):
    k = scan["inlier"]
    _H, c, ls = information(scan["hit"][k], scan["normals"][k], scan["dirs"][k], sigma)
    t, tl = tre_of(c, targets), tre_of(ls, targets)
    return {
        "rot_deg": float(np.degrees(np.sqrt(np.trace(c[3:, 3:])))),
        "shift_mm": float(np.sqrt(np.trace(c[:3, :3]))),
        "tre_med": float(np.median(t)),
        "tre_p95": float(np.percentile(t, 95)),
        "tre_rms": float(np.sqrt((t**2).mean())),
        "ls_rot_deg": float(np.degrees(np.sqrt(np.trace(ls[3:, 3:])))),
        "ls_tre_med": float(np.median(tl)),
        "ls_tre_p95": float(np.percentile(tl, 95)),
    }
