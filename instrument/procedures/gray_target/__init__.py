"""Bench procedures `gray-target` and `templates`: timing walk and pulse shapes from gray cards."""

from picoradar.instrument.procedures.gray_target.procedure import DARKEST, WHITE, wedge

__all__ = [
    "DARKEST",
    "WHITE",
    "wedge",
]
