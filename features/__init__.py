"""Features: pure functions of arrays, from amplitude statistics to the crank-angle map."""
