"""Installs winding_study for colcon."""

from setuptools import find_packages, setup

package_name = "winding_study"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*", "models/*/*", "profiles/*", "templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "distributed", "pyarrow"],
    zip_safe=False,
    description="Offline questions: the twelve cases, sweeps, identification, reports.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
)
