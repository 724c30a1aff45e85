"""The root of the repository is the package ``wearstate``; its folders are found, not listed.

``packages.find`` of pyproject.toml cannot put a prefix before the names it finds.
"""

from setuptools import find_packages, setup

FLOORS = ("sim", "features", "datasets", "diagnose")
FOUND = find_packages(include=[*FLOORS, *(f"{floor}.*" for floor in FLOORS)])

setup(packages=["wearstate", *(f"wearstate.{name}" for name in FOUND)])
