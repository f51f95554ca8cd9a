"""The section `grid` of a scenario: a grid that is generated, not listed."""

from collections.abc import Mapping, Sequence
from typing import Annotated, Literal, Self, TypeAlias

from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from dgu_sim.loads import Load
from dgu_sim.model import Frozen, Number, finding
from dgu_sim.parameters import DguParameters

__all__ = [
    "CsvGrid",
    "DguColumns",
    "DguTemplate",
    "GridSettings",
    "LineColumns",
    "LineTemplate",
    "MeshGrid",
    "RandomGeometricGrid",
    "RingGrid",
    "SpreadSettings",
    "StarGrid",
]

MOST_DGUS = 1_000_000

Positive = Annotated[Number, Field(gt=0)]
NonNegative = Annotated[Number, Field(ge=0)]
Share = Annotated[Number, Field(ge=0, lt=1)]
Numbers = tuple[Number, ...]
Size = Annotated[int, Field(ge=2, le=MOST_DGUS)]


class DguTemplate(Frozen):
    """What all DGUs of a generated grid have in common; the defaults are those of G's DGU 1."""

    resistance_ohm: Positive = Field(default=0.2, description="R_t of the output filter [ohm].")
    inductance_h: Positive = Field(default=1.8e-3, description="L_t of the output filter [H].")
    capacitance_f: Positive = Field(default=2.2e-3, description="C_t at the bus [F].")
    k1: Number = Field(default=-2.134, description="Primary gain of the bus voltage.")
    k2: Number = Field(default=-0.163, description="Primary gain of the filter current [ohm].")
    k3: Number = Field(default=13.553, description="Primary gain of the integrator [1/s].")
    reference_v: Number = Field(default=48.0, description="V_ref [V].")
    rated_current_a: Positive = Field(default=1.0, description="I^r [A].")
    load: tuple[Load, ...] = Field(default=(), description="Loads of every DGU.")

    @model_validator(mode="after")
    def _gain_condition(self) -> Self:
        violation = self.parameters.gain_violation()
        if violation is not None:
            raise finding((violation[0],), getattr(self, violation[0]), f"expected {violation[1]}")
        return self

    @property
    def parameters(self) -> DguParameters:
        """The parameters by the symbols of the papers."""
        return DguParameters(
            R_t=self.resistance_ohm,
            L_t=self.inductance_h,
            C_t=self.capacitance_f,
            k1=self.k1,
            k2=self.k2,
            k3=self.k3,
        )


class LineTemplate(Frozen):
    """What all lines of a generated grid have in common."""

    resistance_ohm: Positive = Field(default=0.5, description="R_ij [ohm].")
    inductance_h: NonNegative = Field(default=0.0, description="L_ij [H].")


class SpreadSettings(Frozen):
    """Half-widths, as shares of the template's value: 0.2 draws from U(0.8, 1.2) times that value."""

    resistance_ohm: Share = Field(default=0.0, description="Of R_t; k2 keeps its distance below it.")
    inductance_h: Share = Field(default=0.0, description="Of L_t; k3 keeps its share of its limit.")
    capacitance_f: Share = Field(default=0.0, description="Of C_t.")
    gains: Share = Field(default=0.0, description="Of 1 - k1, of R_t - k2 and of k3 over its limit, each by itself.")
    reference_v: Share = Field(default=0.0, description="Of V_ref.")
    rated_current_a: Share = Field(default=0.0, description="Of I^r.")
    load: Share = Field(default=0.0, description="Of the currents of all loads of a DGU together.")
    line_resistance_ohm: Share = Field(default=0.0, description="Of R_ij.")


class _Generated(Frozen):
    """What every kind of grid has."""

    seed: int = Field(default=1, ge=0, description="Seed of everything that is drawn; the run's seed changes no grid.")
    dgu: DguTemplate = Field(default_factory=DguTemplate, description="The DGUs.")
    line: LineTemplate = Field(default_factory=LineTemplate, description="The lines.")
    spread: SpreadSettings = Field(default_factory=SpreadSettings, description="How far they differ.")

    @model_validator(mode="after")
    def _gains_keep_condition(self) -> Self:
        share = self.dgu.k3 / self.dgu.parameters.k3_limit()
        if share * (1.0 + self.spread.gains) >= 1.0:
            expected = f"expected less than {1.0 / share - 1.0:.4g}: k3 has to stay below its limit (gain condition)"
            raise finding(("spread", "gains"), self.spread.gains, expected)
        return self


class MeshGrid(_Generated):
    """A rectangular mesh, numbered row by row."""

    kind: Literal["mesh"] = Field(description="`mesh`: DGUs in rows and columns, lines between next ones.")
    rows: int = Field(ge=1, le=MOST_DGUS, description="Rows.")
    columns: int = Field(ge=1, le=MOST_DGUS, description="Columns.")

    @model_validator(mode="after")
    def _not_huge(self) -> Self:
        if self.rows * self.columns > MOST_DGUS:
            raise finding(("columns",), self.columns, f"expected at most {MOST_DGUS} DGUs in all")
        return self


class RingGrid(_Generated):
    """A ring."""

    kind: Literal["ring"] = Field(description="`ring`: each DGU joined to the next, the last to the first.")
    size: Size = Field(description="Number of DGUs.")


class StarGrid(_Generated):
    """A star."""

    kind: Literal["star"] = Field(description="`star`: DGU 1 joined to all others.")
    size: Size = Field(description="Number of DGUs.")


class RandomGeometricGrid(_Generated):
    """Random places in a square, near ones joined."""

    kind: Literal["random_geometric"] = Field(
        description="`random_geometric`: places drawn from a square, near ones joined, and the shortest lines that "
        "make it one grid."
    )
    size: Size = Field(description="Number of DGUs.")
    degree: Positive = Field(default=4.0, le=100, description="Lines at a DGU, about, away from the border.")


class _Columns(Frozen):
    """Columns of one length."""

    @model_validator(mode="after")
    def _one_length(self) -> Self:
        first, *others = [name for name in type(self).model_fields if getattr(self, name) is not None] or [""]
        if not first:
            raise PydanticCustomError("columns", "expected at least one column")
        rows = len(getattr(self, first))
        for name in others:
            if len(getattr(self, name)) != rows:
                found = len(getattr(self, name))
                raise finding((name,), f"{found} values", f"expected as many as {first} has, {rows}")
        return self

    @property
    def columns(self) -> Mapping[str, Sequence[float]]:
        """The columns that are there."""
        found = {name: getattr(self, name) for name in type(self).model_fields}
        return {name: values for name, values in found.items() if values is not None}


class DguColumns(_Columns):
    """A value for each DGU; what is left out is that of the template."""

    id: tuple[int, ...] | None = Field(default=None, description="Numbers of the DGUs, ascending; none: from 1.")
    resistance_ohm: Numbers | None = Field(default=None, description="R_t [ohm].")
    inductance_h: Numbers | None = Field(default=None, description="L_t [H].")
    capacitance_f: Numbers | None = Field(default=None, description="C_t [F].")
    k1: Numbers | None = Field(default=None, description="k1.")
    k2: Numbers | None = Field(default=None, description="k2 [ohm].")
    k3: Numbers | None = Field(default=None, description="k3 [1/s].")
    reference_v: Numbers | None = Field(default=None, description="V_ref [V].")
    rated_current_a: Numbers | None = Field(default=None, description="I^r [A].")
    load_a: Numbers | None = Field(default=None, description="A constant load, added to those of the template [A].")


class LineColumns(_Columns):
    """A value for each line."""

    first: tuple[int, ...] = Field(description="DGU at one end.")
    second: tuple[int, ...] = Field(description="DGU at the other.")
    resistance_ohm: Numbers | None = Field(default=None, description="R_ij [ohm].")
    inductance_h: Numbers | None = Field(default=None, description="L_ij [H].")


class CsvGrid(_Generated):
    """A grid from two tables."""

    kind: Literal["from_csv"] = Field(description="`from_csv`: what two tables list.")
    dgus: DguColumns = Field(description="The DGUs: `{file: dgus.csv}`, or lists.")
    lines: LineColumns = Field(description="The lines: `{file: lines.csv}`, or lists.")


GridSettings: TypeAlias = Annotated[
    MeshGrid | RingGrid | StarGrid | RandomGeometricGrid | CsvGrid, Field(discriminator="kind")
]
