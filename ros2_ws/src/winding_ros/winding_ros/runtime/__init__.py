"""How a node runs in its process: parameters, inputs, outputs, signs of life."""
