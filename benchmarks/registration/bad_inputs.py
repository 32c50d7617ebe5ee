"""Inputs that cannot be registered, and what `register` says to them; writes docs/registration.md.

python benchmarks/registration/bad_inputs.py --seeds 10
python benchmarks/registration/bad_inputs.py --mesh z013_Hip_R.stl --mesh vhf_hip_bone_left_mm.stl   # more bones
"""

from __future__ import annotations

import argparse
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

os.environ.setdefault("OMP_NUM_THREADS", "1")
ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(Path(__file__).parent)]

import numpy as np  # noqa: E402 - threads must be limited first
import scenes  # noqa: E402
import synthetic_scans as synthetic  # noqa: E402
import trimesh  # noqa: E402
from marked import provenance, write_between_marks  # noqa: E402

from picoradar.registration import Model, RegistrationError, load_model, pose_error, prepare_model, register  # noqa: E402
from picoradar.sim.physics import HIP_FILE, SOCKET_AXIS, SOCKET_CENTRE_MM  # noqa: E402

NAME = "benchmarks/registration/bad_inputs.py"
UP = np.array([0.0, 0.0, 1.0])


class Bone:
    """A model with the place and opening of its socket."""

    def __init__(self, name: str, model: Model, centre: np.ndarray, axis: np.ndarray) -> None:
        self.name, self.model, self.centre, self.axis = name, model, centre, axis

    def mirrored(self) -> Bone:
        """The bone of the other side."""
        flip = np.array([-1.0, 1.0, 1.0])
        model = prepare_model(self.model.vertices * flip, self.model.faces[:, ::-1])
        return Bone(f"mirrored {self.name}", model, self.centre * flip, self.axis * flip)

    def shell(self, below_mm: float = 0.0) -> Bone:
        """What lies below the plane of the socket's centre by so much, cut out: an open model."""
        inside = (self.model.vertices - self.centre) @ self.axis < -below_mm
        near = np.linalg.norm(self.model.vertices - self.centre, axis=1) < 31.0
        model = prepare_model(self.model.vertices, self.model.faces[(inside & near)[self.model.faces].all(axis=1)])
        return Bone(f"shell of {self.name}", model, self.centre, self.axis)

    def scan(self, seed: int, tissue: float) -> synthetic.Synthetic:
        """A scan of the socket."""
        return synthetic.scan(self.model, self.centre, self.axis, seed, tissue=tissue)


def shipped() -> Bone:
    """The hip bone of the simulated bench."""
    return Bone("shipped hip", load_model(HIP_FILE), np.array(SOCKET_CENTRE_MM), np.array(SOCKET_AXIS))


def from_file(path: str) -> Bone:
    """A hip bone from a mesh in mm, in the frame of its socket."""
    vertices, faces, _ = scenes.load_real(path)
    return Bone(Path(path).stem, prepare_model(vertices, faces), np.zeros(3), UP)


def body(mesh: trimesh.Trimesh) -> Model:
    return prepare_model(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def plane(size: float = 120.0) -> Model:
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) * size / 2
    return prepare_model(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def bowl(radius: float = 25.5) -> Model:
    """The inside of half a sphere."""
    sphere = trimesh.creation.icosphere(subdivisions=4, radius=radius)
    low = np.asarray(sphere.triangles_center)[:, 2] < 0.0
    return prepare_model(np.asarray(sphere.vertices), np.asarray(sphere.faces)[low][:, ::-1])


Case = tuple[str, Callable[[int], tuple[np.ndarray, Model, np.ndarray | None]]]
"""A name, and what makes points, model and, where there is one, the true pose, from a seed."""


def single_cases(bone: Bone) -> Iterator[Case]:
    """Inputs that are wrong in themselves, with one bone."""
    name = bone.name

    def points(seed: int) -> np.ndarray:
        return bone.scan(seed, 0.3).points

    def nan(seed: int) -> np.ndarray:
        p = points(seed)
        p[seed % len(p), seed % 3] = np.nan
        return p

    def blob(seed: int) -> np.ndarray:
        return np.random.default_rng(seed).normal(0.0, 20.0, (1500, 3)) + [0.0, 0.0, 900.0]

    def board(seed: int) -> np.ndarray:
        return synthetic.scan(plane(400.0), np.zeros(3), UP, seed, tissue=0.0).points

    def ball(seed: int) -> np.ndarray:
        sphere = body(trimesh.creation.icosphere(subdivisions=5, radius=25.5))
        return synthetic.scan(sphere, np.zeros(3), UP, seed, tissue=0.0).points

    def cup(seed: int) -> np.ndarray:
        return synthetic.scan(bowl(), np.zeros(3), UP, seed, tissue=0.0).points

    def few(count: int) -> Callable[[int], np.ndarray]:
        return lambda seed: points(seed)[np.random.default_rng(seed).permutation(1000)[:count]]

    makers: dict[str, Callable[[int], np.ndarray]] = {
        "no points": lambda _: np.zeros((0, 3)),
        "a NaN among the points": nan,
        "5 points": few(5),
        "12 points": few(12),
        "points on one line": lambda seed: np.outer(np.arange(900.0, 930.0), points(seed)[0] / 900.0),
        "points in metres": lambda seed: points(seed) / 1000.0,
        "a cloud of nothing (random)": blob,
        "a scan of a board": board,
        "a scan of a ball, socket's size": ball,
        "a scan of a smooth cup, socket's size": cup,
    }
    for what, make in makers.items():
        yield f"{what}, model {name}", lambda seed, make=make: (make(seed), bone.model, None)

    def metres(seed: int) -> tuple[np.ndarray, Model, None]:
        return points(seed), prepare_model(bone.model.vertices / 1000.0, bone.model.faces), None

    yield f"model in metres, {name}", metres


def featureless_cases() -> Iterator[Case]:
    """Scans of bodies whose pose is not unique."""
    bodies = {
        "ball as the model": body(trimesh.creation.icosphere(subdivisions=4, radius=26.0)),
        "half ball, hollow, as the model": bowl(26.0),
        "plane as the model": plane(),
        "cylinder as the model": body(trimesh.creation.cylinder(radius=20.0, height=120.0, sections=96)),
    }
    for name, model in bodies.items():
        axis = np.array([1.0, 0.0, 0.0]) if "cylinder" in name else UP

        def make(seed: int, model: Model = model, axis: np.ndarray = axis) -> tuple[np.ndarray, Model, np.ndarray]:
            found = synthetic.scan(model, np.zeros(3), axis, seed, tissue=0.0)
            return found.points, model, found.truth

        yield name, make


def symmetric_cases() -> Iterator[Case]:
    """A body that turns onto itself, from any side: whatever pose is found, others are as good."""
    box = body(trimesh.creation.box((40.0, 30.0, 20.0)))

    def make(seed: int) -> tuple[np.ndarray, Model, None]:
        axis = np.random.default_rng(seed).normal(size=3)
        found = synthetic.scan(box, np.zeros(3), axis / np.linalg.norm(axis), seed, tissue=0.0, noise_mm=0.2)
        return found.points, box, None

    yield "box of 40 x 30 x 20 mm from any side", make


def crossed_cases(bones: list[Bone], femurs: list[tuple[str, Model]]) -> Iterator[Case]:
    """The scan of one bone and the model of another."""
    mirrored = [bone.mirrored() for bone in bones]
    everyone = [*bones, *mirrored, *(bone.shell() for bone in mirrored)]
    for scanned in bones:
        for other in everyone:
            if other is not scanned:
                yield (
                    f"scan of {scanned.name}, model {other.name}",
                    lambda seed, a=scanned, b=other: (a.scan(seed, 0.3).points, b.model, None),
                )
        for name, femur in femurs:
            yield (
                f"scan of {scanned.name}, model {name}",
                lambda seed, a=scanned, m=femur: (a.scan(seed, 0.3).points, m, None),
            )


def right_cases(bones: list[Bone]) -> Iterator[Case]:
    """The right bone, for comparison: the verdict must not be bought by refusing everything."""
    for bone in bones:
        for model in (bone, bone.shell()):

            def make(seed: int, bone: Bone = bone, given: Model = model.model) -> tuple[np.ndarray, Model, np.ndarray]:
                found = bone.scan(seed, 0.3)
                return found.points, given, found.truth

            yield f"the right bone, {model.name}", make


def judged(case: Case, seeds: int) -> tuple[Counter[str], str, int]:
    """How often what was said, a typical sentence, and the passes with a wrong pose (all, where none is right)."""
    said: Counter[str] = Counter()
    words: Counter[str] = Counter()
    wrong = 0
    for seed in range(seeds):
        try:
            points, model, truth = case[1](seed)
            found = register(points, model, range_bias_mm=0.1)
        except RegistrationError as error:
            said["refused"] += 1
            words[str(error).partition(":")[0]] += 1
            continue
        said[found.verdict] += 1
        words[found.reasons[0].partition(":")[0]] += 1
        if found.verdict == "pass":
            right = False
            if truth is not None:
                error = pose_error(found.model_from_scanner, truth, found.centre)
                right = error.rotation_deg < 1.0 and error.translation_mm < 1.0
            wrong += not right
    return said, words.most_common(1)[0][0], wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--mesh", action="append", default=[], help="another hip bone in mm; may be repeated")
    parser.add_argument("--femur", action="append", default=[], help="a model that is no hip bone")
    parser.add_argument("--write", action="store_true")
    options = parser.parse_args()
    bones = [shipped(), *(from_file(path) for path in options.mesh)]
    femurs = [(Path(path).stem, load_model(path)) for path in options.femur]
    cases = [*single_cases(bones[0]), *featureless_cases(), *symmetric_cases()]
    cases += [*crossed_cases(bones, femurs), *right_cases(bones)]
    columns = ("refused", "fail", "caution", "pass")
    lines = ["| input | " + " | ".join(columns) + " | passed wrongly | most often said |", "|---" * 7 + "|"]
    for case in cases:
        said, words, wrong = judged(case, options.seeds)
        lines.append(f"| {case[0]} | " + " | ".join(str(said[c]) for c in columns) + f" | {wrong} | {words} |")
        print(lines[-1], flush=True)
    if options.write:
        write_between_marks("registration.md", NAME, [f"{provenance()} {options.seeds} seeds each.", "", *lines])


if __name__ == "__main__":
    main()
