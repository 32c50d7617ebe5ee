"""Other tools behind one call: ``prepare(vertices, faces)`` once a model, then ``method(points, start) -> 4x4``.

Local tools that have a distance gate get the same coarse-to-fine gates; none was tuned case by case.
"""

from __future__ import annotations

import numpy as np
from scenes import apply, pose

GATES_MM = (30.0, 10.0, 4.0, 1.5)
ITERATIONS = 30


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Area-weighted unit normals of the vertices."""
    cross = np.cross(vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]])
    out = np.zeros_like(vertices)
    for k in range(3):
        np.add.at(out, faces[:, k], cross)
    return out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-12)


class Picoradar:
    """This package; from any pose it ignores the start."""

    def __init__(self, from_anywhere: bool) -> None:
        self.from_anywhere = from_anywhere

    def prepare(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        from picoradar import registration

        self.register = registration.register
        self.model = registration.prepare_model(vertices, faces)
        _ = self.model.surface.tree

    def __call__(self, points: np.ndarray, start: np.ndarray) -> np.ndarray:
        return self.register(points, self.model, start="any" if self.from_anywhere else start).model_from_scanner


class Open3dIcp:
    """Open3D's ICP: point to point, or point to plane with a robust kernel, in stages of falling gates."""

    def __init__(self, kind: str, kernel: str | None = None, gates: tuple[float, ...] = GATES_MM) -> None:
        self.kind, self.kernel, self.gates = kind, kernel, gates

    def prepare(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        import open3d as o3d

        self.target = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(vertices))
        self.target.normals = o3d.utility.Vector3dVector(vertex_normals(vertices, faces))

    def refine(self, source: object, start: np.ndarray, gates: tuple[float, ...]) -> np.ndarray:
        import open3d as o3d

        reg = o3d.pipelines.registration
        solution = start
        for gate in gates:
            loss = {"tukey": reg.TukeyLoss(max(gate * 0.8, 1.2)), "gm": reg.GMLoss(max(gate * 0.25, 0.4))}
            if self.kind == "point":
                estimation = reg.TransformationEstimationPointToPoint(False)
            elif self.kernel:
                estimation = reg.TransformationEstimationPointToPlane(loss[self.kernel])
            else:
                estimation = reg.TransformationEstimationPointToPlane()
            criteria = reg.ICPConvergenceCriteria(1e-6, 1e-6, ITERATIONS)
            solution = reg.registration_icp(source, self.target, gate, solution, estimation, criteria).transformation
        return np.asarray(solution)

    def __call__(self, points: np.ndarray, start: np.ndarray) -> np.ndarray:
        import open3d as o3d

        return self.refine(o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points)), start, self.gates)


class Open3dFpfh:
    """Open3D's feature matching (FPFH with RANSAC), refined point to plane with Tukey's loss."""

    def __init__(self, voxel: float = 2.0) -> None:
        self.voxel, self.fine = voxel, Open3dIcp("plane", "tukey")

    def _features(self, cloud: object) -> object:
        import open3d as o3d

        search = o3d.geometry.KDTreeSearchParamHybrid(radius=self.voxel * 5, max_nn=100)
        return o3d.pipelines.registration.compute_fpfh_feature(cloud, search)

    def prepare(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.fine.prepare(vertices, faces)
        self.down = self.fine.target.voxel_down_sample(self.voxel)
        self.down.normalize_normals()
        self.features = self._features(self.down)

    def __call__(self, points: np.ndarray, _start: np.ndarray) -> np.ndarray:
        import open3d as o3d

        reg = o3d.pipelines.registration
        o3d.utility.random.seed(1)
        source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        down = source.voxel_down_sample(self.voxel)
        down.estimate_normals(o3d.geometry.KDTreeSearchParamHybrid(radius=self.voxel * 2.5, max_nn=30))
        down.orient_normals_towards_camera_location(np.zeros(3))
        reach = self.voxel * 1.5
        checks = [reg.CorrespondenceCheckerBasedOnEdgeLength(0.9), reg.CorrespondenceCheckerBasedOnDistance(reach)]
        found = reg.registration_ransac_based_on_feature_matching(
            down,
            self.down,
            self._features(down),
            self.features,
            True,
            reach,
            reg.TransformationEstimationPointToPoint(False),
            3,
            checks,
            reg.RANSACConvergenceCriteria(100000, 0.999),
        )
        return self.fine.refine(source, found.transformation, GATES_MM[1:])


class SmallGicp:
    """small_gicp's GICP in stages of falling gates."""

    def prepare(self, vertices: np.ndarray, _faces: np.ndarray) -> None:
        import small_gicp

        self.target, self.tree = small_gicp.preprocess_points(
            np.ascontiguousarray(vertices), downsampling_resolution=0.05, num_neighbors=12, num_threads=1
        )

    def __call__(self, points: np.ndarray, start: np.ndarray) -> np.ndarray:
        import small_gicp

        source, _ = small_gicp.preprocess_points(points, downsampling_resolution=0.05, num_neighbors=12, num_threads=1)
        solution = start
        for gate in GATES_MM:
            result = small_gicp.align(
                self.target,
                source,
                self.tree,
                solution,
                registration_type="GICP",
                max_correspondence_distance=gate,
                num_threads=1,
                max_iterations=ITERATIONS,
            )
            solution = result.T_target_source
        return np.asarray(solution)


class VtkIcp:
    """vtkIterativeClosestPointTransform, rigid, all points as landmarks; it has no outlier handling."""

    def prepare(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk

        self.mesh = vtk.vtkPolyData()
        places = vtk.vtkPoints()
        places.SetData(numpy_to_vtk(vertices, deep=True))
        self.mesh.SetPoints(places)
        cells = vtk.vtkCellArray()
        cells.SetData(3, numpy_to_vtk(faces.ravel().astype(np.int64), deep=True, array_type=vtk.VTK_ID_TYPE))
        self.mesh.SetPolys(cells)
        self.locator = vtk.vtkCellLocator()
        self.locator.SetDataSet(self.mesh)
        self.locator.BuildLocator()

    def __call__(self, points: np.ndarray, start: np.ndarray) -> np.ndarray:
        import vtk
        from vtk.util.numpy_support import numpy_to_vtk

        source = vtk.vtkPolyData()
        places = vtk.vtkPoints()
        places.SetData(numpy_to_vtk(apply(start, points), deep=True))
        source.SetPoints(places)
        icp = vtk.vtkIterativeClosestPointTransform()
        icp.SetSource(source)
        icp.SetTarget(self.mesh)
        icp.SetLocator(self.locator)
        icp.GetLandmarkTransform().SetModeToRigidBody()
        icp.SetMaximumNumberOfLandmarks(len(points))
        icp.SetMaximumNumberOfIterations(100)
        icp.CheckMeanDistanceOn()
        icp.SetMaximumMeanDistance(1e-4)
        icp.Update()
        matrix = icp.GetMatrix()
        return np.array([[matrix.GetElement(i, j) for j in range(4)] for i in range(4)]) @ start


class KissMatcher:
    """KISS-Matcher, refined point to plane with Tukey's loss."""

    def __init__(self, voxel: float = 1.5) -> None:
        self.voxel, self.fine = voxel, Open3dIcp("plane", "tukey")

    def prepare(self, vertices: np.ndarray, faces: np.ndarray) -> None:
        self.fine.prepare(vertices, faces)
        self.target = vertices.astype(np.float32)

    def __call__(self, points: np.ndarray, _start: np.ndarray) -> np.ndarray:
        import kiss_matcher
        import open3d as o3d

        matcher = kiss_matcher.KISSMatcher(kiss_matcher.KISSMatcherConfig(self.voxel))
        centre = points.mean(axis=0)
        found = matcher.estimate((points - centre).astype(np.float32), self.target)
        solution = pose(np.asarray(found.rotation, float), np.asarray(found.translation, float).ravel())
        source = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(points))
        return self.fine.refine(source, solution @ pose(np.eye(3), -centre), GATES_MM[1:])


LOCAL = {
    "picoradar, from the start": Picoradar(False),
    "Open3D point-to-plane, Tukey": Open3dIcp("plane", "tukey"),
    "Open3D point-to-plane, Geman-McClure": Open3dIcp("plane", "gm"),
    "Open3D point-to-point": Open3dIcp("point"),
    "small_gicp GICP": SmallGicp(),
    "VTK ICP": VtkIcp(),
}
GLOBAL = {
    "picoradar, from anywhere": Picoradar(True),
    "Open3D FPFH + RANSAC, then Tukey": Open3dFpfh(),
    "KISS-Matcher, then Tukey": KissMatcher(),
}
