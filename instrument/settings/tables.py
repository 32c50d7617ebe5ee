"""The tables of the settings: every field with its unit in the name, its range and a sentence on what it means.

The commented settings file is written from these sentences (`to_toml`). The table ``[simulation]`` stays a plain dict
here, because the simulator checks it.
"""

from __future__ import annotations

import re
from typing import Annotated, Literal, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, field_validator, model_validator

from picoradar.drivers.interfaces import DRIVE_V, PRF_HZ
from picoradar.drivers.links import checked_address
from picoradar.instrument.settings.limits import MAX_DISTANCE, MIN_DISTANCE, max_drive_v

Method = Literal["half-maximum", "template"]
"""Estimators by name: how a trace becomes a range."""
METHODS: tuple[Method, ...] = get_args(Method)

USB_BACKENDS = ("picoradar.sim.usb.forward:backend",)
"""USB backends that settings may name, so that a file cannot run code of its choice; empty stands for libusb."""

RENAMED_BACKENDS = {"sim.usb.forward:backend": "picoradar.sim.usb.forward:backend"}
"""Old and new names of the USB backends in settings and recordings of version 0.1."""


class Section(BaseModel):
    """Base of all tables: unknown keys and implicit conversions are refused, values never change."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, strict=True)


def _allowed(address: str) -> str:
    return checked_address(address) if address else address


Port = Annotated[str, AfterValidator(_allowed)]
"""Serial port or URL; empty where there is none. One that reads or writes files (``spy://``) is refused."""


class Links(Section):
    """Where the devices are: serial ports by name or URL, USB devices by serial number."""

    dg645: Port = Field("", description="serial port or URL of the delay generator")
    dg645_baud: int = Field(9600, ge=4800, le=115200, description="its baud rate")
    genesys: Port = Field("", description="serial port or URL of the drive supply")
    genesys_baud: int = Field(9600, ge=1200, le=19200, description="its baud rate")
    genesys_address: int = Field(6, ge=0, le=30, description="its address")
    temperature: Literal["tec", "tc200"] = Field(
        "tec", description="temperature controller of the diode: tec (Meerstetter) or tc200 (Thorlabs, heats only)"
    )
    tec: Port = Field("", description="serial port or URL of the temperature controller TEC")
    tec_baud: int = Field(57600, ge=4800, le=1000000, description="its baud rate")
    tec_address: int = Field(1, ge=0, le=254, description="its address")
    tc200: Port = Field("", description="serial port or URL of the temperature controller TC200")
    tc200_baud: int = Field(115200, ge=9600, le=115200, description="its baud rate")
    bridge_serial: str = Field("", description="serial number of the sampling bridge; empty: the only one on the bus")
    sampler: Literal["bridge", "oscilloscope"] = Field(
        "bridge", description="device that takes the traces; with the oscilloscope the bridge is only the gate"
    )
    oscilloscope_serial: str = Field("", description="serial number of the oscilloscope; empty: the only one there")
    usb_backend: str = Field("", description="module:function that makes a pyusb backend; empty: libusb")
    usb_address: str = Field("", description="argument of that function")
    speed: float = Field(1.0, gt=0, le=50, description="pace of a served simulated bench; real devices run at 1")

    @field_validator("usb_backend", mode="before")
    @classmethod
    def _renamed(cls, name: object) -> object:
        return RENAMED_BACKENDS.get(name, name) if isinstance(name, str) else name

    @field_validator("usb_backend")
    @classmethod
    def _known_backend(cls, name: str) -> str:
        if name and name not in USB_BACKENDS:
            raise ValueError(
                f"not a backend of picoradar; give {' or '.join(USB_BACKENDS)}, or leave it empty for libusb"
            )
        return name

    @field_validator("usb_address")
    @classmethod
    def _host_and_port(cls, address: str) -> str:
        if address and not re.fullmatch(r"[\w.:\[\]-]+:[0-9]{1,5}", address):
            raise ValueError("not host:port; give what `picoradar sim` has printed")
        return address

    @model_validator(mode="after")
    def _real_devices_run_at_1(self) -> Links:
        if self.speed != 1.0 and not self.usb_backend:
            raise ValueError("speed is for the bench that `picoradar sim` serves; real devices run at speed 1")
        return self


class PulserSettings(Section):
    """Pulser of the laser diode."""

    prf_hz: float = Field(80_000.0, ge=PRF_HZ[0], le=PRF_HZ[1], description="pulse repetition frequency, Hz")
    drive_v: float = Field(290.0, ge=DRIVE_V[0], le=DRIVE_V[1], description="drive voltage, V")
    measured_output: tuple[tuple[float, float, float], ...] = Field(
        ((290.0, 80_000.0, 0.300), (330.0, 20_000.0, 0.103)),
        min_length=1,
        description="mean power measured at the exit: [drive V, rate Hz, mW], one entry a measurement",
    )
    output_margin: float = Field(
        1.2, ge=1, le=10, description="factor on the measured energy: uncertainty of the power meter, temperature"
    )

    @field_validator("measured_output", mode="before")
    @classmethod
    def _lists_are_tuples(cls, points: object) -> object:  # TOML and JSON have lists only
        if not isinstance(points, list):
            return points
        return tuple(tuple(point) if isinstance(point, list) else point for point in points)

    @field_validator("measured_output")
    @classmethod
    def _positive(cls, points: tuple[tuple[float, float, float], ...]) -> tuple[tuple[float, float, float], ...]:
        if not all(value > 0 for point in points for value in point):
            raise ValueError("drive voltage, rate and mean power of each measurement must be above 0")
        return points

    @model_validator(mode="after")
    def _no_overheating(self) -> PulserSettings:
        limit_v = max_drive_v(self.prf_hz)
        if self.drive_v > limit_v:
            raise ValueError(
                f"drive_v {self.drive_v:g} V overheats the transmitter at {self.prf_hz:g} Hz; at most {limit_v:.0f} V"
            )
        return self


class DiodeSettings(Section):
    """Temperature of the laser diode."""

    target_degc: float = Field(23.0, ge=17, le=25, description="target temperature, degC")
    warm_up_limit_s: float = Field(1800.0, ge=10, le=7200, description="longest warm-up before it counts as failed, s")
    settled_k: float = Field(
        0.004,
        gt=0,
        le=0.2,
        description="lines are taken once the diode, with the laser on, is this close to its target, K",
    )
    settle_limit_s: float = Field(
        60.0, ge=0, le=600, description="longest wait for that, s; afterwards the scan starts all the same, with a note"
    )


class SamplerSettings(Section):
    """How one trace is sampled."""

    start_ps: float = Field(6500.0, ge=0, le=100_000, description="first sampling instant after the trigger, ps")
    step_ps: float = Field(6.7, ge=1, le=100, description="step from shot to shot, ps (6.7 ps is 1 mm of range)")
    samples: int = Field(1430, ge=100, le=16384, description="samples in a sweep")
    reference_ps: float = Field(
        7400.0, ge=0, le=100_000, description="place of the reference pulse on the trace (+-1000 ps), ps"
    )
    settle_shots: int = Field(16, ge=0, le=1000, description="shots discarded before each sweep")


class ScannerSettings(Section):
    """Galvo scanner as the instrument drives it."""

    field_deg: float = Field(10.0, gt=0, le=40, description="full analogue span of the 4096 codes, optical degrees")
    settle_ms: float = Field(3.0, ge=0, le=1000, description="wait after a step within a line, ms")
    flyback_settle_ms: float = Field(25.0, ge=0, le=1000, description="wait after the step to a new line, ms")
    window_settle_ms: float = Field(
        1.2, ge=0, le=100, description="window mode: minimum time from a step to the first shot on the echo, ms"
    )
    window_flyback_ms: float = Field(12.0, ge=0, le=1000, description="window mode: wait after the step to a new line")
    window_settle_shots: int = Field(2, ge=0, le=1000, description="window mode: shots discarded before each sweep")
    zero_mark: bool = Field(
        True, description="measure the calibration's zero_mark, where it has one, at the beginning and end of each scan"
    )
    zero_hours: float = Field(
        12.0, gt=0, le=168, description="without a mark: hours for which `picoradar bench zero` checks the range zero"
    )


class ScanSettings(Section):
    """The raster and how each of its points is taken."""

    rows: int = Field(40, ge=1, le=1000, description="lines of the raster")
    columns: int = Field(40, ge=1, le=1000, description="points in a line")
    step_mm: float = Field(
        1.0, gt=0, le=20, description="distance of neighbouring points on the plane at distance_mm, mm"
    )
    distance_mm: float = Field(
        900.0,
        ge=MIN_DISTANCE.value,
        le=MAX_DISTANCE.value,
        description=f"distance of that plane, mm (below {MIN_DISTANCE.value:g} reference and echo overlap)",
    )
    averages: int = Field(8, ge=1, le=64, description="sweeps averaged into one record")
    mode: Literal["sweep", "window"] = Field(
        "sweep",
        description="sweep: the whole trace at every point; window: two short pieces, only the shots needed",
    )
    order: Literal["rows", "interlaced"] = Field(
        "rows", description="rows: from top to bottom; interlaced: every 16th line, then those between, coarse first"
    )
    estimator: Method = Field(
        "half-maximum", description="how a trace becomes a range (window mode always uses template)"
    )
    material: str = Field(
        "",
        pattern=r"^[a-z0-9 _-]{0,40}$",
        description="what is scanned, as measured by bench penetration (bone), or paint; empty: not known",
    )
    wanted_sd_mm: float = Field(0.22, gt=0, le=10, description="window mode: intended standard deviation of each range")
    keep_traces: bool = Field(True, description="keep the raw traces in the recording")


class Settings(Section):
    """Everything that a scan needs to know."""

    bench: Literal["simulated", "devices"] = Field(
        "simulated", description="simulated: everything in this process; devices: over [links]"
    )
    seed: int = Field(1, ge=0, lt=2**63, description="root seed of the simulated bench")
    calibration: str = Field("", description="calibration file; empty: the one that comes with the simulated bench")
    links: Links = Links()
    pulser: PulserSettings = PulserSettings()
    diode: DiodeSettings = DiodeSettings()
    sampler: SamplerSettings = SamplerSettings()
    scanner: ScannerSettings = ScannerSettings()
    scan: ScanSettings = ScanSettings()
    simulation: dict[str, object] = Field(default_factory=dict, description="parameters of the simulated bench")
