"""Physics: simulators that turn a scene into a time history."""
