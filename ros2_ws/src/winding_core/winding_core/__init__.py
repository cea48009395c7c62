"""The shared language of the cable-winding twin: geometry, cases, published tables, markers."""
