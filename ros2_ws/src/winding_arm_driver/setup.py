"""Installs the package for colcon, as setup.cfg declares it."""

from setuptools import setup

setup()
