"""What a machine must bring before it runs the graph: looked at, judged, told what to do."""
