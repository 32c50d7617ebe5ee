"""Settings: each says what it is, each is heard, and those of another method are refused."""

from __future__ import annotations

import ast
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from picoradar import registration
from picoradar.registration import PreparationSettings, RobustSettings
from picoradar.registration import settings as room

NO_SENTENCE = {"stages", "patient_stages", "near_stages", "patch_stages"}
"""Their values have it."""


def test_every_setting_has_a_sentence() -> None:
    missing = []
    for path in Path(str(room.__file__)).parent.glob("*.py"):
        for group in (node for node in ast.parse(path.read_text()).body if isinstance(node, ast.ClassDef)):
            for one, following in zip(group.body, [*group.body[1:], None], strict=True):
                if not isinstance(one, ast.AnnAssign) or not isinstance(one.target, ast.Name):
                    continue
                nested = "Settings" in ast.unparse(one.annotation)
                said = isinstance(following, ast.Expr) and isinstance(following.value, ast.Constant)
                if not said and not nested and one.target.id not in NO_SENTENCE:
                    missing.append(f"{group.name}.{one.target.id}")
    assert missing == []


def test_register_hears_its_settings(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 4)
    usual = registration.register(scan.points, socket, start=scan.truth, range_bias_mm=0.1)
    strict = RobustSettings(trust=replace(RobustSettings().trust, rotation_sds=1000.0))
    narrow = RobustSettings(beam_fit=replace(RobustSettings().beam_fit, max_residual_sigma=1.0))
    assert usual.verdict == "pass"
    assert (
        registration.register(scan.points, socket, start=scan.truth, settings=strict, range_bias_mm=0.1).verdict
        == "fail"
    )
    fewer = registration.register(
        scan.points, socket, start=scan.truth, settings=narrow, range_bias_mm=0.1
    ).inliers.mean()
    assert fewer < 0.8 < usual.inliers.mean()


def test_settings_of_the_other_method_are_refused(socket: registration.Model, scan_of: Callable[..., Any]) -> None:
    scan = scan_of(socket, 4, n=12)
    with pytest.raises(registration.RegistrationError, match="takes RobustSettings"):
        registration.register(scan.points, socket, settings=registration.DissertationSettings(), range_bias_mm=0.1)
    with pytest.raises(registration.RegistrationError, match="takes DissertationSettings"):
        registration.register(
            scan.points, socket, start=scan.truth, method="dissertation", settings=RobustSettings(), range_bias_mm=0.1
        )


def test_a_model_prepared_otherwise_is_another_model(socket: registration.Model) -> None:
    """Neither is taken for the other when it comes back from the disk."""
    coarse = PreparationSettings(view=replace(PreparationSettings().view, field_step_mm=2.0))
    for _ in range(2):
        usual = registration.prepare_model(socket.vertices, socket.faces)
        other = registration.prepare_model(socket.vertices, socket.faces, settings=coarse)
        assert usual.views[0].fine.step_mm == 1.0
        assert other.views[0].fine.step_mm == 2.0
        assert other.settings == coarse
        np.testing.assert_allclose(other.views[0].centre, usual.views[0].centre, atol=1e-9)
