"""Estimate unknown parameters of a machine's scene from healthy recordings of it."""

import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...datasets.draws.motor import motor_speed
from ...datasets.file.record import DataSet
from ...datasets.file.writer import refuse_output
from ...datasets.measured.recording import read_recording
from ...datasets.recipe.load import load_recipe
from ...datasets.recipe.recipe import Recipe
from ...datasets.recipe.text import RecipeError, recipe_names, toml_text, twin_path
from ...sim.atomic import write_whole
from ...sim.output.recording import DataError, Recording
from ...sim.parts.wording import si_unit
from ...sim.scene.load import load_scene, override, scene_from_table
from ..pages.si_text import si_text
from .inversion import DETERMINED, Inverted, inverted, offset_progress, rounds_of, standard
from .levels import layout_of, levels_of, speed_of
from .misfit import LEAST_P, Misfit, misfit, refusal
from .regimes import PER_MEMBER, oiled_members, oiled_unknowns, with_regime
from .unknowns import WEAR, TwinUnknowns, unknowns_of

Float = NDArray[np.float64]

MOST_RECORDINGS = 8
"""Largest number of recordings in a calibration: each is simulated for every member."""
PRIOR = "bilge-pump-standard"
"""Recipe whose draws are the prior of a pump."""
_FULL_SCENE = "start from that of wearstate scene show bilge-pump, or give a recipe of your own"
DRAWS = 400
"""Draws of prior and posterior for the table."""
DIGITS = 4


class MisfitError(ValueError):
    """The recordings do not fit a machine of this scene."""


@dataclass(frozen=True, kw_only=True)
class CalibratedNumber:
    """One number of the scene before and after calibration.

    Attributes
    ----------
    path, unit : str
        Dotted path and SI unit.
    prior, posterior : tuple of float
        Mean and standard deviation.
    narrower : float
        Standard deviation of the prior over that of the posterior, in normal scores.
    """

    path: str
    unit: str
    prior: tuple[float, float]
    posterior: tuple[float, float]
    narrower: float


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class CalibratedScene:
    """A calibrated scene, from :func:`wearstate.calibrate`.

    Attributes
    ----------
    unknowns : TwinUnknowns
        Estimated parameters and their prior.
    found : Inverted
        Joint distribution of the normal scores.
    misfit : Misfit
        Misfit between the recordings and machines of this scene.
    recordings : tuple of str
        Recordings used.
    recipe, base : str
        Recipe and scene before calibration: built-in names or files.
    unknown : tuple of str
        Names to be estimated; empty for all.
    """

    unknowns: TwinUnknowns
    found: Inverted
    misfit: Misfit
    recordings: tuple[str, ...]
    recipe: str
    base: str
    unknown: tuple[str, ...]

    @cached_property
    def numbers(self) -> tuple[CalibratedNumber, ...]:
        """Numbers of the scene that the recordings determine, the best determined first."""
        rng = np.random.default_rng(0)
        draws = [each.draw(DRAWS, rng) for each in (self.found.prior, self.found.posterior)]
        kind = type(self.unknowns.recipe.scene)
        sd = self.found.posterior.sd / self.found.prior.sd
        rows = []
        for name in self.unknowns.named:
            ratio = sd[self.unknowns.names.index(name)]
            if ratio < DETERMINED:
                path = self.unknowns.path_of(name)
                spread = [self.unknowns.numbers(name, draw) for draw in draws]
                before, after = ((float(s.mean()), float(s.std())) for s in spread)
                rows.append(
                    CalibratedNumber(
                        path=path,
                        unit=si_unit(kind, path),
                        prior=before,
                        posterior=after,
                        narrower=float(1 / ratio),
                    )
                )
        return tuple(sorted(rows, key=lambda row: -row.narrower))

    @property
    def table(self) -> dict[str, Any]:
        """Results, ready for JSON."""
        return {
            "scene": self.unknowns.recipe.scene.name,
            "recipe": self.unknowns.recipe.name,
            "recordings": list(self.recordings),
            "members": self.found.members,
            "p": self.misfit.p,
            "misfit": self.misfit.text,
            "unknowns": len(self.unknowns.named),
            "numbers": [
                {
                    "path": each.path,
                    "unit": each.unit,
                    "prior_mean": each.prior[0],
                    "prior_sd": each.prior[1],
                    "mean": each.posterior[0],
                    "sd": each.posterior[1],
                    "narrower": each.narrower,
                }
                for each in self.numbers
            ],
        }

    @property
    def text(self) -> str:
        """Text printed by ``wearstate calibrate``."""
        return calibration_text(self)

    @property
    def scene_table(self) -> dict[str, Any]:
        """Plain table of the scene: determined numbers at their mean, all others unchanged."""
        mean, learnt = self.found.posterior.mean[np.newaxis], self._learnt
        values = {
            self.unknowns.path_of(name): float(self.unknowns.numbers(name, mean)[0])
            for name in self.unknowns.named
            if name in learnt and self.unknowns.holds(name, self.unknowns.recipe.scene)
        }
        table = override(self.unknowns.recipe.base, values)
        scene_from_table(table)
        return table

    @property
    def twin_table(self) -> dict[str, Any]:
        """Plain table of the posterior of the determined numbers, for recipes."""
        names = [name for name in self._learnt if name != WEAR]
        places = [self.unknowns.names.index(name) for name in names]
        posterior = self.found.posterior
        sd = posterior.sd[places]
        correlation = posterior.covariance[np.ix_(places, places)] / np.outer(sd, sd)
        return {
            "scene": self.unknowns.recipe.scene.name,
            "recipe": self.recipe,
            "base": self.base,
            "unknown": list(self.unknown),
            "names": names,
            "mean": [round(float(each), DIGITS) for each in posterior.mean[places]],
            "sd": [round(float(each), DIGITS) for each in sd],
            "correlation": [
                [round(float(each), DIGITS) for each in row[: i + 1]]
                for i, row in enumerate(correlation)
            ],
        }

    @property
    def _learnt(self) -> tuple[str, ...]:
        determined = self.found.posterior.sd < DETERMINED * self.found.prior.sd
        return tuple(n for n, each in zip(self.unknowns.names, determined, strict=True) if each)

    def save(self, path: str | Path, *, force: bool = False) -> None:
        """Write the scene and the posterior, ``mine.toml`` and ``mine.twin.toml``.

        Parameters
        ----------
        path : str or Path
            Scene to write (.toml).
        force : bool
            Replace existing files.

        Raises
        ------
        DataError
            A file exists, the folder does not, or no number was determined.
        """
        file = Path(path).absolute()
        posterior = twin_path(file)
        for each in (file, posterior):
            refuse_output(each, force)
        if not self.twin_table["names"]:
            raise DataError(
                "the recordings determine none of the unknowns; give more or longer ones"
            )
        origins = {
            key: _relative_name(file.parent, getattr(self, key)) for key in ("recipe", "base")
        }
        for each, table in (
            (file, self.scene_table),
            (posterior, {**self.twin_table, **origins}),
        ):
            write_whole(each, toml_text(table).encode(), force=force)

    def __str__(self) -> str:
        return self.text

    def __repr__(self) -> str:
        return (
            f"<CalibratedScene {self.unknowns.recipe.scene.name}: {len(self.numbers)} of "
            f"{len(self.unknowns.named)} numbers determined, p = {self.misfit.p:.2g}>"
        )


def calibrate(
    scene: str | Path,
    recordings: Sequence[Recording | str | Path],
    *,
    recipe: str | Path = PRIOR,
    unknown: Sequence[str] = (),
    budget_s: float | None = None,
    seed: int = 0,
    jobs: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> CalibratedScene:
    """Estimate unknown parameters of a reciprocating pump from healthy recordings of it.

    Parameters
    ----------
    scene : str or Path
        Built-in scene or TOML file, from data sheet and drawings.
    recordings : sequence of Recording, str or Path
        Recordings of this machine while its wear was within the limits as new, at one or several
        speeds, with a tacho; a data set stands for all its records.
    recipe : str or Path
        Its draws of machines, around the scene, define the unknowns and their prior.
    unknown : sequence of str
        Paths of the recipe's draws, or its choices, with ``*`` for any; by default all. Others stay
        as in the scene.
    budget_s : float, optional
        Computing time on a usual core [s]. It determines the number of simulated machines and thus
        the result, which is the same on any computer; by default 310 machines, and half of the
        first 130 again with oil in the crank pin.
    seed : int
        Seed of draws and sensor noise, >= 0.
    jobs : int
        Worker processes; the result does not depend on them.
    progress : callable, optional
        Called with (machines simulated, all).

    Returns
    -------
    CalibratedScene
        ``text`` is the table, ``save`` writes scene and posterior.

    Raises
    ------
    DataError
        A recording cannot be read, has no tacho, or has other channels than the scene.
    MisfitError
        The recordings do not fit any machine of the scene.
    RecipeError, SceneError
        Scene or recipe are invalid.

    Notes
    -----
    Regularised ensemble Kalman inversion: each round draws machines, simulates them under the
    conditions of the recordings, and regresses normal scores of the unknowns on levels of the
    crank-angle map and the spectrum, on scanned mode frequencies and on crank angles of knocks. The
    errors on left-out machines give the posterior. Contact laws are carried along, not chosen. If
    the crank pin of the scene is dry, some machines are also simulated with oil, and recordings
    that resemble these are refused.

    References
    ----------
    Iglesias, Law, Stuart, "Ensemble Kalman methods for inverse problems", Inverse Problems 29
    (2013) 045001, doi:10.1088/0266-5611/29/4/045001.

    Examples
    --------
    >>> import wearstate
    >>> sound = wearstate.simulate(wearstate.load_scene("bilge-pump", {"duration": "1 s"}))
    >>> mine = wearstate.calibrate(
    ...     "bilge-pump", [sound], unknown=["casing.modes.*.frequency"], budget_s=1.0
    ... )
    >>> mine.save("mine.toml")
    >>> mine.misfit.refused, "casing.modes.1.frequency" in [each.path for each in mine.numbers]
    (False, True)
    """
    _refuse_other_machines(scene)
    loaded, names = _read(recordings)
    chosen = _chosen(recipe, scene)
    plan = _prior(chosen, scene, loaded[0])
    unknowns = unknowns_of(plan, _as_new(plan), unknown)
    refuse_channels(plan, loaded)
    runs = [conditions_of(plan, each) for each in loaded]
    layout = layout_of(loaded[0])
    observed = np.array([levels_of(each) for each in loaded])
    rounds = rounds_of(budget_s, len(runs))
    wet = oiled_unknowns(unknowns)
    extra = round(PER_MEMBER * rounds[0]) if wet is not None else 0
    total = extra + sum(rounds)
    oiled = oiled_members(
        wet, extra, runs, seed=seed, jobs=jobs, progress=offset_progress(progress, 0, total)
    )

    def check(rows: Float) -> None:
        far = with_regime(misfit(layout, rows, observed), layout, rows, observed, oiled)
        _refuse_misfit(plan, names, far)

    found = inverted(
        unknowns,
        layout,
        observed,
        runs,
        prior=standard(len(unknowns.names)),
        rounds=rounds,
        seed=seed,
        jobs=jobs,
        progress=offset_progress(progress, extra, total),
        check=check,
    )
    return CalibratedScene(
        unknowns=unknowns,
        found=found,
        misfit=misfit(layout, found.levels, observed),
        recordings=names,
        recipe=str(chosen),
        base=str(scene),
        unknown=tuple(unknown),
    )


def _read(
    recordings: Sequence[Recording | str | Path],
) -> tuple[list[Recording], tuple[str, ...]]:
    """Recordings and their names."""
    loaded: list[Recording] = []
    for each in recordings:
        if isinstance(each, Recording):
            loaded.append(each)
        elif Path(each).suffix.lower() in (".h5", ".hdf5") and Path(each).is_file():
            loaded += _of_data_set(Path(each))
        else:
            loaded.append(_of_file(Path(each)))
    if not 1 <= len(loaded) <= MOST_RECORDINGS:
        raise DataError(
            f"recordings = {len(loaded)} must be >= 1 and <= {MOST_RECORDINGS}; choose some"
        )
    names = tuple(each.source or "recording" for each in loaded)
    for (one, a), (other, b) in combinations(zip(names, loaded, strict=True), 2):
        if a.sample_rate == b.sample_rate and np.array_equal(a.signal, b.signal):
            raise DataError(f"{one} and {other} are the same recording; give each once")
    return loaded, names


def _of_file(path: Path) -> Recording:
    """Recording in a measured file that describes its own content."""
    try:
        return read_recording(path)
    except DataError as error:
        if not path.is_file():
            raise
        cure = f"wearstate import {path.name} -o healthy.h5, with its units and tacho"
        raise DataError(f"{error}\n{path}: or make a data set of it: {cure}") from error


def _of_data_set(path: Path) -> list[Recording]:
    with DataSet(path) as data:
        if len(data) > MOST_RECORDINGS or len(set(data.machines)) > 1:
            machines = len(set(data.machines))
            raise DataError(
                f"{path}: {len(data)} records of {machines} machines must be <= {MOST_RECORDINGS} "
                "of one; take those of this machine: wearstate export "
                f"{path.name} --as wav -o folder, and import them"
            )
        return [replace(data[i], source=f"{path.name}:{i}") for i in range(len(data))]


def _relative_name(folder: Path, name: str) -> str:
    """A built-in name, or the path of a file relative to a folder, so that both can be moved."""
    path = Path(name)
    return os.path.relpath(path.absolute(), folder) if path.is_file() else name


def _chosen(recipe: str | Path, scene: str | Path) -> str | Path:
    """The standard recipe of the scene, unless another was given."""
    own = f"{scene}-standard"
    return own if recipe == PRIOR and own in recipe_names() else recipe


def _prior(recipe: str | Path, scene: str | Path, first: Recording) -> Recipe:
    """The recipe around the scene, at the sample rate of the recordings."""
    try:
        return load_recipe(recipe, {"sample_rate": first.sample_rate}, scene=scene)
    except RecipeError as error:
        if recipe not in recipe_names():
            raise
        raise RecipeError(
            f"{recipe} varies what {scene} lacks ({_FULL_SCENE})", error.faults
        ) from None


def _refuse_other_machines(scene: str | Path) -> None:
    machine = load_scene(scene).machine
    if machine != "reciprocating-pump":
        raise DataError(
            f"machine = '{machine}' must be 'reciprocating-pump' to be calibrated; use "
            "wearstate align or a film's clearance for others"
        )


def _as_new(plan: Recipe) -> tuple[float, float]:
    """Range of the wear of a healthy machine [m], up to the first grade edge."""
    edges = plan.severities[0].edges
    low = plan.severity.extremes()[0]
    if not edges or edges[0] <= low:
        raise DataError(
            f"wear limits of {plan.scene.name} must be given, with as new < the first grade edge; "
            "add the table [wear]"
        )
    return low, edges[0]


def refuse_channels(plan: Recipe, loaded: Sequence[Recording]) -> None:
    """Raise DataError if recordings differ from the scene in channels, or in sample rate."""
    wanted = tuple(sensor.name for sensor in getattr(plan.scene, "sensors", ()))
    faults = [
        f"{each.source or 'recording'}: channels {', '.join(each.vibration_names)} must be "
        f"{', '.join(wanted)}, as in the scene; rename channels, or sensors of the scene"
        for each in loaded
        if each.vibration_names != wanted
    ]
    faults += [
        f"{each.source or 'recording'}: sample rate = {each.sample_rate:g} Hz must be "
        f"{loaded[0].sample_rate:g}, that of the first; give recordings of one rate"
        for each in loaded
        if each.sample_rate != loaded[0].sample_rate
    ]
    if faults:
        raise DataError("\n".join(faults))


def conditions_of(plan: Recipe, recording: Recording) -> dict[str, float]:
    """Conditions of a recording by dotted path, from its tacho and its manifest row."""
    row = recording.row
    noted = {
        path: float(row[column])
        for column, path in plan.conditions.items()
        if column in row and np.isfinite(row[column]) and "start_angle" not in column
    }
    speed = speed_of(recording)
    return {**noted, **motor_speed(plan.scene, speed), "drive.speed": speed}


def _refuse_misfit(plan: Recipe, names: Sequence[str], found: Misfit) -> None:
    if found.refused:
        raise MisfitError(refusal(plan.scene.name, sorted(set(names)), found))


_WIDTH = 52  # characters of a path


def calibration_text(found: "CalibratedScene") -> str:
    """The table of a calibration as text."""
    learnt, plan = found.numbers, found.unknowns.recipe
    head = (
        f"{plan.scene.name}, calibrated on {len(found.recordings)} recording(s) with "
        f"{found.found.members} simulated machines of {plan.name}: {len(learnt)} of "
        f"{len(found.unknowns.named)} numbers determined"
    )
    lines = [f"{'':{_WIDTH}} {'before':>21} {'now':>21}   narrower"]
    lines += [
        f"{each.path:{_WIDTH}} {_spread(each.prior, each.unit):>21} "
        f"{_spread(each.posterior, each.unit):>21}   {each.narrower:.1f} x"
        for each in learnt
    ]
    return "\n".join([head, *lines, _fit_line(found.misfit)])


def _fit_line(misfit: Misfit) -> str:
    """Line on the fit of the recordings, and on the largest misfit unless it only shows noise."""
    if misfit.refused:
        return f"largest misfit: {misfit.text}"
    fits = f"fits machines of this scene: p = {misfit.p:.2g}, refused below {LEAST_P:g}"
    return fits if misfit.even else f"{fits}; largest misfit: {misfit.text}"


def _spread(value: tuple[float, float], unit: str) -> str:
    """Mean and standard deviation with unit."""
    return f"{si_text(value[0], unit)} ± {si_text(value[1], unit, 2)}"
