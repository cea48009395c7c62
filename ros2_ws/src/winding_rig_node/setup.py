"""Installs winding_rig_node for colcon."""

from setuptools import find_packages, setup

package_name = "winding_rig_node"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*", "models/*/*", "profiles/*", "templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=False,
    description="Simulated winding machine: drives, encoders, load cell, cable lay and camera.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["winding_rig_node = winding_rig_node.__main__:main"]},
)
