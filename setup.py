"""The packages of the distribution: the folders at the top, installed below the name `picoradar`."""

from setuptools import find_packages, setup

FOLDERS = ("drivers", "registration", "sim", "instrument")


def packages_in(folder):
    """Names, from the repository's root, of a folder and of all packages below it."""
    return [folder, *(f"{folder}.{package}" for package in find_packages(folder))]


setup(
    packages=["picoradar", *(f"picoradar.{package}" for folder in FOLDERS for package in packages_in(folder))],
    package_dir={"picoradar": "picoradar", **{f"picoradar.{folder}": folder for folder in FOLDERS}},
)
