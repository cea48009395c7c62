"""Installs winding_bringup for colcon."""

from setuptools import find_packages, setup

package_name = "winding_bringup"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*", "models/*/*", "profiles/*", "templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
        (f"share/{package_name}/launch", ["launch/twin.launch.py"]),
    ],
    install_requires=["setuptools", "mcap", "pyarrow", "rosbags", "typer"],
    zip_safe=False,
    description="The graph as data, its orchestrator, recorder and the winding command.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["winding = winding_bringup.cli:main"]},
)
