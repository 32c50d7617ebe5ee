"""What `picoradar register` reads beside cloud and model: landmarks, targets, regions, a start."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from picoradar.drivers.errors import parse_json, read_text
from picoradar.instrument.errors import BadInput
from picoradar.instrument.events import JsonObject

if TYPE_CHECKING:
    from picoradar.registration import ErrorBudget


def read_list(path: Path | None, option: str) -> list[JsonObject] | None:
    """Read a JSON file that holds a list of objects.

    Raises
    ------
    BadInput
        With file and finding.
    """
    if path is None:
        return None
    content = _read_json(path, option)
    if not isinstance(content, list) or not all(isinstance(entry, dict) for entry in content):
        raise BadInput(f"{option} {path}: a JSON list of objects is needed; see picoradar register --help")
    return content


def read_targets(path: Path | None) -> list[JsonObject] | None:
    """Read the places where the error matters; what is wrong with them is said before the registration begins.

    Raises
    ------
    BadInput
        With file and finding.
    """
    from picoradar.registration import check_targets

    return _read_checked(path, "--targets", check_targets)


def read_regions(path: Path | None) -> list[JsonObject] | None:
    """Read the regions of the model that take no part; refused like `read_targets`."""
    from picoradar.registration.refine import excluded_regions

    return _read_checked(path, "--exclude", excluded_regions)


def read_budget(path: Path | None) -> ErrorBudget | None:
    """Read the error budget: a JSON object of standard deviations; refused like `read_targets`."""
    from picoradar.registration import ErrorBudget

    if path is None:
        return None
    content = _read_json(path, "--budget")
    _refused_in(f"--budget {path}", ErrorBudget.from_mapping, content)
    return ErrorBudget.from_mapping(content)


def _read_checked(path: Path | None, option: str, check: Callable[[Any], object]) -> list[JsonObject] | None:
    entries = read_list(path, option)
    _refused_in(f"{option} {path}", check, entries)
    return entries


def _refused_in(where: str, check: Callable[[Any], object], content: object) -> None:
    """Let the registration check what was read; what it refuses is said with option and file."""
    from picoradar.registration import RegistrationError

    try:
        check(content)
    except RegistrationError as error:
        raise BadInput(f"{where}: {error}") from error


def read_start(start: str, landmarks: Path | None) -> Any:
    """Turn ``--start`` and ``--landmarks`` into what `registration.register` takes.

    Raises
    ------
    BadInput
        When they contradict each other or a file does not hold what it should.
    """
    from picoradar.registration import Cone, Landmarks

    pairs = read_list(landmarks, "--landmarks")
    if pairs is not None:
        _refused_in(f"--landmarks {landmarks}", Landmarks.from_pairs, pairs)
    if pairs is not None and start in ("any", "landmarks"):
        return pairs
    if start == "any":
        return "any"
    if start == "landmarks":
        raise BadInput("--start landmarks: no landmarks given; add --landmarks FILE")
    if pairs is not None:
        raise BadInput("--start FILE and --landmarks FILE exclude each other; give one of them")
    pose = _read_json(Path(start), "--start")
    if isinstance(pose, dict) and "towards" in pose:
        _refused_in(f"--start {start}", Cone.from_mapping, pose)
        return pose
    if isinstance(pose, dict):
        pose = pose.get("model_from_scanner")
    if not (isinstance(pose, list) and len(pose) == 4 and all(isinstance(row, list) and len(row) == 4 for row in pose)):
        raise BadInput(
            f"--start {start}: neither a 4x4 matrix nor a cone of directions in it; give rows [[..4 numbers..], ...], "
            'a result of register, or {"towards": [x, y, z], "half_angle_deg": a}'
        )
    return pose


def _read_json(path: Path, option: str) -> Any:
    try:
        return parse_json(read_text(path))
    except OSError as error:
        raise BadInput(f"{option} {path}: cannot be read: {error}") from error
    except ValueError as error:
        raise BadInput(f"{option} {path}: not valid JSON: {error}") from error
