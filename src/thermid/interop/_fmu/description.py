"""The model description of an FMU: variables with units, and which depends on what, as XML of FMI 2.0 and 3.0."""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

from thermid.base.units import DIMENSIONLESS, NAMES, TEMPERATURE, Dimension, unit
from thermid.interop._fmu.image import INDICATOR, MODE, RATE, TEMPERATURE_OF

BASES = ("m", "kg", "s", "A", "K")
"""Base units of the exponents of a dimension, as FMI calls them."""
_WORD = re.compile(r"[A-Za-z_][A-Za-z0-9_]*(\.[A-Za-z_][A-Za-z0-9_]*)*\Z")
_SI = {unit(text).dimension: text for text in NAMES if text not in ("1", TEMPERATURE)}


@dataclass(frozen=True)
class FmuVariable:
    """A variable of an FMU; its value reference is its place among all.

    Parameters
    ----------
    name : str              As hosts show it.
    kind, place : int       What it stands for in the library.
    causality : str         parameter, input, output, local or independent.
    dimension : tuple       Exponents of metre, kilogram, second, ampere and kelvin.
    start : float or None   Its value before anything happens; None where it follows from others. [SI]
    bounds : tuple          Lowest and highest, None for none. [SI]
    description : str
    of : int                The state whose rate it is; -1.
    """

    name: str
    kind: int
    place: int
    causality: str
    dimension: Dimension = DIMENSIONLESS
    start: float | None = None
    bounds: tuple[float | None, float | None] = (None, None)
    description: str = ""
    of: int = -1

    @property
    def state(self) -> bool:
        """Whether it is a continuous state."""
        return self.kind == TEMPERATURE_OF and self.start is not None

    @property
    def variability(self) -> str:
        """How it may change."""
        return "tunable" if self.causality == "parameter" else "discrete" if self.kind == MODE else "continuous"

    @property
    def initial(self) -> str:
        """How it is known at the start; empty where that goes without saying."""
        return "" if self.causality in ("input", "independent") else "calculated" if self.start is None else "exact"

    @property
    def unit(self) -> str:
        """Its unit as a name; empty where it has none, or one whose exponents are no integers."""
        return unit_name(self.dimension)


def structured(prefix: str, path: str) -> str:
    """Return a name by the structured convention: words and dots, anything else in quotes."""
    name = f"{prefix}.{path}"
    return name if _WORD.match(name) else prefix + ".'" + path.replace("\\", "\\\\").replace("'", "\\'") + "'"


def unit_name(dimension: Dimension) -> str:
    """Return the SI unit of a dimension; empty for none and where exponents are no integers."""
    if dimension == DIMENSIONLESS or any(e.denominator != 1 for e in dimension):
        return ""
    return _SI.get(dimension) or ".".join(f"{b}{e.numerator}" if e != 1 else b for b, e in zip(BASES, dimension, strict=True) if e)


@dataclass(frozen=True)
class Described:
    """What the description says of the whole.

    Parameters
    ----------
    title, identifier, token, text : str    Name; name of the library's file; what the data hold too; the first lines.
    seconds : float                         How long the scenario lasts. [s]
    sources : tuple of str                  Files to compile, below `sources/`.
    """

    title: str
    identifier: str
    token: str
    text: str
    seconds: float
    sources: tuple[str, ...]


def describe(what: Described, variables: Sequence[FmuVariable], version: str) -> str:
    """Return modelDescription.xml of FMI ``2.0`` or ``3.0``."""
    return _Third(what, variables).xml() if version == "3.0" else _Second(what, variables).xml()


class _Description(ABC):
    """What both versions share."""

    def __init__(self, what: Described, variables: Sequence[FmuVariable]) -> None:
        self.what, self.variables = what, variables

    def units(self, root: Xml.Element) -> None:
        """Write every unit that is used."""
        table = Xml.SubElement(root, "UnitDefinitions")
        for dimension in dict.fromkeys(v.dimension for v in self.variables):
            if not (name := unit_name(dimension)):
                continue
            of = Xml.SubElement(table, "Unit", name=name)
            Xml.SubElement(of, "BaseUnit", {b: str(e.numerator) for b, e in zip(BASES, dimension, strict=True) if e})
            if name == "K":
                Xml.SubElement(of, "DisplayUnit", name="degC", offset="-273.15")

    def number(self, v: FmuVariable) -> dict[str, str]:
        """Return the attributes of a number."""
        out = {"unit": v.unit} if v.unit else {}
        if v.dimension != DIMENSIONLESS and (v.kind == TEMPERATURE_OF or v.name.startswith("T.")):
            out["displayUnit"] = "degC"
        for key, bound in zip(("min", "max"), v.bounds, strict=True):
            if bound is not None:
                out[key] = repr(float(bound))
        if v.start is not None:
            out["start"] = repr(float(v.start))
        return out

    def common(self, v: FmuVariable) -> dict[str, str]:
        """Return the attributes of any variable."""
        out = {"name": v.name}
        if v.description:
            out["description"] = v.description
        out |= {"causality": v.causality, "variability": v.variability}
        return out | ({"initial": v.initial} if v.initial else {})

    def unknowns(self) -> tuple[list[int], list[int], list[int]]:
        """Return the places of outputs, of rates, and of what is computed at the start."""
        outputs = [k for k, v in enumerate(self.variables) if v.causality == "output"]
        rates = [k for k, v in enumerate(self.variables) if v.kind == RATE]
        first = [k for k, v in enumerate(self.variables) if v.kind == RATE or (v.causality == "output" and v.initial == "calculated")]
        return outputs, rates, first

    def xml(self) -> str:
        """Return the text."""
        root = self.tree()
        Xml.indent(root)
        return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"

    @abstractmethod
    def tree(self) -> Xml.Element:
        """Return the root of the description."""

    def head(self, **more: str) -> dict[str, str]:
        """Return the attributes of the root that FMI 2 and 3 share, and more."""
        return {
            "modelName": self.what.title,
            "description": self.what.text,
            "generationTool": "thermid",
            "variableNamingConvention": "structured",
            **more,
        }

    def experiment(self, root: Xml.Element) -> None:
        """Add the default experiment: start, stop and tolerance."""
        more = {"stopTime": repr(self.what.seconds)} if self.what.seconds > 0 else {}
        Xml.SubElement(root, "DefaultExperiment", {"startTime": "0.0", **more, "tolerance": "1e-8"})

    def categories(self, root: Xml.Element) -> None:
        """Add the categories of log messages."""
        table = Xml.SubElement(root, "LogCategories")
        for name in ("logStatusError", "logStatusDiscard"):
            Xml.SubElement(table, "Category", name=name)


class _Third(_Description):
    """The description of FMI 3.0."""

    def tree(self) -> Xml.Element:
        """Return the model description in this version of FMI: interfaces, units, variables, structure."""
        root = Xml.Element("fmiModelDescription", self.head(fmiVersion="3.0", instantiationToken=self.what.token))
        able = {"canGetAndSetFMUState": "true", "canSerializeFMUState": "true", "providesDirectionalDerivatives": "true"}
        Xml.SubElement(root, "ModelExchange", {"modelIdentifier": self.what.identifier, **able})
        Xml.SubElement(
            root, "CoSimulation", {"modelIdentifier": self.what.identifier, **able, "canHandleVariableCommunicationStepSize": "true"}
        )
        self.units(root)
        self.categories(root)
        self.experiment(root)
        table = Xml.SubElement(root, "ModelVariables")
        for k, v in enumerate(self.variables):
            more = {} if v.kind == MODE else self.number(v)
            more |= {"derivative": str(v.of)} if v.kind == RATE else {}
            Xml.SubElement(table, "Int32" if v.kind == MODE else "Float64", {**self.common(v), "valueReference": str(k), **more})
        structure = Xml.SubElement(root, "ModelStructure")
        outputs, rates, first = self.unknowns()
        indicators = [k for k, v in enumerate(self.variables) if v.kind == INDICATOR]
        for tag, places in (
            ("Output", outputs),
            ("ContinuousStateDerivative", rates),
            ("InitialUnknown", first),
            ("EventIndicator", indicators),
        ):
            for k in places:
                Xml.SubElement(structure, tag, valueReference=str(k))
        return root


class _Second(_Description):
    """The description of FMI 2.0."""

    def tree(self) -> Xml.Element:
        """Return the model description in this version of FMI: interfaces, units, variables, structure."""
        count = sum(v.kind == INDICATOR for v in self.variables)
        root = Xml.Element("fmiModelDescription", self.head(fmiVersion="2.0", guid=self.what.token, numberOfEventIndicators=str(count)))
        able = {"canGetAndSetFMUstate": "true", "canSerializeFMUstate": "true", "providesDirectionalDerivative": "true"}
        for tag in ("ModelExchange", "CoSimulation"):
            more = {"canHandleVariableCommunicationStepSize": "true"} if tag == "CoSimulation" else {}
            form = Xml.SubElement(root, tag, {"modelIdentifier": self.what.identifier, **able, **more})
            files = Xml.SubElement(form, "SourceFiles")
            for name in self.what.sources:
                Xml.SubElement(files, "File", name=name)
        self.units(root)
        self.categories(root)
        self.experiment(root)
        table = Xml.SubElement(root, "ModelVariables")
        for k, v in enumerate(self.variables):
            element = Xml.SubElement(table, "ScalarVariable", {**self.common(v), "valueReference": str(k)})
            if v.kind == MODE:
                Xml.SubElement(element, "Integer")
                continue
            more = {"derivative": str(v.of + 1)} if v.kind == RATE else {}
            Xml.SubElement(element, "Real", {**self.number(v), **more})
        structure = Xml.SubElement(root, "ModelStructure")
        for tag, places in zip(("Outputs", "Derivatives", "InitialUnknowns"), self.unknowns(), strict=True):
            if places:
                several = Xml.SubElement(structure, tag)
                for k in places:
                    Xml.SubElement(several, "Unknown", index=str(k + 1))
        return root


def build_description(identifier: str, sources: Sequence[str]) -> str:
    """Return buildDescription.xml of FMI 3.0: how the library is compiled for a platform that the FMU has none for."""
    root = Xml.Element("fmiBuildDescription", fmiVersion="3.0")
    build = Xml.SubElement(root, "BuildConfiguration", modelIdentifier=identifier)
    files = Xml.SubElement(build, "SourceFileSet", language="C++17")
    for name in sources:
        Xml.SubElement(files, "SourceFile", name=name)
    Xml.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"
