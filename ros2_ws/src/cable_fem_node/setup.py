"""Installs cable_fem_node for colcon."""

from setuptools import find_packages, setup

package_name = "cable_fem_node"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*", "models/*/*", "profiles/*", "templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "numba"],
    zip_safe=False,
    description="Explicit finite-element model of the wound cable, live and ahead of the run.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["cable_fem_node = cable_fem_node.__main__:main"]},
)
