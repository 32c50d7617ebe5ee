"""Same seed, same samples: however fast the bench runs, in whatever pieces data cross, and whatever is taken again."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from picoradar.drivers.clock import VirtualClock
from picoradar.drivers.links import UsbLink


def samples_of(radar: Any) -> np.ndarray:
    """Raw sums (lines, places, samples) of a scan over the hip, with its laser on."""
    radar.get_ready()
    lines = []
    radar.scan(lines.append)
    return np.stack([line.sums for line in lines])


@pytest.fixture
def plain(make_radar: Callable[..., Any]) -> np.ndarray:
    return samples_of(make_radar())


def test_another_seed_gives_other_samples(plain: np.ndarray, make_radar: Callable[..., Any]) -> None:
    assert not np.array_equal(plain, samples_of(make_radar({"": {"seed": 77}})))


def test_the_pace_of_the_bench_changes_nothing(plain: np.ndarray, make_radar: Callable[..., Any]) -> None:
    radar = make_radar()
    radar.sim.close()
    radar.clock = VirtualClock(speed=60.0)
    radar.__post_init__()
    np.testing.assert_array_equal(plain, samples_of(radar))


@pytest.mark.parametrize("read_bytes", [512, 1024, 5120])
def test_the_size_of_a_read_changes_nothing(
    plain: np.ndarray, make_radar: Callable[..., Any], read_bytes: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = UsbLink.read

    def in_pieces(link: UsbLink, endpoint: int, size: int, *, timeout_s: float) -> bytes:
        return whole(link, endpoint, min(size, read_bytes), timeout_s=timeout_s)

    monkeypatch.setattr(UsbLink, "read", in_pieces)
    np.testing.assert_array_equal(plain, samples_of(make_radar()))


def test_a_record_taken_again_changes_nothing(plain: np.ndarray, make_radar: Callable[..., Any]) -> None:
    radar = make_radar()
    sent = 0

    def spoil_some(frame: bytes) -> bytes | None:
        nonlocal sent
        sent += 1
        return None if sent % 5 == 0 else frame

    radar.sim.bridge.acquirer.queue.fault = spoil_some
    np.testing.assert_array_equal(plain, samples_of(radar))
    assert radar.bench.sampler.retried >= 2
