"""`SimulationSettings`: every physical parameter of the simulated bench, the ``[simulation]`` table of a settings file.

The defaults are the dissertation's radar (sections 2.3 to 2.6). What it does not state is chosen so that its
measured figures come out; ``docs/physics.md`` says which is which.
"""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, Field

Pose = tuple[float, float, float, float, float, float]


class SimulationSettings(BaseModel):
    """Parameters of laser, receiver, sampler, scanner, scene and diode block; unknown keys are refused."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    # Scene
    target: str = Field("hip", min_length=1, description="hip, prism, gray, plate, step, or the path of a mesh in mm")
    target_pose: Pose | None = Field(
        None, description="Target in the scanner frame: x, y, z (mm), turns about x, y, z (deg); none: by seed"
    )
    distance_mm: float = Field(900.0, ge=100, le=1500, description="Distance of the target along the beam at rest")
    reflectance: float | None = Field(
        None, gt=0, le=1, description="Diffuse reflectance at 904 nm of the whole target; none: the target's own"
    )

    # Laser and its path
    current_delay_ps: float = Field(0.0, ge=0, le=5000, description="Trigger to start of the current pulse")
    exit_transmission: float = Field(0.62, gt=0, le=1, description="Share of the laser pulse that leaves the scanner")
    pulse_energy_noise: float = Field(0.015, ge=0, le=0.2, description="Shot-to-shot deviation of the pulse energy")
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
    amplifier_noise_mv: float = Field(0.55, ge=0, le=20, description="Noise of bridge and amplifier at the photodiode")

    # Sampler
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
    repeatability_deg: float = Field(0.0022, ge=0, le=1, description="Deviation of the optical angle at each return")
    servo_time_ms: float = Field(0.2, gt=0, le=100, description="Time constant of the mirror servo, critically damped")
    creep_share: float = Field(0.0125, ge=0, lt=1, description="Share of a step that only creeps in")
    creep_time_ms: float = Field(3.0, gt=0, le=1000, description="Time constant of that creep")

    # Diode block
    ambient_degc: float = Field(20.5, ge=0, le=40, description="Air around the bench, and start of everything")
    block_capacity_j_per_k: float = Field(60.0, gt=0, le=5000, description="Heat capacity of diode block and diode")
    block_conductance_w_per_k: float = Field(0.5, gt=0, le=50, description="Peltier element and mount to the heat sink")
    sink_capacity_j_per_k: float = Field(400.0, gt=0, le=20000, description="Heat capacity of the heat sink")
    sink_conductance_w_per_k: float = Field(4.0, gt=0, le=100, description="Heat sink to the air")
    peltier_w_per_a: float = Field(2.5, gt=0, le=100, description="Heat pumped for a current")
    peltier_ohm: float = Field(1.5, gt=0, le=100, description="Resistance of the Peltier element")
    storage_capacitance_pf: float = Field(205.0, gt=0, le=5000, description="Capacitor discharged through the diode")
    pulser_heat_share: float = Field(0.3, ge=0, le=1, description="Share of the pulser's power that heats the block")
