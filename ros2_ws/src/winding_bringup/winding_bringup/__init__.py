"""Launch file, transport profile and viewer layouts of the graph, as files of the package.

`python -c "from importlib.resources import files; print(files('winding_bringup'))"` prints the
folder that holds `launch`, `policy` and `viewers`. A colcon workspace also has them in
`share/winding_bringup`.
"""
