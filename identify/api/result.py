"""What ``identify`` returns: an identification that prints, shows in a notebook, plots and simulates."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from identify.api import figures
from identify.api.columns import column, finite, increasing, same_length
from identify.api.notebook import notebook_html
from identify.api.state_space import state_space_of, transfer_function_of
from identify.report.files import final_platform, model_text, result_json, write_results
from identify.report.model_formats import content_of, name_for
from identify.report.model_formats.description import described
from identify.report.replaced_file import replace_file
from identify.report.summary import summary
from identify.residual import Disturbance
from identify.results import Identification, ParameterEstimate
from identify.wording import SYMBOLS, plain, unit, with_interval
from rig.config.model import ModelConfig
from rig.dynamics import Equations, Motion, TorqueSignal, simulate
from rig.dynamics.equations import MAX_SUBSTEPS, STEP_PHASE_RAD
from rig.errors import InputError
from rig.platform import Platform
from rig.recording.run import Recording
from rig.signals import TorqueHold

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

Against = Literal["time", "angle", "direction", "rate"]
COARSEST_PHASE_RAD = 4.0 * MAX_SUBSTEPS * STEP_PHASE_RAD  # of the fastest motion in a sample: a quarter radian a step


class Result:
    """The outcome of one identification; made by ``identify.identify``.

    Attributes
    ----------
    identification
        Everything that was found, as plain values (``identify.results.Identification``).
    recording
        The runs that it was found from.
    """

    def __init__(self, identification: Identification, recording: Recording, model: ModelConfig) -> None:
        self.identification = identification
        self.recording = recording
        self._model = model

    @property
    def accepted(self) -> bool:
        """Whether the parameters are determined and what is left is immaterial; else ``reasons`` says why not."""
        return self.identification.accepted

    @property
    def reasons(self) -> tuple[str, ...]:
        """Why the result was not accepted, and what to record next; empty where it was."""
        return self.identification.reasons

    @property
    def aborted(self) -> bool:
        """Whether the search was interrupted: missing effects are then not yet determined."""
        return self.identification.aborted

    @property
    def parameters(self) -> Mapping[str, ParameterEstimate]:
        """Parameters of the final model: "inertia", "damping", "stiffness" (without torque: the ratios to the inertia).

        Each has ``value``, ``std_error``, ``ci95`` (low, high) and ``unit``. What the data do not determine is absent.
        """
        return self.identification.final.parameters

    @property
    def effects(self) -> Mapping[str, Mapping[str, ParameterEstimate]]:
        """The effects that were added to the declared model, by name, in the order added, with their parameters."""
        known = self.identification.final.effect_parameters
        return {name: known.get(name, {}) for name in self.identification.verdict.effects}

    @property
    def disturbance(self) -> Disturbance | None:
        """What is left after the final model, as a torque, and what it depends on; None without a torque."""
        return self.identification.disturbance

    @property
    def verdict(self) -> tuple[str, ...]:
        """What was found, in sentences."""
        return self.identification.verdict.sentences

    @cached_property
    def platform(self) -> Platform:
        """The final model, fit to be declared or simulated next.

        Raises
        ------
        InputError
            Where no model came out.
        """
        try:
            return final_platform(self.identification, self._model.platform(), self._model.inertia_declared)
        except ValueError:
            raise InputError(
                "no model could be identified from these data: read .reasons and record what it asks for"
            ) from None

    def to_dict(self) -> dict[str, Any]:
        """result.json of ``identify-run`` as plain values: the same keys, None where there is no number."""
        return result_json(self.identification)

    def model_yaml(self) -> str:
        """The text of model.yaml: ``model:`` of a rig.yaml, ``declared=`` of the next call, or a simulated twin.

        Raises
        ------
        InputError
            Where no model came out, or one with an inertia that is not positive.
        """
        try:
            return model_text(self.identification, self._model.platform(), self._model.inertia_declared)
        except ValueError as error:
            raise InputError(f"the identified model is not a valid declared model ({error}): read .reasons") from None

    def save(self, folder: str | Path, name: str = "from Python") -> Path:
        """Write the results folder of ``identify-run``: result.json, report.html, model.yaml and recording.h5.

        Raises
        ------
        InputError
            Where the folder exists (nothing is overwritten) or cannot be made.
        """
        path = Path(folder)
        try:
            path.mkdir(parents=True)
        except FileExistsError:
            raise InputError(f"{path} exists and is never overwritten: choose another folder") from None
        except OSError as error:
            raise InputError(f"{path} cannot be created ({error.strerror}): choose another folder") from None
        declared, given = self._model.platform(), self._model.inertia_declared
        write_results(path, self.identification, self.recording, declared, name, inertia_declared=given)
        return path

    def simulate(
        self,
        time_s: ArrayLike,
        torque_nm: ArrayLike | None = None,
        *,
        angle_rad: float = 0.0,
        rate_rad_s: float = 0.0,
        torque_hold: TorqueHold | None = None,
    ) -> Motion:
        """Motion of the final model, effects included: a twin of the platform.

        Effects of measured channels stand at their reference. Neither noise nor a gyro's bias is added.

        Parameters
        ----------
        time_s
            Shape (n,), strictly increasing, in s: where the motion is wanted.
        torque_nm
            Shape (n,), at ``time_s``; None for free motion.
        angle_rad, rate_rad_s
            Where the motion starts.
        torque_hold
            "band_limited" or "zero_order" between the samples; as in the recording where left out.

        Returns
        -------
        Motion
            ``angle_rad``, ``rate_rad_s`` and ``sensed_rate_rad_s`` (behind the sensor's effects), each of shape (n,).

        Raises
        ------
        InputError
            For arrays that cannot be used, samples too far apart for the platform's motion, a start that is not
            finite, or a torque where the recording had none, so that the response to it is not known.
        """
        time = increasing("time_s", column("time_s", time_s))
        if len(time) < 2:
            raise InputError(f"time_s has {len(time)} value(s): pass at least 2")
        if not np.isfinite([angle_rad, rate_rad_s]).all():
            raise InputError(f"the start ({angle_rad!r} rad, {rate_rad_s!r} rad/s) is not finite: give finite numbers")
        if torque_hold not in (None, "band_limited", "zero_order"):
            raise InputError(f"torque_hold is {torque_hold!r}: choose 'band_limited' or 'zero_order'")
        signal = None
        if torque_nm is not None:
            torque = finite("torque_nm", same_length("torque_nm", column("torque_nm", torque_nm), time))
            if np.any(torque) and self._inertia_unknown:
                raise InputError(
                    "the recording had no torque and no inertia was declared, so the response to a torque is not "
                    "known: declare it, declared={'inertia_kg_m2': ...}, or pass no torque"
                )
            signal = TorqueSignal(time, torque, torque_hold or self.recording.runs[0].torque_hold)
        self._check_steps(float(np.max(np.diff(time))))
        return simulate(self.platform, time, signal, (float(angle_rad), float(rate_rad_s)))

    @property
    def _inertia_unknown(self) -> bool:
        return self.identification.torque_free and not self._model.inertia_declared

    def _check_steps(self, longest_s: float) -> None:
        fastest = Equations(self.platform).fastest_rad_s()
        if longest_s * fastest > COARSEST_PHASE_RAD:
            raise InputError(
                f"time_s has samples {longest_s:g} s apart, too far for this platform's fastest motion "
                f"({fastest:.4g} rad/s): pass samples at most {COARSEST_PHASE_RAD / fastest:.2g} s apart"
            )

    def state_space(self) -> Any:
        """J, C and K of the final model as a ``control.StateSpace``: torque_nm in, angle_rad and rate_rad_s out.

        The effects are not in it, because most have no linear response: ``simulate`` has them all. Where only ratios
        to the inertia are known the input is the torque over the inertia, in rad/s^2.

        Raises
        ------
        MissingPackage
            Where python-control is not installed.
        InputError
            Where no model with a positive inertia came out.
        """
        return state_space_of(self.platform, self._inertia_unknown)

    def transfer_function(self) -> Any:
        """The same as a ``control.TransferFunction``. Raises MissingPackage and InputError alike."""
        return transfer_function_of(self.platform, self._inertia_unknown)

    def save_model(self, path: str | Path) -> Path:
        """Write the final model for another program: ``.json``, ``.mat`` or ``.mo`` (Modelica), by the suffix.

        Raises
        ------
        InputError
            Where the file exists or cannot be written, the suffix is another one, or no model came out.
        """
        file = Path(path)
        inertia = None if self._inertia_unknown else self.platform.inertia_kg_m2
        content = content_of(name_for(file.suffix), described(self.identification, self.recording, inertia))
        if file.exists():
            raise InputError(f"{file} exists and is never overwritten: choose another name")
        try:
            return replace_file(file, content)
        except OSError as error:
            raise InputError(f"{file} cannot be written ({error.strerror}): choose another place") from None

    def plot_motion(self, run: int | str = 0) -> Figure:
        """One run, by its number or name: motion measured and simulated, and the error before and after.

        Raises InputError where there is no such run. This and all other plots raise MissingPackage without matplotlib.
        """
        return figures.motion(self.identification, run)

    def plot_residual(self, against: Against = "time") -> Figure:
        """The residual against "time", "angle", "rate", or against the angle by "direction". Raises InputError."""
        return figures.residual(self.identification, against)

    def plot_spectrum(self) -> Figure:
        """The residual against frequency, beside the sensor's noise. Raises InputError where nothing was simulated."""
        return figures.spectrum(self.identification)

    def plot_response(self) -> Figure:
        """The frequency response, measured and of the models. Raises InputError without a torque."""
        return figures.response(self.identification, self.recording)

    def plot_parameters(self) -> Figure:
        """Every parameter from every run with its interval. Raises InputError where no parameter is determined."""
        return figures.parameters(self.identification)

    def plot_disturbance(self) -> Figure:
        """The shape of what is left over what it depends on. Raises InputError where it depends on nothing."""
        return figures.disturbance(self.identification)

    def plot_convergence(self) -> Figure:
        """The genetic algorithm's objective by generation. Raises InputError where it did not run."""
        return figures.convergence(self.identification)

    def __str__(self) -> str:
        return summary(self.identification, info=self.recording.info)

    def __repr__(self) -> str:
        found = self.identification
        state = "aborted" if found.aborted else "accepted" if found.accepted else "not accepted"
        numbers = [f"{SYMBOLS.get(n, n)} = {with_interval(p)} {unit(p.unit)}" for n, p in self.parameters.items()]
        effects = ", ".join(plain(name) for name in self.effects) or "none"
        return f"<identify.Result, {state}: {', '.join(numbers) or 'nothing determined'}; effects added: {effects}>"

    def _repr_html_(self) -> str:
        return notebook_html(self.identification)
