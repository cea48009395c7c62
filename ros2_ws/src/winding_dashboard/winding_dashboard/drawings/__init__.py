"""Pictures as SVG, made of numbers alone: charts, cylinder with cable, frames on the camera."""
