"""Installs the package for colcon; setup.cfg says what."""

from setuptools import setup

setup()
