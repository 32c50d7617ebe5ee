"""`WORLDS`: named sets of the simulator's parameters, chosen by ``world`` in the ``[simulation]`` table.

``dissertation`` is the radar of the dissertation, without the disturbances that it does not mention: the defaults.
``clinic`` adds those that a radar in an operating room has; docs/physics.md gives a reason for each value. A key that
is written in the settings itself goes before the set.
"""

from __future__ import annotations

from collections.abc import Mapping

CLINIC: dict[str, float | bool] = {
    # Behind the bridge, in the band of the extended-time signal (100 Hz to 3 kHz)
    "hum_mv": 0.1,  # chosen: a fifth of the amplifier's noise, what a shielded amplifier of gain 34 leaves
    "flicker_mv": 0.1,  # chosen: a fifth of the white noise
    "memory_share": 0.005,  # chosen: 0.5 % of a sample left at the next one, 12.5 us later
    # Synchronous with the trigger
    "pickup_mv": 0.1,  # chosen: a fifth of a code of the A/D
    # Light and mirrors
    "speckle_contrast": 0.07,  # 100 unpolarised speckles over the aperture: 1 / sqrt(2 x 100)
    "dither_urad": 10.0,  # chosen: the size of a digital servo's dither (Scanlab: 200 Hz to 20 kHz)
    "pointing_drift_urad": 75.0,  # middle of the 50 to 100 urad of a session
    "tail_ageing": 0.01,  # chosen: a diode after long use
    "focus_mm": 1000.0,  # the distance at which the dissertation states the spot of 1 mm
    # Light that enters bone and tissue and comes back late (docs/physics.md, light in tissue)
    "tissue_light": True,
}

WORLDS: Mapping[str, Mapping[str, float | bool]] = {"dissertation": {}, "clinic": CLINIC}
