"""Installs marker_tracker_node for colcon."""

from setuptools import find_packages, setup

package_name = "marker_tracker_node"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*", "models/*/*", "profiles/*", "templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "rosbags"],
    zip_safe=False,
    description="Finds the cable's yellow markers in camera frames and follows them over turns.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["marker_tracker_node = marker_tracker_node.__main__:main"]},
)
