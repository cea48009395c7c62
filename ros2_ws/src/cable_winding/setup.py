"""Installs cable_winding for colcon."""

from setuptools import find_packages, setup

package_name = "cable_winding"

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
    description="Shared language of the twin: geometry, cases, tables, markers, topics, messages.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
)
