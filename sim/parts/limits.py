"""Limits of scene values: beyond them a number has a wrong unit or is in the wrong key."""

# Bounds far from any machine: they catch a wrong unit or exponent, and keep every
# product and quotient of the kernels finite.
LONGEST = 100.0  # m
HEAVIEST, LIGHTEST = 1e6, 1e-6  # kg
INERTIA_MOST, INERTIA_LEAST = 1e9, 1e-12  # kg m^2
PRESSURE_MOST = 1e9  # Pa, a waterjet intensifier has 6e8

STIFFEST = 1e13  # N/m, a metre of steel has 1e11
DAMPING_MOST = 1e9  # N s/m
FORCE_MOST = 1e9  # N
SLIDING_LEAST, SLIDING_MOST = 1e-6, 1e3  # m/s
ANGLE_MOST = 1e4  # rad, beyond it a cosine has lost four digits

GAIN_LEAST, GAIN_MOST = 1e-3, 1e3
MODE_SLOWEST, MODE_FASTEST = 1e-6, 1e6  # Hz, a floating casing has almost none

MOST_SENSORS, MOST_MODES = 64, 1000
NAME_LONGEST = 64
