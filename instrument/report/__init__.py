"""Reports: a folder with one page that shows whether a scan can be used, and its pictures and data."""

from picoradar.instrument.report.page import Banner, Page, Picture
from picoradar.instrument.report.registered import RegisteredScan, Surface
from picoradar.instrument.report.writing import write_report

__all__ = [
    "Banner",
    "Page",
    "Picture",
    "RegisteredScan",
    "Surface",
    "write_report",
]
