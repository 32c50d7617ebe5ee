"""The packages of the distribution: the folders at the top, installed below the name `picoradar`."""

from setuptools import find_packages, setup

ROOMS = ("drivers", "registration", "sim", "instrument")

setup(
    packages=[
        "picoradar",
        *(f"picoradar.{name}" for room in ROOMS for name in (room, *(f"{room}.{p}" for p in find_packages(room)))),
    ],
    package_dir={"picoradar": "picoradar", **{f"picoradar.{room}": room for room in ROOMS}},
)
