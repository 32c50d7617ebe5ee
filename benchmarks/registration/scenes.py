"""Seeded inputs of the registration benchmark: a bone, its models and simulated scans of it. All in millimetres.

Model frame: cup centre at the origin, cup axis along +z (the socket opens towards +z), inferior notch towards -y.
Scanner frame: scanner at the origin, optical axis along +z.
"""

from __future__ import annotations

import numpy as np

CUP_RADIUS = 26.0
CASES = {
    # points, outlier share, highest outlier, raster step, window
    "A": {"n": 4283, "outlier": 0.05, "top": 4.8, "step": 1.0, "window": "wide"},
    "B": {"n": 1474, "outlier": 0.42, "top": 9.3, "step": 1.05, "window": "socket"},
    "C": {"n": 10000, "outlier": 0.42, "top": 9.3, "step": 1.05 * np.sqrt(1474 / 10000), "window": "socket"},
    # as B, but the tissue sits anywhere in the socket, not by preference in the fossa and on the rim
    "D": {"n": 1474, "outlier": 0.42, "top": 9.3, "step": 1.05, "window": "socket", "anywhere": True},
    # most of what is seen is tissue
    "E": {"n": 1474, "outlier": 0.60, "top": 9.3, "step": 1.05, "window": "socket"},
    # as E, but seven tenths of it
    "F": {"n": 1474, "outlier": 0.70, "top": 9.3, "step": 1.05, "window": "socket"},
}
INITS = {
    # rotation (deg), shift (mm), exact magnitude or "up to"
    "4deg10mm": {"rot": 4.0, "shift": 10.0, "exact": True},
    "7deg30mm": {"rot": 7.0, "shift": 30.0, "exact": True},
    "le15deg": {"rot": 15.0, "shift": 30.0, "exact": False},
    "le30deg": {"rot": 30.0, "shift": 30.0, "exact": False},
    "le45deg": {"rot": 45.0, "shift": 30.0, "exact": False},
    "le60deg": {"rot": 60.0, "shift": 30.0, "exact": False},
    "any": None,
}
SIGMA = 0.40  # rms of one averaged-8 range value, mm
COVERAGE = 0.71


# ---------------------------------------------------------------- rigid maths
def hat(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]], float)


def rot_exp(w):
    a = np.linalg.norm(w)
    if a < 1e-12:
        return np.eye(3) + hat(w)
    k = hat(np.asarray(w) / a)
    return np.eye(3) + np.sin(a) * k + (1 - np.cos(a)) * (k @ k)


def pose(R, t):
    T = np.eye(4)
    T[:3, :3] = R
    T[:3, 3] = t
    return T


def inv(T):
    R = T[:3, :3].T
    return pose(R, -R @ T[:3, 3])


def apply(T, p):
    return p @ T[:3, :3].T + T[:3, 3]


def random_unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def random_rotation(rng):
    q = rng.normal(size=4)
    q /= np.linalg.norm(q)
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


# ------------------------------------------------------------- implicit bone
def _smooth(a, b, x):
    t = np.clip((x - a) / (b - a), 0, 1)
    return t * t * (3 - 2 * t)


def _smin(a, b, k):
    h = np.clip(0.5 + 0.5 * (b - a) / k, 0, 1)
    return b + (a - b) * h - k * h * (1 - h)


def _smax(a, b, k):
    return -_smin(-a, -b, k)


def _ellipsoid(x, y, z, c, s):
    u, v, w = (x - c[0]) / s[0], (y - c[1]) / s[1], (z - c[2]) / s[2]
    k0 = np.sqrt(u * u + v * v + w * w) + 1e-9
    k1 = np.sqrt((u / s[0]) ** 2 + (v / s[1]) ** 2 + (w / s[2]) ** 2) + 1e-9
    return k0 * (k0 - 1) / k1


def bone_implicit(x, y, z):
    """Negative inside bone."""
    deg = np.degrees
    r = np.sqrt(x * x + y * y + z * z) + 1e-9
    rho = np.hypot(x, y) + 1e-9
    phi = np.arctan2(y, x)
    theta = deg(np.arccos(np.clip(-z / r, -1, 1)))  # 0 at the cup's pole
    dphi = np.abs(deg(np.arctan2(np.sin(phi + np.pi / 2), np.cos(phi + np.pi / 2))))
    tilt = np.radians(20.0)
    fd = np.array([0.08, -np.sin(tilt), -np.cos(tilt)])
    fd /= np.linalg.norm(fd)
    ang = deg(np.arccos(np.clip((x * fd[0] + y * fd[1] + z * fd[2]) / r, -1, 1)))
    ang = ang * (1 + 0.10 * np.cos(3 * phi + 0.6))
    m_fossa = 1 - _smooth(29, 36, ang)
    m_notch = (1 - _smooth(17, 25, dphi)) * _smooth(22, 34, theta)
    m = np.maximum(m_fossa, 0.85 * m_notch)
    rough = (np.sin(0.9 * x + 0.3 * y) * np.sin(0.8 * y - 0.4 * z + 1.0) + np.sin(0.6 * z + 0.7 * x + 2.0)) * 0.18
    aspher = (
        0.25 * np.cos(2 * phi + 0.4) * np.sin(np.radians(theta)) ** 2
        + 0.15 * np.cos(3 * phi + 1.1) * np.sin(np.radians(theta)) ** 3
    )
    R = CUP_RADIUS + 3.6 * m + m * rough + aspher
    cavity = np.where(z < 0, r - R, rho * 0.966 - z * 0.26 - R * 0.966)
    h = (
        -2.3
        + 1.6 * np.cos(2 * phi + 0.5)
        + 1.0 * np.cos(3 * phi - 0.8)
        + 0.6 * np.cos(5 * phi + 2.0)
        - 7.0 * (1 - _smooth(18, 32, dphi))
    )
    cut = (z - h + 0.30 * np.maximum(rho - 29, 0)) * 0.95
    wall = _ellipsoid(x, y, z, (0, 0, -14.0), (35.5, 35.5, 22.5))
    wall = _smax(wall, cut, 3.0)
    ilium = _ellipsoid(x, y, z, (6, 52, -20), (24, 34, 8.5))
    ilium = ilium + 0.6 * np.sin(0.11 * x + 0.09 * y)
    ischium = _ellipsoid(x, y, z, (14, -44, -25), (14, 24, 13))
    pubis = _ellipsoid(x, y, z, (-44, -20, -22), (27, 10, 9))
    body = wall
    for b, k in ((ilium, 9.0), (ischium, 7.0), (pubis, 7.0)):
        body = _smin(body, b, k)
    return _smax(body, -cavity, 1.6)


def contoured(
    values: np.ndarray, first: np.ndarray, spacing_mm: tuple[float, ...], level: float
) -> tuple[np.ndarray, np.ndarray]:
    """Surface (V, 3), (F, 3) where values (X, Y, Z) cross a level: the largest piece."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    image = vtk.vtkImageData()
    image.SetDimensions(*values.shape)
    image.SetOrigin(*first)
    image.SetSpacing(*spacing_mm)
    image.GetPointData().SetScalars(numpy_to_vtk(values.ravel(order="F"), deep=True))
    contour = vtk.vtkFlyingEdges3D()
    contour.SetInputData(image)
    contour.SetValue(0, level)
    contour.ComputeNormalsOff()
    largest = vtk.vtkPolyDataConnectivityFilter()
    largest.SetInputConnection(contour.GetOutputPort())
    largest.SetExtractionModeToLargestRegion()
    clean = vtk.vtkCleanPolyData()
    clean.SetInputConnection(largest.GetOutputPort())
    clean.Update()
    found = clean.GetOutput()
    vertices = vtk_to_numpy(found.GetPoints().GetData()).astype(float)
    return vertices, vtk_to_numpy(found.GetPolys().GetConnectivityArray()).reshape(-1, 3).astype(np.int64)


def reference_mesh(h=0.8):
    """Fine mesh that stands for the real bone (rays are cast on this one)."""
    lo, hi = np.array([-76.0, -74.0, -44.0]), np.array([44.0, 92.0, 8.0])
    n = np.ceil((hi - lo) / h).astype(int) + 1
    ax = [lo[i] + h * np.arange(n[i]) for i in range(3)]
    z, y, x = np.meshgrid(ax[2], ax[1], ax[0], indexing="ij")
    f = bone_implicit(x, y, z)
    return orient_outward(*contoured(f.transpose(2, 1, 0), lo, (h, h, h), 0.0))


def orient_outward(V, F):
    a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    if np.einsum("ij,ij->", a, np.cross(b, c)) < 0:
        F = F[:, ::-1].copy()
    return V, F


def decimate(V, F, faces):
    import fast_simplification

    v, f = fast_simplification.simplify(V.astype(np.float32), F.astype(np.int32), target_count=int(faces))
    return orient_outward(v.astype(float), f.astype(np.int64))


def visible_shell(V, F, max_tilt=25.0):
    """Faces that a scanner in front of the socket can see at all (a model preparation step)."""
    import open3d as o3d

    a, b, c = V[F[:, 0]], V[F[:, 1]], V[F[:, 2]]
    n = np.cross(b - a, c - a)
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    o = (a + b + c) / 3 + n * 1e-3
    sc = Scene(V, F).scene
    vis = np.zeros(len(F), bool)
    for tilt in (0.0, max_tilt / 2, max_tilt):
        for az in [0.0] if tilt == 0 else np.radians(np.arange(0, 360, 45)):
            t = np.radians(tilt)
            d = np.array([np.sin(t) * np.cos(az), np.sin(t) * np.sin(az), np.cos(t)])
            rays = np.concatenate([o, np.broadcast_to(d, o.shape)], 1).astype(np.float32)
            hit = sc.cast_rays(o3d.core.Tensor(rays), nthreads=1)["t_hit"].numpy()
            vis |= np.isinf(hit) & (n @ d > 0.02)
    u, i = np.unique(F[vis], return_inverse=True)
    return V[u], i.reshape(-1, 3).astype(np.int64)


def load_real(path):
    """A real hip bone: moved so that the socket's centre is the origin and it opens towards +z.
    Returns V, F, socket radius."""
    import trimesh

    m = trimesh.load(path, process=True)
    m = max(m.split(only_watertight=False), key=lambda x: len(x.faces))
    V, F = np.array(m.vertices, float), np.array(m.faces, np.int64)
    return socket_frame(V * 1000 if (V.max(0) - V.min(0)).max() < 1.0 else V, F)


def socket_frame(V, F):
    """A closed bone in mm, moved so that the centre of the sphere that its socket is most like is the origin and it
    opens towards +z. Returns V, F, radius."""
    V, F = orient_outward(V, F)
    N = np.zeros_like(V)
    fn = np.cross(V[F[:, 1]] - V[F[:, 0]], V[F[:, 2]] - V[F[:, 0]])
    for k in range(3):
        np.add.at(N, F[:, k], fn)
    N /= np.linalg.norm(N, axis=1, keepdims=True) + 1e-12
    rng = np.random.default_rng(0)
    best = (-1,)
    near = np.arange(len(V))
    for turn in range(6000):  # sphere from two surface points and their normals
        i = rng.integers(len(V))
        if turn % 20 == 0:
            near = np.flatnonzero(np.linalg.norm(V - V[i], axis=1) < 40)
        i, j = rng.choice(near, 2, replace=False)
        A = np.stack([N[i], -N[j]], 1)
        ab = np.linalg.lstsq(A, V[j] - V[i], rcond=None)[0]
        c = (V[i] + ab[0] * N[i] + V[j] + ab[1] * N[j]) / 2
        rad = (ab[0] + ab[1]) / 2
        if not 19 < rad < 29 or abs(ab[0] - ab[1]) > 2:
            continue
        d = V - c
        r = np.linalg.norm(d, axis=1)
        ok = (np.abs(r - rad) < 0.8) & (np.einsum("ij,ij->i", d, N) < -0.9 * r)
        if ok.sum() > best[0]:
            best = (ok.sum(), c, ok)
    ok = best[2]
    for _ in range(10):
        x = np.linalg.lstsq(np.column_stack([2 * V[ok], np.ones(ok.sum())]), (V[ok] ** 2).sum(1), rcond=None)[0]
        c, rad = x[:3], np.sqrt(x[3] + x[:3] @ x[:3])
        d = V - c
        r = np.linalg.norm(d, axis=1)
        ok = (np.abs(r - rad) < 1.0) & (np.einsum("ij,ij->i", d, N) < -0.9 * r)
    z = -(d[ok] / r[ok, None]).mean(0)
    z /= np.linalg.norm(z)
    x = np.cross([0.2, 0.9, 0.3], z)
    x /= np.linalg.norm(x)
    return d @ np.stack([x, np.cross(z, x), z], 1), F, float(rad)


def crop(V, F, radius):
    keep = (np.linalg.norm(V, axis=1) < radius)[F].all(1)
    u, i = np.unique(F[keep], return_inverse=True)
    return V[u], i.reshape(-1, 3).astype(np.int64)


def cup_points(V, n=600, seed=5, scale=1.0):
    """Target points of the TRE: vertices of the socket surface, rim included."""
    full, V = V, V / scale
    r = np.linalg.norm(V, axis=1)
    rho = np.hypot(V[:, 0], V[:, 1])
    sel = np.flatnonzero((r < 30.8) & (rho < 28) & (V[:, 2] < 1.5) & (V[:, 2] > -30.5))
    rng = np.random.default_rng(seed)
    return full[rng.choice(sel, min(n, len(sel)), replace=False)]


# --------------------------------------------------------------------- scans
class Scene:
    def __init__(self, V, F):
        import open3d as o3d

        self.o3d = o3d
        self.scene = o3d.t.geometry.RaycastingScene(nthreads=1)
        self.scene.add_triangles(o3d.core.Tensor(V.astype(np.float32)), o3d.core.Tensor(F.astype(np.uint32)))

    def cast(self, origin, dirs):
        rays = np.concatenate([np.broadcast_to(origin, dirs.shape), dirs], 1).astype(np.float32)
        a = self.scene.cast_rays(self.o3d.core.Tensor(rays), nthreads=1)
        return a["t_hit"].numpy().astype(float), a["primitive_normals"].numpy().astype(float)


def make_scan(scene, case, seed, sigma=SIGMA, scale=1.0):
    """One simulated measurement. Returns points (scanner frame), true pose
    (scanner -> model), inlier mask, ray directions and normals (model frame)."""
    c = dict(CASES[case])
    c["step"] *= scale
    rng = np.random.default_rng([seed, ord(case)])
    dist = rng.uniform(850, 900)
    tilt, az, roll = np.radians(rng.uniform(0, 18)), rng.uniform(0, 2 * np.pi), rng.uniform(0, 2 * np.pi)
    back = np.array([np.sin(tilt) * np.cos(az), np.sin(tilt) * np.sin(az), np.cos(tilt)])  # cup -> scanner
    zax = -back
    xax = np.cross([0.3, 1.0, 0.2], zax)
    xax /= np.linalg.norm(xax)
    yax = np.cross(zax, xax)
    R = np.stack([xax, yax, zax], 1)
    R = R @ rot_exp(np.array([0, 0, roll]))
    aim = rng.uniform(-2, 2, 3) * [1, 1, 0]  # aiming error on the target
    T = pose(R, aim + back * dist)  # scanner -> model
    half = scale * (46.0 if c["window"] == "wide" else 33.0)
    m = int(half / c["step"])
    g = np.arange(-m, m + 1) * c["step"] / dist  # tangent of the mirror angles
    gx, gy = np.meshgrid(g, g)
    d = np.stack([gx.ravel(), gy.ravel(), np.ones(gx.size)], 1)
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    dm = d @ R.T
    t, nrm = scene.cast(T[:3, 3], dm)
    ok = np.isfinite(t)
    d, dm, t, nrm = d[ok], dm[ok], t[ok], nrm[ok]
    nrm = nrm / np.linalg.norm(nrm, axis=1, keepdims=True)
    hit = T[:3, 3] + dm * t[:, None]
    centre_s = apply(inv(T), np.zeros((1, 3)))[0]
    lateral = (d * t[:, None])[:, :2] - centre_s[:2]
    lat = np.linalg.norm(lateral, axis=1)
    if c["window"] == "wide":
        keep = np.argsort(lat, kind="stable")[: c["n"]]
    else:  # socket disc, part of it missing
        disc = np.argsort(lat, kind="stable")[: round(c["n"] / COVERAGE)]
        a = rng.uniform(0, 2 * np.pi)
        s = lateral[disc] @ [np.cos(a), np.sin(a)]
        s = s + 1.5 * np.sin(lateral[disc] @ [-np.sin(a), np.cos(a)] * 0.25)
        keep = disc[np.argsort(s, kind="stable")[: c["n"]]]
    d, dm, t, nrm, hit = d[keep], dm[keep], t[keep], nrm[keep], hit[keep]
    # soft tissue: clumps in the fossa, on the rim and a few anywhere, on the scanner's side only
    want = round(c["outlier"] * len(t))
    r = np.linalg.norm(hit, axis=1)
    rho = np.hypot(hit[:, 0], hit[:, 1])
    w_seed = 0.15 + 2.0 * ((r > 27.8 * scale) & (hit[:, 2] < -8)) + 1.5 * (rho > 23.5 * scale)
    if c.get("anywhere"):
        w_seed = np.ones(len(t))
    height = np.zeros(len(t))
    while (height > 0).sum() < want:
        p = hit[rng.choice(len(t), p=w_seed / w_seed.sum())]
        big = c["outlier"] > 0.2
        w = rng.uniform(3.0, 8.0) if big else rng.uniform(1.5, 4.0)
        top = rng.uniform(2.0, c["top"])
        q = np.linalg.norm(hit - p, axis=1) / w
        bump = np.where(q < 1, 1.0 + (top - 1.0) * np.clip(1 - q * q, 0, 1) ** 0.7, 0)
        new = np.maximum(height, bump)
        over = (new > 0).sum() - want
        if over > 0:  # trim the last clump's edge to hit the share
            fresh = np.flatnonzero((new > 0) & (height == 0))
            new[fresh[np.argsort(-q[fresh], kind="stable")[:over]]] = 0
        height = new
    rng_noise = rng.normal(0, sigma, len(t))
    pts = d * (t - height + rng_noise)[:, None]
    return {"points": pts, "T": T, "inlier": height == 0, "dirs": dm, "normals": nrm, "hit": hit, "height": height}


def make_init(T_true, init, seed, points):
    spec = INITS[init]
    rng = np.random.default_rng([seed, list(INITS).index(init), 77])
    if spec is None:
        c = points.mean(0)
        R = random_rotation(rng)
        return pose(R, rng.uniform(-30, 30, 3) - R @ c)
    a = spec["rot"] if spec["exact"] else rng.uniform(0, spec["rot"])
    s = spec["shift"] if spec["exact"] else rng.uniform(0, spec["shift"])
    P = pose(rot_exp(random_unit(rng) * np.radians(a)), random_unit(rng) * s)
    return P @ T_true


def errors(T_est, T_true, targets):
    """Rotation error (deg), shift of the cup centre (mm), largest shift over the cup (mm)."""
    E = T_est @ inv(T_true)
    R = E[:3, :3]
    ang = np.degrees(
        np.arctan2(np.linalg.norm([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]), np.trace(R) - 1)
    )
    tre = np.linalg.norm(apply(E, targets) - targets, axis=1).max()
    return float(ang), float(np.linalg.norm(E[:3, 3])), float(tre)
