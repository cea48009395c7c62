"""Installs winding_dashboard for colcon."""

from setuptools import find_packages, setup

package_name = "winding_dashboard"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(),
    package_data={"": ["py.typed", "data/*", "models/*/*", "profiles/*", "templates/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{package_name}"]),
        (f"share/{package_name}", ["package.xml"]),
    ],
    install_requires=["setuptools", "nicegui"],
    zip_safe=False,
    description="The operator's page: watches a winding graph and commands it from a browser.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={"console_scripts": ["winding_dashboard = winding_dashboard.__main__:main"]},
)
