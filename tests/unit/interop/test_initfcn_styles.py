"""InitFcn scripts of our own in the styles that people write: read right, or every fault named in one run."""

from __future__ import annotations

import pytest

import thermid as td
from thermid.interop.initfcn import read_initfcn

READ: dict[str, tuple[str, dict[str, float]]] = {
    "head of a script": ("clear all; clc; close all\nm = 0.1; % [kg]", {"m": 0.1}),
    "head on lines": ("clear\nclose all\nclc\nformat long\nwarning off\nm = 2; % [kg]", {"m": 2.0}),
    "a structure": ("box.m = 1.2; % Mass [kg]\nbox.c = 900; % [J/(kg K)]\nbox.C = box.m*box.c; % [J/K]", {"box_C": 1080.0}),
    "a structure in a structure": (
        "s.pcb.k = 15; % [W/(m K)]\ns.pcb.t = 1.6e-3; % [m]\nkt = s.pcb.k*s.pcb.t % [W/K]",
        {"kt": 0.024},
    ),
    "a vector": ("P = [1.5 2 0.25]; % [W]\ntotal = P(1)+P(2)+P(3) % [W]", {"P_1": 1.5, "P_3": 0.25, "total": 3.75}),
    "a vector with commas": ("A = [0.01, 0.02]; % Areas [m^2]", {"A_1": 0.01, "A_2": 0.02}),
    "a column": ("C = [100; 250; 40]; % [J/K]", {"C_1": 100.0, "C_2": 250.0, "C_3": 40.0}),
    "a vector of expressions": ("L = 0.1; % [m]\nA = [L*L, 2*L*L]; % [m^2]", {"A_1": 0.01, "A_2": 0.02}),
    "a vector in a structure": ("h.side = [4 6]; % [W/(m^2 K)]\nmean_h = (h.side(1)+h.side(2))/2 % [W/(m^2 K)]", {"mean_h": 5.0}),
    "a root": ("A = 0.04; % [m^2]\nside = sqrt(A); % [m]", {"side": 0.2}),
    "a root of a sum": ("a = 3;\nb = 4;\nc = sqrt(a^2 + (b)^2);", {"c": 5.0}),
    "a root in a root": ("x = sqrt(sqrt(16));", {"x": 2.0}),
    "elementwise signs": ("a = 2;\nb = a.^2 .* 3 ./ 4;", {"b": 3.0}),
    "a comment of MATLAB on lines above": ("% all masses in kg\n\nm = 2; % [kg]", {"m": 2.0}),
    "a comment of Octave": ("m = 2; # mass [kg]", {"m": 2.0}),
    "a line that goes on": ("C = 900 ...\n  * 1.2; % [J/K]", {"C": 1080.0}),
    "two values on a line": ("m = 1; c = 900; % [kg] [J/(kg K)]", {"m": 1.0, "c": 900.0}),
    "a block comment": ("%{\nold: m = 3;\n%}\nm = 1; % [kg]", {"m": 1.0}),
    "heads of sections": (
        "%% Parameters\n% tested\n\n%% Drive\nDrive.A  = 2+2.5+5;     % [m^2] surface\nsb=5.67*(10^-8);    % [W/m^2/K^4]",
        {"Drive_A": 9.5, "sb": 5.67e-8},
    ),
    "halves and powers of fields": ("p.r = 0.008/2; % inner radius [m]\np.V = pi*(p.r^2)*0.198; % [m^3]", {"p_V": 9.952565526572465e-06}),
    "tabs, lines of Windows, text behind a unit": ("m\t=\t54e-3;\t% [kg] measured, see [3]\r\nn = 2*m; % [kg]\r\n", {"n": 0.108}),
    "degrees Celsius": ("T0 = 22; % Start [degC]", {"T0": 22.0}),
    "powers of ten": ("k = 1.38e-23;\nt = 2E3; % [s]", {"k": 1.38e-23, "t": 2000.0}),
    "pi": ("d = 0.01; % [m]\nA = pi*d^2/4; % [m^2]", {"A": 7.853981633974483e-05}),
    "no semicolons": ("m = 1 % [kg]\nc = 900 % [J/(kg K)]", {"m": 1.0, "c": 900.0}),
    "a column over lines": ("C = [100\n  250; % board\n  40]; % [J/K]\nP = [1 ...\n 2]; % [W]", {"C_1": 100.0, "C_3": 40.0, "P_2": 2.0}),
    "a temperature made absolute in place": (
        "K = 273.15; % [K]\nt0 = 23; % [degC]\nt0 = t0 + K; % [K]\nT = t0; % [K]",
        {"t0": 296.15, "T": 296.15},
    ),
    "a value that is set again": (
        "h = 5; % [W/(m^2 K)]\nA = 0.1; % [m^2]\nG1 = h*A; % [W/K]\nh = 12; % [W/(m^2 K)]\nG2 = h*A; % [W/K]",
        {"G1": 0.5, "h": 12.0, "G2": 1.2},
    ),
    "functions": ("f = 1 - exp(-3*0.5); % [-]\nh = max(abs(-5), min(12, (8))); % [W/(m^2 K)]", {"f": 0.7768698398515702, "h": 8.0}),
    "functions in a vector": ("A = [0.1*(0.2 + 0.05), max(0.02, (0.03))]; % [m^2]", {"A_1": 0.025, "A_2": 0.03}),
    "printed on the way": (
        "m = 1.2; % [kg]\nfprintf('m = %.1f; done\\n', m); disp([\"C, % \", num2str((m))]);\nfigure; plot(t,y,'r')\nn = 2; % [kg]",
        {"m": 1.2, "n": 2.0},
    ),
    "a script of Octave": ('1;\nm = 0.2 # [kg]\nprintf("%g\\n", m);', {"m": 0.2}),
    "a conductivity called lambda": (
        "lambda = 0.2; % [W/(m K)]\nd = 1e-3; % [m]\nG = lambda*0.01/d; % [W/K]",
        {"lambda_": 0.2, "G": 2.0},
    ),
    "elements one by one": ("q.P(1) = 3; % [W]\nq.P(2) = q.P(1)*1.5; % [W]\nt = q.P(1)+q.P(2); % [W]", {"q_P_2": 4.5, "t": 7.5}),
    "a script with global names": ("%% Init\nclear all; close all; clc\nglobal m c\n%% Box\nm = 1.2; % [kg]", {"m": 1.2}),
    "comments in German": (
        "% Kennwerte des Gehäuses\nm_Gehaeuse = 1.2; % Masse des Gehäuses [kg], gewogen\nc = 9e2; % spez. Wärme [J/(kg K)]\n"
        "C = m_Gehaeuse ...  % Kapazität\n  * c; % [J/K]",
        {"m_Gehaeuse": 1.2, "C": 1080.0},
    ),
    "comments in Portuguese": (
        "clear; clc;\n%% Parâmetros\nmassa = 850e-3; % massa do dissipador [kg]\narea = 1.5e-2; % área de convecção [m^2]\n"
        "fprintf('área: %g\\n', area);\nPot = 12; % potência [W]",
        {"massa": 0.85, "area": 0.015, "Pot": 12.0},
    ),
    "one element": ("P = [3]; % [W]\nQ = P(1)*2 % [W]", {"P_1": 3.0, "Q": 6.0}),
}
ASKED: dict[str, tuple[str, str]] = {
    "a unit without brackets": ("m = 2; % mass, kg", "(is it [kg]?)"),
    "a unit in parentheses": ("h = 6; % film (W/(m^2 K))", "(is it [W/(m^2 K)]?)"),
    "a unit with parentheses": ("sigma = 5.67e-8; % radiation, W/(m^2*K^4)", "(is it [W/(m^2*K^4)]?)"),
    "degrees in a ratio": ("R = 1.5; % [°C/W]", "'[°C/W]' "),
    "no unit": ("n = 3;", "1: 'n' "),
    "a product of plain numbers": ("n = 2; % [-]\nC = 3*n; % capacity, J/K", "(is it [J/K]?)"),
    "a unit that is none": ("m = 2; % [kilo]", "'[kilo]' "),
}
REFUSED: dict[str, tuple[str, list[str]]] = {
    "calls and loops": (
        "a = 1; p = 2; q = 3; r = 4; s = 5;\nb = interp1(x, y, 3);\nfor k = 1:3\n  c = k;\nend\nd = 'steel';",
        ["script:2: ", "script:6: "],
    ),
    "a fault does not spread": ("m = 1;\nn = 2;\na = load('x.mat');\nb = 2*a;\nc = b + m;\nd = zeros(3);", ["script:3: ", "script:6: "]),
    "a row of a matrix": (
        "a = 1;\nb = 2;\nc = 3 4;\nK = [1 2; 3 4];\nL = [1, 2; 3, 4];\nd = [a, b 4];",
        ["script:3: '3 4'", "script:4: '1 2'", "script:5: '[1, 2; 3, 4]'", "script:6: 'b 4'"],
    ),
    "few values": ("a = sind(1);\nb = sind(2);\nc = 3", ["script:1: ", "script:2: "]),
    "two names that become one": ("acc.m = 1;\nacc_m = 2;", ["script:2: 'acc.m' and 'acc_m' both become 'acc_m'"]),
    "conditions, tables, functions": (
        "if ~exist('m', 'var')\n  m = 3;\nend\nload('a.mat');\nk = interp1(T, k, 3);\nf = @(x) x + 1;\nS = struct(1);\n[a, b] = size(S);",
        [f"script:{line}: " for line in (4, 5, 6, 7, 8)],
    ),
    "a branch that does not end": (
        "a = sind(1);\nm = 1; % [kg]\nfor k = 1:3\n  if k > 1, m = 2; end\n",
        ["script:1: ", "script:3: the branch or loop that begins here has no 'end'"],
    ),
    "an end too many": ("m = 1; % [kg]\nif m > 2, m = 2; end\nend", ["script:3: 'end' is not of the form"]),
    "clear too late": ("a = 1;\nn = 2;\nclear a\nb = sind(2);", ["script:3: 'clear a' is not of the form", "script:4: "]),
}


@pytest.mark.parametrize("style", READ)
def test_a_script_is_read(style: str) -> None:
    script, wanted = READ[style]
    found = read_initfcn(script)
    assert {name: found.numbers[name] for name in wanted} == pytest.approx(wanted)
    assert not [r for r in found.remarks if "no unit" in r and "[" in script.splitlines()[int(r.split()[1].rstrip(":")) - 1]]


@pytest.mark.parametrize("style", ASKED)
def test_a_value_without_a_unit_is_asked_about(style: str) -> None:
    script, question = ASKED[style]
    (remark,) = read_initfcn(script).remarks
    assert question in remark


def test_what_is_done_with_a_value_before_it_is_set_again_is_said() -> None:
    found = read_initfcn(READ["a value that is set again"][0])
    assert (found.parameters["G1"].text, found.parameters["G1"].basis) == ("0.5 [W/K]", "h*A in the script")
    assert found.parameters["G2"].text == "h*A"
    assert [r for r in found.remarks if "4: 'h' is set" in r]


BRANCHES: dict[str, tuple[str, str, dict[str, float], list[str]]] = {
    "exist": (
        "m = 1; % [kg]\nc = 900; % [J/(kg K)]\nC0 = m*c; % [J/K]\nif exist('hot', 'var') && hot == 1\n  m = 2; % [kg]\nelse\n"
        "  if c > 3, c1 = interp1(x, y, 3); end\nend\nC = m*c; % [J/K]\nD = C + c1;",
        "lines 4 to 8 ",
        {"c": 900.0, "C0": 900.0},
        ["m", "c1", "C", "D"],
    ),
    "a loop over a vector": (
        "P = [1 2]; % [W]\nfor k = 1:2\n  P(k) = 2*k;\nend\nq = P(1); % [W]\nm = 1; % [kg]",
        "lines 2 to 4 ",
        {"m": 1.0},
        ["k", "P", "q"],
    ),
    "set again below": ("if a == 1, b = 2; end\nb = 3; % [W]\nq = 2*b; % [W]", "line 1 is ", {"b": 3.0, "q": 6.0}, []),
    "a choice by name": (
        "p.h = 5; % [W/(m^2 K)]\nswitch mode\n  case {'fan', 'duct'}\n    [p.h, v] = deal(20, 3);\n  otherwise\n    p.h = 6;\nendswitch\n"
        "A = 0.1; % [m^2]\nG = p.h*A; % [W/K]",
        "lines 2 to 7 ",
        {"A": 0.1},
        ["p_h", "v", "G"],
    ),
    "a field with an index": ("q.P(2) = 3; % [W]\nwhile x < 2\n  q.P(2) = 4;\nend\nn = 2; % [-]", "lines 2 to 4 ", {"n": 2.0}, ["q_P"]),
}


@pytest.mark.parametrize("style", BRANCHES)
def test_what_depends_on_a_branch_is_left_out_and_listed(style: str) -> None:
    script, lines, numbers, names = BRANCHES[style]
    found = read_initfcn(script)
    assert found.numbers == pytest.approx(numbers)
    assert found.parameters.keys() == numbers.keys()
    assert [r for r in found.remarks if r.startswith(lines)]
    assert [r for r in found.remarks if f": {', '.join(names)}. Write" in r] == ([found.remarks[0]] if names else [])


@pytest.mark.parametrize("end", ["end", "endfunction", ""])
def test_a_function_around_a_script_takes_nothing_from_it(end: str) -> None:
    found = read_initfcn(f"function init()\na = 2; % [kg]\nif a\n b = 3;\nend\nc = 2*a; % [kg]\n{end}\n")
    assert found.numbers == {"a": 2.0, "c": 4.0}


@pytest.mark.parametrize("first", ["function [t, T] = f(t, p)", 'package box "Box"', '<svg class="map">'])
def test_a_file_of_another_kind_is_refused_in_one_sentence(first: str) -> None:
    with pytest.raises(td.ThermidError) as caught:
        read_initfcn(f"% written\n{first};\nx = zeros(3);\n[y, z] = size(x);\nmodel q;")
    assert str(caught.value).startswith("script:2: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("style", REFUSED)
def test_every_fault_of_a_script_is_named_in_one_run(style: str) -> None:
    script, places = REFUSED[style]
    with pytest.raises(td.ThermidError) as caught:
        read_initfcn(script)
    lines = str(caught.value).split("\n  ")
    assert len(lines) == len(places)
    assert all(line.startswith(place) for line, place in zip(lines, places, strict=True)), lines
