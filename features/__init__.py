"""Features: pure functions of arrays, from amplitude statistics to the crank-angle map.

The public names below load on first use; spectra and orbits take a recording, an array or a table::

    wearstate.features.spectrum(recording).plot()
"""

from importlib import import_module

TYPE_CHECKING = False  # as in the package itself
if TYPE_CHECKING:
    from typing import Any

    from .catalogue.analysis import Settings as Settings
    from .catalogue.curves import Orbit as Orbit
    from .catalogue.curves import Spectrum as Spectrum
    from .catalogue.curves import envelope_spectrum as envelope_spectrum
    from .catalogue.curves import frf as frf
    from .catalogue.curves import orbit as orbit
    from .catalogue.curves import order_spectrum as order_spectrum
    from .catalogue.curves import spectrum as spectrum
    from .catalogue.row import feature_names as feature_names
    from .catalogue.row import feature_row as feature_row
    from .catalogue.transformer import SignalFeatures as SignalFeatures
    from .response.modal import modal_fit as modal_fit
    from .response.modal_model import Modes as Modes
    from .response.transfer import Transfer as Transfer
    from .rotation.balancing import Correction as Correction
    from .rotation.balancing import correction_masses as correction_masses
    from .rotation.balancing import influence_coefficients as influence_coefficients
    from .rotation.orbit import full_spectrum as full_spectrum
    from .rotation.tacho_faults import PulseFaults as PulseFaults
    from .rotation.tacho_faults import mend_pulses as mend_pulses
    from .rotation.tacho_faults import pulse_faults as pulse_faults
    from .rotation.tacholess_speed import tacholess_speed as tacholess_speed
    from .signal.cepstrum import cepstrum as cepstrum
    from .signal.envelope import bearing_frequencies as bearing_frequencies
    from .signal.iso import velocity_rms as velocity_rms
    from .signal.kurtogram import kurtogram as kurtogram

_HOMES = {
    "Correction": ".rotation.balancing",
    "Modes": ".response.modal_model",
    "Orbit": ".catalogue.curves",
    "PulseFaults": ".rotation.tacho_faults",
    "Settings": ".catalogue.analysis",
    "SignalFeatures": ".catalogue.transformer",
    "Spectrum": ".catalogue.curves",
    "Transfer": ".response.transfer",
    "bearing_frequencies": ".signal.envelope",
    "cepstrum": ".signal.cepstrum",
    "correction_masses": ".rotation.balancing",
    "envelope_spectrum": ".catalogue.curves",
    "feature_names": ".catalogue.row",
    "feature_row": ".catalogue.row",
    "frf": ".catalogue.curves",
    "full_spectrum": ".rotation.orbit",
    "influence_coefficients": ".rotation.balancing",
    "kurtogram": ".signal.kurtogram",
    "mend_pulses": ".rotation.tacho_faults",
    "modal_fit": ".response.modal",
    "orbit": ".catalogue.curves",
    "order_spectrum": ".catalogue.curves",
    "pulse_faults": ".rotation.tacho_faults",
    "spectrum": ".catalogue.curves",
    "tacholess_speed": ".rotation.tacholess_speed",
    "velocity_rms": ".signal.iso",
}
"""Module that defines each public name; the block above says the same to type checkers."""

__all__ = [*_HOMES]

if not TYPE_CHECKING:  # with __getattr__, a type checker would accept any name

    def __getattr__(name: str) -> "Any":
        """Import the public name on first use."""
        if name not in _HOMES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        return getattr(import_module(_HOMES[name], __name__), name)


def __dir__() -> list[str]:
    return sorted(__all__)
