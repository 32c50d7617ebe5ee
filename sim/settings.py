"""`SimulationSettings`: every physical parameter of the simulated bench, the ``[simulation]`` table of a settings file.

The defaults are the dissertation's radar (sections 2.3 to 2.6). What it does not state is chosen to reproduce its
measured figures; ``docs/physics.md`` says which is which.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from picoradar.sim.worlds import WORLDS

Pose = tuple[float, float, float, float, float, float]
Share = Annotated[float, Field(ge=0, le=1)]
SampleMaterial = Literal["bone", "cancellous", "cartilage", "fat", "muscle"]
TARGETS = "hip, prism, gray, plate, step, sphere, coated (half of it painted), or a mesh file in mm"


class SimulationSettings(BaseModel):
    """Parameters of laser, receiver, sampler, scanner, scene and diode block; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    world: Literal["dissertation", "clinic"] = Field(
        "dissertation", description="Set of values for what is not written here; clinic: with hum, 1/f, speckle, dither"
    )

    # Scene
    target: str = Field("hip", min_length=1, description=TARGETS)
    target_pose: Pose | None = Field(
        None, description="Target in the scanner frame: x, y, z (mm), turns about x, y, z (deg); none: by seed"
    )
    distance_mm: float = Field(900.0, ge=100, le=1500, description="Distance of the target along the beam at rest")
    reflectance: float | None = Field(
        None, gt=0, le=1, description="Diffuse reflectance at 904 nm of the whole target; none: the target's own"
    )

    zero_mark_mm: float = Field(675.0, ge=0, le=1500, description="Range of the mark in the field's corner; 0: no mark")
    zero_mark_deg: tuple[float, float] = Field(
        (4.3, 4.3), description="Place of that mark: true optical angles of the beam that meets its middle"
    )
    zero_mark_side_mm: float = Field(10.0, gt=0, le=100, description="Side of the square plate that it is")

    spot_diameter_mm: float = Field(1.0, ge=0, le=10, description="Spot on the target (1/e^2); 0: one ray a beam")
    surgical: bool = Field(False, description="Hip as in surgery: wet bone, fat pad, clot of 2 x 2 mm, two retractors")
    tissue_share: float = Field(
        0.0, ge=0, le=0.8, description="Share of the socket under tissue, torn strands and blood"
    )
    motion_mm: float = Field(0.0, ge=0, le=20, description="Amplitude of the target's slow motion along the beam")
    motion_period_s: float = Field(4.0, gt=0, le=1000, description="Period of that motion (breathing)")
    background_nw: float = Field(20.0, ge=0, le=1e6, description="Steady light on the photodiode")

    # Light in tissue
    tissue_light: bool = Field(False, description="Light enters bone, tissue and paint and comes back later")
    receiver_view_mm: float = Field(3.0, ge=0.5, le=50, description="Radius of the disc that the receiver sees")
    surface_share: tuple[Share, Share] = Field(
        (0.0, 0.4), description="Least and largest share of the echo of moist tissue that its surface reflects at once"
    )
    surface_patch_mm: float = Field(2.0, ge=0.1, le=100, description="Size of a place with one such share")
    tissue_sample: int = Field(0, ge=0, le=2**31, description="Number of the sample of tissue; 0: typical tissue")
    tissue_spread: float = Field(0.2, ge=0, le=0.5, description="Relative deviation of scattering between samples")
    sample_material: SampleMaterial = Field("bone", description="Material of the target coated")
    coat_mm: float = Field(0.1, ge=0.05, le=1, description="Thickness of the paint on the target coated")

    # Pulser and laser diode
    storage_capacitance_pf: float = Field(205.0, gt=0, le=5000, description="Capacitor discharged through the diode")
    current_rise_ns: float = Field(2.39, gt=0, le=50, description="Rise time of the current at 290 V, 23 degC, 80 kHz")
    current_shortening_per_k: float = Field(0.0158, ge=0, le=0.1, description="Shortening of the current by warmth")
    current_delay_ns_per_w: float = Field(0.193, ge=0, le=10, description="Delay of the current by the pulser's power")
    current_noise: float = Field(0.004, ge=0, le=0.05, description="Shot-to-shot relative deviation of the current")
    emission_delay_ps: float = Field(4500.0, ge=0, le=20000, description="Trigger to spike at 290 V, 23 degC, 80 kHz")
    gathering_delay_ps: float = Field(2400.0, ge=0, le=20000, description="Share of it that falls as 1/current")
    delay_ps_per_k: float = Field(60.0, ge=0, le=1000, description="Later emission of a warmer diode")
    junction_k_per_w: float = Field(0.25, ge=0, le=20, description="Junction over block by the pulser's power")
    free_inversion: float = Field(3.0, gt=1, le=20, description="Inversion over threshold at 290 V, 23 degC, unclamped")
    clamped_inversion: float = Field(
        1.42, gt=1, le=5, description="Inversion over threshold that the normal mode allows"
    )
    inversion_offset_v: float = Field(71.0, ge=0, le=200, description="Voltage at which no inversion would be left")
    suppression_v: float = Field(
        277.0, ge=200, le=350, description="Voltage that half suppresses the normal mode, 23 degC"
    )
    suppression_v_per_k: float = Field(1.0, ge=0, le=20, description="How much less of it a warmer diode needs")
    suppression_width_v: float = Field(2.4, gt=0, le=20, description="Width of that transition")
    gathering_offset_k: float = Field(5.0, gt=0, le=20, description="How far below 23 degC no carriers gather")
    gathering_k: float = Field(2.5, gt=0, le=20, description="Warming that gathers most of the rest")
    efficiency_offset_k: float = Field(
        5.0, ge=0, le=20, description="How far below 23 degC warmth begins to cost power"
    )
    efficiency_fall_k: float = Field(7.6, gt=0, le=100, description="Warming from there that leaves 1/e of the power")
    photon_power_w: float = Field(143.1, gt=0, le=5000, description="Power scale of the spike")
    photon_lifetime_ps: float = Field(8.1, gt=0, le=100, description="Photon lifetime in the cavity")
    spike_floor_ps: float = Field(36.0, ge=0, le=100, description="Width of the spike at unlimited inversion")
    misfire_v: float = Field(234.0, ge=0, le=300, description="Voltage at which half the shots miss the spike")
    normal_peak_w: float = Field(2.3, gt=0, le=50, description="Peak power of the normal mode at 240 V")
    normal_fwhm_ps: float = Field(637.0, gt=0, le=2000, description="Width of the pulse of the normal mode")
    pulser_heat_share: float = Field(0.3, ge=0, le=1, description="Share of the pulser's power that heats the block")
    recovery_limit_w: float = Field(
        1.476, gt=0, le=100, description="Pulser power above which it overheats (300 V, 80 kHz)"
    )
    overheating_factor: float = Field(5.0, ge=0, le=50, description="Heat in the block per power above that limit")

    # Optical paths
    exit_transmission: float = Field(0.62, gt=0, le=1, description="Share of the laser pulse that leaves the scanner")
    transmitter_path_mm: float = Field(60.0, ge=0, le=500, description="Optical path from the diode to mirror 1")
    reference_path_mm: float = Field(1031.4, ge=100, le=3000, description="Optical length of the reference fibre")
    reference_response_mv: float = Field(45.0, gt=0, le=100, description="Reference pulse at 290 V and 23 degC")

    # Receiver
    aperture_diameter_mm: float = Field(10.0, gt=0, le=50, description="Aperture that collects the echo")
    receiver_transmission: float = Field(0.431, gt=0, le=1, description="Share of collected light that arrives")
    responsivity_a_per_w: float = Field(0.5, gt=0, le=0.73, description="Photodiode at 904 nm before multiplication")
    avalanche_gain: float = Field(55.0, ge=1, le=500, description="Multiplication of the avalanche photodiode")
    excess_noise_factor: float = Field(4.0, ge=1, le=50, description="Excess noise of the multiplication")
    load_ohm: float = Field(50.0, gt=0, le=1000, description="Load of the photodiode at the sampling bridge")
    photodiode_rise_ps: float = Field(180.0, ge=50, le=1000, description="Own rise time (10-90 %) of the photodiode")
    bridge_rise_ps: float = Field(166.0, ge=10, le=500, description="Rise time of the input of the sampling bridge")
    carrier_transit_ps: float = Field(695.0, ge=100, le=3000, description="Time until the last carriers are collected")
    mismatch_reflection: float = Field(0.12, ge=0, lt=1, description="Share that the bridge sends back")
    mismatch_delay_ps: float = Field(300.0, ge=0, le=2000, description="Round trip of that reflection")
    slow_rise_excess: float = Field(0.8, ge=0, le=3, description="Growth of the own rise time at vanishing response")
    slow_rise_response_mv: float = Field(14.0, ge=0, le=100, description="Response at which half of it is left")
    slow_rise_width_mv: float = Field(3.0, gt=0, le=50, description="Width of that transition")
    saturation_mv: float = Field(
        300.0, gt=0, le=10000, description="Response at which the photodiode's gain is down 3 dB"
    )
    amplifier_noise_mv: float = Field(0.55, ge=0, le=20, description="Noise of bridge and amplifier at the photodiode")

    # Sampler
    aperture_ps: float = Field(12.0, ge=0, le=200, description="Width (FWHM) of the sampling gate")
    drift_ps: float = Field(8.0, ge=0, le=1000, description="Slow wander of strobe against laser (standard deviation)")
    drift_time_s: float = Field(300.0, gt=0, le=1e5, description="Time over which it wanders")
    lost_trigger_share: float = Field(0.0, ge=0, le=1, description="Share of the shots without a laser pulse")
    adc_offset_codes: float = Field(0.2, ge=-20, le=20, description="Offset of the A/D")
    adc_bow_codes: float = Field(0.3, ge=-20, le=20, description="Integral non-linearity of the A/D at mid-scale")
    strobe_lag_ps: float = Field(850.0, ge=0, le=5000, description="Sampling strobe after its programmed instant")
    trigger_jitter_ps: float = Field(2.5, ge=0, le=50, description="Shot-to-shot deviation of strobe against laser")
    code_of_zero: float = Field(32.0, ge=0, le=255, description="A/D code of 0 V")
    mv_per_code: float = Field(0.5, gt=0, le=10, description="Size of an A/D code at the photodiode")

    # Scanner
    field_deg: float = Field(10.0, gt=0, le=40, description="Optical angle over the full analogue span")
    mirror_separation_mm: float = Field(30.0, ge=0, le=200, description="Distance between the two mirror axes")
    x_scale_error: float = Field(0.0, ge=-0.1, le=0.1, description="Relative error of the first mirror's angle")
    y_scale_error: float = Field(0.0, ge=-0.1, le=0.1, description="Relative error of the second mirror's angle")
    x_offset_deg: float = Field(0.0, ge=-2, le=2, description="Optical angle of the first mirror at zero command")
    y_offset_deg: float = Field(0.0, ge=-2, le=2, description="Optical angle of the second mirror at zero command")
    non_orthogonality_deg: float = Field(0.0, ge=-2, le=2, description="Turn of the second axis about the beam at rest")
    linearity_percent: float = Field(
        0.0, ge=0, le=5, description="Smooth static error, % of the full 40 deg field; XY30-G3B 0.3, XY30-M3ST 0.005"
    )
    repeatability_deg: float = Field(0.0022, ge=0, le=1, description="Deviation of the optical angle at each return")
    servo_time_ms: float = Field(0.2, gt=0, le=100, description="Time constant of the mirror servo, critically damped")
    creep_share: float = Field(0.0125, ge=0, lt=1, description="Share of a step that only creeps in")
    creep_time_ms: float = Field(5.0, gt=0, le=1000, description="Time constant of that creep")

    # Diode block
    temperature_controller: Literal["tec", "tc200"] = Field("tec", description="Controller on the diode block")
    ambient_degc: float = Field(20.5, ge=0, le=40, description="Air around the bench, and start of everything")
    block_capacity_j_per_k: float = Field(60.0, gt=0, le=5000, description="Heat capacity of diode block and diode")
    block_conductance_w_per_k: float = Field(0.5, gt=0, le=50, description="Peltier element and mount to the heat sink")
    sink_capacity_j_per_k: float = Field(400.0, gt=0, le=20000, description="Heat capacity of the heat sink")
    sink_conductance_w_per_k: float = Field(4.0, gt=0, le=100, description="Heat sink to the air")
    peltier_w_per_a: float = Field(2.5, gt=0, le=100, description="Heat pumped for a current")
    peltier_ohm: float = Field(1.5, gt=0, le=100, description="Resistance of the Peltier element")

    # The second world (docs/physics.md): what the dissertation does not mention; 0 is off
    hum_mv: float = Field(0.0, ge=0, le=20, description="Mains hum behind the bridge: peak of its fundamental")
    mains_hz: float = Field(50.0, gt=0, le=400, description="Frequency of the mains")
    flicker_mv: float = Field(
        0.0, ge=0, le=20, description="Rms of the 1/f noise behind the bridge: 5 Hz to 2 kHz, none at 20 kHz"
    )
    memory_share: float = Field(0.0, ge=0, le=0.5, description="Share of a sample that is left at the next one")
    pickup_mv: float = Field(0.0, ge=0, le=20, description="Pick-up in step with the trigger: peak")
    pickup_ghz: float = Field(1.0, gt=0, le=10, description="Frequency of that pick-up")
    speckle_contrast: float = Field(0.0, ge=0, le=0.5, description="Relative deviation of the response by speckle")
    dither_urad: float = Field(0.0, ge=0, le=1000, description="Dither of each mirror, 0.2 to 20 kHz (rms, optical)")
    pointing_drift_urad: float = Field(
        0.0, ge=0, le=10000, description="Slow wander of the beam on each axis (standard deviation)"
    )
    pointing_drift_time_s: float = Field(1200.0, gt=0, le=1e5, description="Time over which it wanders")
    tail_ageing: float = Field(0.0, ge=0, le=0.5, description="Share of the pulse's energy in a tail of 300 ps")
    focus_mm: float = Field(
        0.0, ge=0, le=2000, description="Path to the narrowest spot; 0: the same spot at any distance"
    )
    divergence_mrad: float = Field(2.0, ge=0, le=50, description="Full angle at which the spot grows off the focus")
    second_path_share: float = Field(0.0, ge=0, le=1, description="Share of the echo that comes back a second time")
    second_path_mm: float = Field(20.0, ge=0, le=300, description="How much farther that second echo seems to be")

    @model_validator(mode="before")
    @classmethod
    def _of_world(cls, table: object) -> object:
        """Take what is not written from the chosen world."""
        if not isinstance(table, Mapping):
            return table
        world = table.get("world", "dissertation")
        return {**WORLDS.get(world, {}), **table} if isinstance(world, str) else table

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        least, largest = self.surface_share
        if least > largest:
            raise ValueError(f"surface_share: the least, {least}, is above the largest, {largest}")
        return self
