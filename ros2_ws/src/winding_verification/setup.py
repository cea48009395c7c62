"""Installs the package for colcon; setup.cfg has its metadata."""

from setuptools import setup

setup()
