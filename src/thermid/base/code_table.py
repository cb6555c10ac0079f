"""The table of codes: what each stands for. It is read by people, tests and the script of docs/codes.md; no run needs it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple


class CodeMeaning(NamedTuple):
    """What a code stands for: kinds of text that have it (error, warning, remark), why the text appears, and what to do."""

    kind: str
    cause: str
    cure: str


SUBJECTS: Final[Mapping[str, str]] = {
    "bench": "The bench: boards, sensors, loggers",
    "campaign": "Campaigns",
    "cap": "Limits of size",
    "command": "The command line",
    "delivery": "Deliveries",
    "element": "Elements that a model may lack",
    "expression": "Expressions",
    "extra": "Optional parts",
    "file": "Files that are read",
    "fit": "Fits",
    "fleet": "Fleets of units",
    "fmu": "FMUs of others",
    "htc": "Coefficients of a settled test",
    "import": "Files of other tools",
    "model": "Models",
    "name": "Names",
    "output": "Files that are written",
    "physics": "Laws and correlations",
    "plan": "Test plans",
    "prediction": "Predictions",
    "record": "Logs and records",
    "result": "Results",
    "run": "Runs",
    "studio": "The studio",
    "unit": "Units",
    "value": "Values and arguments",
    "verdict": "Verdicts",
}
"""First word of a code -> what it is about."""

CODES: Final[Mapping[str, CodeMeaning]] = {
    "bench.board-clock": CodeMeaning(
        "remark",
        "The clock of a board runs slower or faster than that of the host.",
        "Nothing; times are corrected.",
    ),
    "bench.damaged-lines": CodeMeaning(
        "remark",
        "Lines of a log have a wrong checksum and were dropped.",
        "Check cable and supply where there are many.",
    ),
    "bench.duplicate-lines": CodeMeaning(
        "remark",
        "A log has lines twice; one counts.",
        "Nothing.",
    ),
    "bench.log": CodeMeaning(
        "error",
        "The file into which a logger writes cannot be opened or written, or another logger writes to it.",
        "Give another file or place; the message names it.",
    ),
    "bench.missing-lines": CodeMeaning(
        "remark",
        "Numbers of lines that a board sent are not in its log.",
        "Check cable and host where there are many.",
    ),
    "bench.no-board": CodeMeaning(
        "error",
        "No board or no sensor answers, several boards do, or the port was disconnected.",
        "Check plug, wire and supply, or name the port: `--port`.",
    ),
    "bench.protocol": CodeMeaning(
        "error",
        "A line of a board or of its log is not of the protocol, or its checksum does not fit.",
        "Check the cable and the firmware; lines that are cut are not read.",
    ),
    "bench.resets": CodeMeaning(
        "remark",
        "The board started again while its log was written.",
        "Check its supply.",
    ),
    "bench.sensor": CodeMeaning(
        "error",
        "A sensor of the bench has a mistyped identity, an impossible offset or reading, or made the board cut its heaters.",
        "Check the sensor and its wire; the message gives the reading.",
    ),
    "bench.simulated-clock": CodeMeaning(
        "remark",
        "The clock of a board runs many times as fast as that of the host, so the board is simulated.",
        "Nothing; its own times are used.",
    ),
    "bench.sorted-lines": CodeMeaning(
        "remark",
        "Lines of a log were sorted, as their order was not the one in which they were sent.",
        "Nothing.",
    ),
    "bench.start-placed": CodeMeaning(
        "remark",
        "The start of a session is not in the log, or lies before the end of the one before; it follows that directly.",
        "Check the clock of the host.",
    ),
    "bench.starts": CodeMeaning(
        "remark",
        "The logger was started several times on one log.",
        "Nothing.",
    ),
    "campaign.not-from-file": CodeMeaning(
        "error",
        "The request needs the campaign's file, and this campaign was made in Python.",
        "Write the campaign into a file and pass that.",
    ),
    "campaign.not-run": CodeMeaning(
        "error",
        "The request needs the results of a stage that was not run.",
        "Run the stage first.",
    ),
    "campaign.record-used": CodeMeaning(
        "error",
        "A record that a fit used is asked to validate it.",
        "Use a record that no fit used.",
    ),
    "campaign.refused": CodeMeaning(
        "error",
        "Stages, records and levels of a campaign do not fit together.",
        "Change the place that the message names.",
    ),
    "campaign.verdict-before-refit": CodeMeaning(
        "remark",
        "A verdict judges the values of a stage, and a later stage fits the same deck.",
        "Nothing, if the earlier values are meant; otherwise name the later stage in `model`.",
    ),
    "cap.exceeded": CodeMeaning(
        "error",
        "A file, a text or a request goes beyond a limit of the table of caps, which lies far above usual sizes.",
        "Ask for less, or raise the limit: `THERMID_CAPS=NAME=NUMBER`, the name is in the message.",
    ),
    "cap.no-number": CodeMeaning(
        "error",
        "`THERMID_CAPS` gives a limit that is not a number above zero.",
        "Write for example `unpacked=1e9`.",
    ),
    "command.not-understood": CodeMeaning(
        "error",
        "An option or argument of a command is unknown, missing, or has a value of another kind.",
        "See `thermid COMMAND --help`.",
    ),
    "delivery.differs": CodeMeaning(
        "error",
        "A file or an expected value of a delivery is not the one that was delivered.",
        "Ask for the delivery again, or find what changed.",
    ),
    "element.common-mass": CodeMeaning(
        "remark",
        "A mass that carries several parts may be missing in the model.",
        "See what was found for it and whether it is possible; add it if so.",
    ),
    "element.contact": CodeMeaning(
        "remark",
        "A contact between two parts may be missing in the model.",
        "Look whether they touch, or share a cable or a plate.",
    ),
    "element.growing-power": CodeMeaning(
        "remark",
        "A power may grow with temperature, which the model does not state.",
        "Give its temperature coefficient, or log it.",
    ),
    "element.inner-mass": CodeMeaning(
        "remark",
        "The heat of a load may enter a mass inside of the part.",
        "See what was found for it and whether it is possible; add it if so.",
    ),
    "element.lag": CodeMeaning(
        "remark",
        "A sensor may lag behind its part.",
        "Give its time constant, or fit it.",
    ),
    "element.late-commands": CodeMeaning(
        "remark",
        "Commands may act later than they are logged.",
        "Give `delay` in the record.",
    ),
    "element.natural-convection": CodeMeaning(
        "remark",
        "A coefficient may grow with the difference of temperatures, as in still air.",
        "Give a law with an exponent.",
    ),
    "element.one-direction": CodeMeaning(
        "remark",
        "A coupling may depend on the direction of the heat.",
        "Look for a stream, or a joint that opens.",
    ),
    "element.radiation": CodeMeaning(
        "remark",
        "Radiation may be missing in the model.",
        "Give an emissivity.",
    ),
    "element.second-mass": CodeMeaning(
        "remark",
        "A part may have a second mass behind a resistance.",
        "See what was found for it and whether it is possible; add it if so.",
    ),
    "element.settling-power": CodeMeaning(
        "remark",
        "A power may settle after it is switched on.",
        "Log it.",
    ),
    "element.shell": CodeMeaning(
        "remark",
        "A mass may lie between a part and its surroundings.",
        "See what was found for it and whether it is possible; add it if so.",
    ),
    "element.wrong-clock": CodeMeaning(
        "remark",
        "The offset of a joined log may be wrong.",
        "Give another offset, or leave it to the fit.",
    ),
    "expression.decimal-comma": CodeMeaning(
        "error",
        "A number has a decimal comma.",
        "Write a decimal point.",
    ),
    "expression.exponent-not-plain": CodeMeaning(
        "error",
        "An exponent has a unit, or a quantity with a unit is raised to a power that is not constant.",
        "Divide by a quantity of the same unit first, or write the exponent as a number.",
    ),
    "expression.mixed-dimensions": CodeMeaning(
        "error",
        "Quantities of different kinds are added or compared, or `exp()` or `log()` has an argument with a unit.",
        "Check which parameter has the wrong unit.",
    ),
    "expression.no-finite-value": CodeMeaning(
        "error",
        "The arithmetic divides by zero, or its value is too large.",
        "Correct the numbers.",
    ),
    "expression.not-arithmetic": CodeMeaning(
        "error",
        "The text is more than arithmetic over numbers, names and the functions of the manual, or has a misplaced sign.",
        "Write a number with its unit in brackets, `2.5 [W]`, or names with `+ - * / **`.",
    ),
    "expression.scale-in-arithmetic": CodeMeaning(
        "error",
        "A number in degC or degF stands inside arithmetic, where it could be a temperature or a difference.",
        "Write it in [K], or define a parameter for it.",
    ),
    "expression.unit-misplaced": CodeMeaning(
        "error",
        "A unit in brackets stands elsewhere than at the end of pure numbers or after a number.",
        "Write `(0.5 + 1) [m]`, or `area + 2 [cm^2]`; names have their own units.",
    ),
    "extra.no-browser": CodeMeaning(
        "error",
        "Printing a page as PDF needs an installed Chromium, Chrome or Edge, and none was found or none answered.",
        "Install one, or write the page as HTML.",
    ),
    "extra.not-installed": CodeMeaning(
        "error",
        "An optional package, or an optional part of thermid, is not installed.",
        "Run the command of the message.",
    ),
    "file.another-kind": CodeMeaning(
        "error",
        "The file is of another kind than what is read here, such as a campaign instead of a deck.",
        "Give the file of the kind that the message asks for.",
    ),
    "file.changed-by-hand": CodeMeaning(
        "error",
        "Two places of a file that thermid wrote contradict each other.",
        "Run the command again that wrote it.",
    ),
    "file.key-missing": CodeMeaning(
        "error",
        "A key is missing that every file of this kind has.",
        "Add it.",
    ),
    "file.not-a-file": CodeMeaning(
        "error",
        "A folder, a pipe or a device stands where a file is needed.",
        "Give the path of a file.",
    ),
    "file.not-found": CodeMeaning(
        "error",
        "There is no file of that name.",
        "Check name and folder; the message gives the nearest name.",
    ),
    "file.not-one-of": CodeMeaning(
        "error",
        "A word stands where one of a few others is allowed.",
        "Take one of the words of the message.",
    ),
    "file.not-text": CodeMeaning(
        "error",
        "The file is not text in UTF-8.",
        "Save it as UTF-8.",
    ),
    "file.not-valid": CodeMeaning(
        "error",
        "The text is not valid TOML or JSON.",
        "Correct the line of the message; put texts, and numbers with units, in quotes.",
    ),
    "file.outside-project": CodeMeaning(
        "error",
        "A deck names a file outside the folder of the project.",
        "Copy the file into the project, or put `thermid.toml` into the folder that holds both.",
    ),
    "file.refused-by-system": CodeMeaning(
        "error",
        "The system did not let a file be read or written.",
        "Check path and permissions.",
    ),
    "file.silent-pipe": CodeMeaning(
        "error",
        "Nothing came out of a pipe in time.",
        "Give the path of a file.",
    ),
    "file.unknown-key": CodeMeaning(
        "error",
        "A key stands where this kind of file has no such key.",
        "Take the nearest one, which the message gives, or remove it.",
    ),
    "file.wrong-kind": CodeMeaning(
        "error",
        "A text, number, list or table stands where one of the others is needed.",
        "Write what the message requests.",
    ),
    "file.wrong-value": CodeMeaning(
        "error",
        "A value has the right kind and breaks a rule of its place.",
        "Follow the message.",
    ),
    "fit.above-slow-fans": CodeMeaning(
        "remark",
        "A fitted coefficient is above that of slow fans.",
        "Look for heat by a mount or a lead, a larger area, or less power.",
    ),
    "fit.above-still-air": CodeMeaning(
        "remark",
        "A fitted coefficient is above that of still air, and not above that of slow fans.",
        "Look for moving air, heat by a mount or a lead, a larger area, or less power.",
    ),
    "fit.below-still-air": CodeMeaning(
        "remark",
        "A fitted coefficient is below that of still air over its area.",
        "Count faces that convect only, and check the power.",
    ),
    "fit.chains-too-short": CodeMeaning(
        "error",
        "The chains of a posterior move too slowly along a direction for an interval.",
        "Give more steps, a prior, or another record.",
    ),
    "fit.less-than-its-weight": CodeMeaning(
        "remark",
        "A fitted capacitance is below that of any solid of the weight given.",
        "Look for a mass that follows more slowly, or more power.",
    ),
    "fit.model-fails": CodeMeaning(
        "error",
        "The model cannot be run at any value that a search tries, or the search ends without a result.",
        "Start nearer, or widen the range that the message names.",
    ),
    "fit.more-than-its-weight": CodeMeaning(
        "remark",
        "A fitted capacitance is above that of any solid of the weight given.",
        "Look for a mass that was not weighed, or less power.",
    ),
    "fit.needs-session": CodeMeaning(
        "error",
        "The request needs a fit that was made in this session, since files do not hold its records.",
        "Repeat the fit.",
    ),
    "fit.not-determined": CodeMeaning(
        "error",
        "Readings do not determine what is asked of them.",
        "Fix the value, give it a prior, or log a test that shows it.",
    ),
    "fit.not-possible": CodeMeaning(
        "error",
        "A method needs more than this fit has: sensors, parameters, noise or a loss.",
        "Give what the message names, or take another method.",
    ),
    "fit.nothing-free": CodeMeaning(
        "error",
        "Nothing is free to be fitted, or what is listed is not free.",
        "Name free values of the model.",
    ),
    "fit.stopped": CodeMeaning(
        "error",
        "The interrupt key ended a fit that others rest on.",
        "Start it again; the message has the best values so far.",
    ),
    "fit.takes-long": CodeMeaning(
        "warning",
        "A fit goes on with steps that take long.",
        "Wait, or end it by the interrupt key with the best values so far.",
    ),
    "fleet.covariate": CodeMeaning(
        "error",
        "A covariate of a fleet is missing for a unit, the same for all, or part text and part number.",
        "Give it for every unit in one kind, or leave it out.",
    ),
    "fleet.no-table": CodeMeaning(
        "error",
        "A campaign has no table [fleet].",
        "Write one with the units and their records.",
    ),
    "fleet.not-identifiable": CodeMeaning(
        "error",
        "All logs of a fleet together do not determine a mean.",
        "Fix one of the values named, or add a record.",
    ),
    "fleet.nothing-free": CodeMeaning(
        "error",
        "A fleet has no value in which units differ.",
        "Name values in `free`.",
    ),
    "fleet.record-twice": CodeMeaning(
        "error",
        "A record is given to two units of a fleet.",
        "Give each record to one unit.",
    ),
    "fleet.second-clock": CodeMeaning(
        "error",
        "A log of a fleet has a second clock whose offset or rate is a range.",
        "Give its offset and rate.",
    ),
    "fleet.too-small": CodeMeaning(
        "error",
        "A fleet has fewer than three units.",
        "Add units, or fit each by itself.",
    ),
    "fleet.units-differ": CodeMeaning(
        "error",
        "Units of a fleet have different free values.",
        "Use one model and one list of free values.",
    ),
    "fmu.changed": CodeMeaning(
        "error",
        "The file of an FMU is another than when it was read and trusted.",
        "Read it again.",
    ),
    "fmu.ended": CodeMeaning(
        "error",
        "The program in an FMU crashed, ended its process, did not return, or sent no answer; the message names the call.",
        "Tell who made the FMU, or try other values. A call that needs more time: `THERMID_CAPS=call=NUMBER`, more memory: `memory`.",
    ),
    "fmu.not-trusted": CodeMeaning(
        "error",
        "An FMU is a program with the rights of the user, and this one was not allowed to run yet.",
        "If you trust who made it: `--trust`, or `fmu_model(path, trust=True)`, once.",
    ),
    "htc.agrees": CodeMeaning(
        "remark",
        "The measured coefficient and that of correlations differ by less than their errors.",
        "Nothing.",
    ),
    "htc.area-of-other-faces": CodeMeaning(
        "remark",
        "The area given is not that of the box given.",
        "Correct one of them.",
    ),
    "htc.differs": CodeMeaning(
        "remark",
        "The measured coefficient or the time of settling is not the one that correlations, mass and area give.",
        "Check the causes of the message.",
    ),
    "import.not-understood": CodeMeaning(
        "error, remark",
        "A statement of another tool's file cannot be read.",
        "Correct or remove the line that the message names.",
    ),
    "model.capacitance-not-positive": CodeMeaning(
        "error",
        "A node has a mass or capacitance, and stores no heat or infinitely much.",
        "Give values above zero; a massless node has neither key.",
    ),
    "model.carrier-unstated": CodeMeaning(
        "remark",
        "Constant coefficients carry most of the heat out, and nothing says whether air, a fan or a solid carries it.",
        "State `carried_by`.",
    ),
    "model.element-not-supported": CodeMeaning(
        "error",
        "What is asked does not apply to an element of this model, such as a control, a schedule or a law that is not linear.",
        "Leave the element out, or ask otherwise as the message says.",
    ),
    "model.heat-cannot-leave": CodeMeaning(
        "warning",
        "A load heats a part from which no heat can leave.",
        "Add a conductor.",
    ),
    "model.incomplete": CodeMeaning(
        "warning",
        "An import could not take something over, such as heat rates; the deck states it under `incomplete`.",
        "Add what is missing to the deck and remove `incomplete`.",
    ),
    "model.instance-differs": CodeMeaning(
        "remark",
        "A value is set for one instance, or cut from its twins, so that a fit estimates it apart.",
        "Nothing, if that is meant.",
    ),
    "model.law-refused": CodeMeaning(
        "error",
        "A table, a function or a control of the model breaks a rule of its kind.",
        "Correct the point or key that the message names.",
    ),
    "model.load-without-effect": CodeMeaning(
        "warning",
        "A load heats what has a given temperature.",
        "Remove it, or give the node a mass.",
    ),
    "model.massless-undefined": CodeMeaning(
        "error",
        "A massless node has no conductance to anything with a temperature.",
        "Add a conductor, or a mass.",
    ),
    "model.needs-gas-law": CodeMeaning(
        "error",
        "A surface, gap or stream has no law for the gas or vacuum of this run.",
        "Give the emissivity, the coefficient or the fluid that the message names.",
    ),
    "model.negative-conductance": CodeMeaning(
        "error",
        "Heat would flow from cold to hot.",
        "Check signs and areas.",
    ),
    "model.no-convection": CodeMeaning(
        "warning",
        "A surface has an emissivity and nothing on convection, so a run with gas is refused.",
        "Give `htc`, or `htc = 0`.",
    ),
    "model.no-emissivity": CodeMeaning(
        "remark",
        "A surface has convection and no emissivity, so its radiation is not in the model.",
        "Give an emissivity or a finish.",
    ),
    "model.no-path-to-boundary": CodeMeaning(
        "warning, remark",
        "Heat of a part reaches no boundary, so that it warms or cools without limit.",
        "Connect it to a boundary, if that is not meant.",
    ),
    "model.nothing-to-solve": CodeMeaning(
        "error",
        "All temperatures are given.",
        "Remove a boundary or a prescribed node.",
    ),
    "model.radiates-into-gas": CodeMeaning(
        "error",
        "A surface radiates to a node that is gas.",
        "Name the wall that it sees, as the message shows.",
    ),
    "model.radiation-not-split": CodeMeaning(
        "warning, remark",
        "A coefficient includes radiation, which does not go where the surface looks, or stays in vacuum.",
        "Split it by `td.inference.split`, or give `htc` and `emissivity`.",
    ),
    "model.refused": CodeMeaning(
        "error",
        "A name, value or law of the model is refused when it is put together.",
        "Follow the message.",
    ),
    "model.self-reference": CodeMeaning(
        "error",
        "A file, a name, a value or an element refers to itself.",
        "Break the loop that the message shows.",
    ),
    "model.stream-unfed": CodeMeaning(
        "warning, remark",
        "A stream leaves a gas node that no stream enters, so that it carries no heat.",
        "Add the inlet stream, and name the fluid of both.",
    ),
    "model.streams-differ": CodeMeaning(
        "error",
        "Streams of two gases, or of volume and of mass, meet in one node.",
        "Write them alike.",
    ),
    "model.streams-unbalanced": CodeMeaning(
        "error",
        "What streams bring into a node is not what they take out.",
        "Correct a flow, or add the missing stream.",
    ),
    "model.test-only": CodeMeaning(
        "remark",
        "Elements of the bench are marked `test_only` and left out of flight models.",
        "Nothing.",
    ),
    "model.test-only-needed": CodeMeaning(
        "warning",
        "The model fails without the elements marked `test_only`.",
        "Mark what depends on them `test_only` too.",
    ),
    "model.unconnected": CodeMeaning(
        "warning",
        "Nothing is connected to a node or need.",
        "Connect it, or remove it.",
    ),
    "model.unused": CodeMeaning(
        "warning",
        "Nothing uses a parameter or control.",
        "Remove it, or check the name where it should be used.",
    ),
    "model.value-far-from-others": CodeMeaning(
        "warning",
        "A value is far from those of the same field elsewhere in the model.",
        "Check its unit and digits.",
    ),
    "model.value-overridden": CodeMeaning(
        "remark",
        "A value where a part is used hides that of the part's deck.",
        "Nothing, if that is meant.",
    ),
    "model.value-unusual": CodeMeaning(
        "warning",
        "A value is possible and unlikely: an exchange factor above 1, an exponent outside 0 to 1.",
        "Check it.",
    ),
    "model.values-shared": CodeMeaning(
        "remark",
        "Several instances of a part share values, which a fit changes together.",
        "Nothing, or cut an instance.",
    ),
    "model.values-without-source": CodeMeaning(
        "remark",
        "Some values have no source, while others have one.",
        "Give `source`.",
    ),
    "model.view-factors": CodeMeaning(
        "error",
        "View factors are negative, not reciprocal, do not sum to one, or a face sees the back of another.",
        "Correct the factor, area or place that the message names.",
    ),
    "name.not-valid": CodeMeaning(
        "error",
        "A name has characters that names may not have, or is a reserved word.",
        "Use letters, digits and _, beginning with a letter.",
    ),
    "name.taken": CodeMeaning(
        "error",
        "One name stands for two things that must differ.",
        "Rename or remove one of them.",
    ),
    "name.unknown": CodeMeaning(
        "error",
        "A name stands here that does not exist in its place.",
        "Take the nearest name, which the message gives, or one of its list.",
    ),
    "output.changed-meanwhile": CodeMeaning(
        "error",
        "A file, or what was to be written into it, changed since it was opened or shown.",
        "Open the file again, and look at the difference again.",
    ),
    "output.edit-refused": CodeMeaning(
        "error",
        "An edit of a deck takes away what is not there, changes nothing, or cannot be written without touching other lines.",
        "Edit the text of the deck.",
    ),
    "output.not-expressible": CodeMeaning(
        "error",
        "The format that is written has nothing for an element of the model.",
        "Take another format (an FMU has every law), or change the element.",
    ),
    "output.over-another-file": CodeMeaning(
        "error",
        "The file exists, and thermid did not write it as this kind, or it was changed since.",
        "Give another name, or `--force`.",
    ),
    "output.over-input": CodeMeaning(
        "error",
        "The file to write is an input of the same command.",
        "Give another name.",
    ),
    "output.wrong-ending": CodeMeaning(
        "error",
        "The ending of the name promises another format than the one that is written.",
        "Give a name with the ending of the message.",
    ),
    "physics.not-one-temperature": CodeMeaning(
        "warning, remark",
        "The Biot number of a part is above 0.1, so that one node does not describe its inside.",
        "Split it into more nodes.",
    ),
    "physics.not-possible": CodeMeaning(
        "error",
        "The conditions or values cannot exist, or no formula covers them.",
        "Check values and units that the message gives.",
    ),
    "physics.outside-range": CodeMeaning(
        "warning, remark",
        "A formula is used outside the range in which its source vouches for it.",
        "Take the formula that the message names, or stay inside.",
    ),
    "plan.incomplete": CodeMeaning(
        "error",
        "A test plan lacks what must be stated before a log is read.",
        "State it.",
    ),
    "prediction.error-not-followed": CodeMeaning(
        "error",
        "The elements of a fit cannot be followed: it joins levels, is somebody else's program, or does not hold what it was asked.",
        "Ask the fit of one level; bands of this one count its values and what is left over.",
    ),
    "prediction.readings-contradict": CodeMeaning(
        "remark",
        "No departure of a usual size explains the readings of a fit, so its bands do not hold what is wrong.",
        "Look for a wrong column, unit, power or noise of the logs, or for a missing element: criticise does.",
    ),
    "record.another-log": CodeMeaning(
        "error",
        "The log is not the one that the campaign or example was written for.",
        "Get that log, or change the checksum by intention.",
    ),
    "record.counter": CodeMeaning(
        "remark",
        "A column counts rows, states or milliseconds, so it is no reading.",
        "Nothing.",
    ),
    "record.damaged": CodeMeaning(
        "error",
        "The file of a log is cut short, or is not of the format that its name says.",
        "Fetch or export it again.",
    ),
    "record.does-not-apply": CodeMeaning(
        "error",
        "What is requested applies to another kind of log, or to channels of another role or quantity.",
        "Leave it out, or name other channels.",
    ),
    "record.layout-unclear": CodeMeaning(
        "error",
        "Header, separator or lines of a log do not make one table.",
        "Give the option of the message, or correct the line.",
    ),
    "record.log-missing": CodeMeaning(
        "error",
        "A log is not where the campaign says.",
        "Give its folder: `--data` or `THERMID_DATA`.",
    ),
    "record.loose-sensor": CodeMeaning(
        "warning, remark",
        "One of several sensors of a part reads the surroundings and not the part.",
        "Remove its channel, or fasten the sensor and repeat the test.",
    ),
    "record.name-twice": CodeMeaning(
        "error",
        "One name stands for two columns or channels, or two channels are bound to one place.",
        "Rename one, or leave it out.",
    ),
    "record.no-samples": CodeMeaning(
        "error",
        "A log has no samples.",
        "Export it again, with its data.",
    ),
    "record.not-a-number": CodeMeaning(
        "error",
        "A cell holds no number.",
        "Write missing samples as empty, NaN, NA or ---.",
    ),
    "record.not-overlapping": CodeMeaning(
        "error",
        "Two logs that are joined have no time in common.",
        "Give another offset.",
    ),
    "record.not-steady": CodeMeaning(
        "error",
        "A channel drifts more than is allowed for a steady point.",
        "Use a later window, or raise the limit.",
    ),
    "record.nothing-there": CodeMeaning(
        "error",
        "No valid sample is left in a channel or lies in a window.",
        "Choose another window, or leave the channel out.",
    ),
    "record.number-unclear": CodeMeaning(
        "error",
        "Commas and points both may be the decimal sign.",
        "Give `decimal`.",
    ),
    "record.power-far-from-deck": CodeMeaning(
        "warning",
        "A logged power is several hundred times that of the deck's load, or a small part of it.",
        "Declare the unit of the column that the message names, or correct the load of the deck.",
    ),
    "record.samples-assumed": CodeMeaning(
        "remark",
        "Nothing says whether samples of a log are instants or averages; instants are assumed.",
        "State `samples`.",
    ),
    "record.second-clock": CodeMeaning(
        "error",
        "A channel would follow two clocks or delays that are left to a fit.",
        "State one of them as a time.",
    ),
    "record.sensors-exchanged": CodeMeaning(
        "remark",
        "The readings of two sensors fit the model much better when their columns are exchanged.",
        "Check the wiring and the header of the log.",
    ),
    "record.shape": CodeMeaning(
        "error",
        "Times, values and masks are not rows of equal length.",
        "Give arrays of equal length.",
    ),
    "record.stray-readings": CodeMeaning(
        "warning, remark",
        "Readings of a channel are codes of faults and no temperatures.",
        "Mask them by `prepare`, as the message shows.",
    ),
    "record.time-not-read": CodeMeaning(
        "error",
        "A cell of the time column is no time in the form of the others.",
        "Correct the line, or give `clock`.",
    ),
    "record.time-order": CodeMeaning(
        "error",
        "Times do not increase.",
        "Sort the log, or read its parts as separate records.",
    ),
    "record.time-unclear": CodeMeaning(
        "error, remark",
        "It is not clear which column is the time, in which unit it is, or what is day and month.",
        "Give `time`, `units` or `clock`.",
    ),
    "record.times-differ": CodeMeaning(
        "error",
        "Channels of one log have different times.",
        "Export them with one time column, or as separate logs.",
    ),
    "record.too-short": CodeMeaning(
        "error",
        "There are too few samples, or too little time, for the request.",
        "Use a longer log or window, or a shorter filter.",
    ),
    "record.two-readings-at-one-time": CodeMeaning(
        "error",
        "A channel has two different readings at one time.",
        "Remove one, or give the rows different names.",
    ),
    "record.uneven-times": CodeMeaning(
        "error",
        "A filter needs equal intervals.",
        "Resample first.",
    ),
    "record.unit-by-name": CodeMeaning(
        "remark",
        "The unit of a column is taken from the end of its name.",
        "Give `unit` where it is another.",
    ),
    "record.unit-contradicts": CodeMeaning(
        "error",
        "A column has two units.",
        "Correct one of them.",
    ),
    "record.unit-unclear": CodeMeaning(
        "error",
        "A column without a unit looks like another one than the unit that would be assumed.",
        "Give `units`.",
    ),
    "record.unseen-pulses": CodeMeaning(
        "warning, remark",
        "A power is switched faster than its log reads it, so that pulses between two readings may be missed.",
        "Log it faster, or its energy or mean; or state `prompt`.",
    ),
    "record.values-elsewhere": CodeMeaning(
        "error",
        "The values of a data set are in other files, which are not read.",
        "Save them in the file itself.",
    ),
    "result.nothing-to-draw": CodeMeaning(
        "error",
        "A result holds no numbers to draw.",
        "Print it.",
    ),
    "result.slow-part-possible": CodeMeaning(
        "remark",
        "A final temperature is declined, because the readings cannot exclude a part slower than they last.",
        "Wait longer, or give a model or the longest time constant.",
    ),
    "run.cluster": CodeMeaning(
        "error",
        "The cluster does not respond, its address is none, or its workers have another version.",
        "Start it, or install one version everywhere.",
    ),
    "run.density-assumed": CodeMeaning(
        "remark",
        "A stream by volume comes from no boundary; its density is that at a standard temperature.",
        "Write a mass flow, if that matters.",
    ),
    "run.did-not-finish": CodeMeaning(
        "error",
        "An integration or a filter ended before its time.",
        "See the time and node of the message; values far from usual are the most common cause.",
    ),
    "run.gases-differ": CodeMeaning(
        "remark",
        "A stream is of another gas than the one that convection takes in its node.",
        "Give both the same gas.",
    ),
    "run.heat-stops-without-gas": CodeMeaning(
        "remark",
        "Without gas no heat flows along these paths, or these streams stop.",
        "Nothing; give an emissivity where radiation is meant.",
    ),
    "run.input-missing": CodeMeaning(
        "error",
        "A run lacks its start, the temperature of a boundary, or an input up to its end.",
        "Give it in the scenario.",
    ),
    "run.members-failed": CodeMeaning(
        "error",
        "Runs of an ensemble failed.",
        "Run the member of the message alone to see why.",
    ),
    "run.no-periodic-state": CodeMeaning(
        "error",
        "No state comes back after a period.",
        "Simulate, and use a late part of the run.",
    ),
    "run.no-steady-state": CodeMeaning(
        "error",
        "No steady state exists, or none was found.",
        "Give every part a path to a boundary; simulate where a control keeps switching.",
    ),
    "run.not-stable": CodeMeaning(
        "error",
        "A wait of a test profile ends before its rule of stability is met.",
        "Allow a longer wait or another rule; where a load switches, apply the rule to means over whole periods.",
    ),
    "run.outside-times": CodeMeaning(
        "error",
        "A temperature at a time outside the run is requested.",
        "Request a time within the run, or run longer.",
    ),
    "run.path-stays-without-gas": CodeMeaning(
        "remark",
        "A solid path ends in a gas node and stays without its gas.",
        "Give it kind convection or gas, if it leads through the gas.",
    ),
    "run.start-held": CodeMeaning(
        "remark",
        "A start in balance holds inputs that change in time.",
        "Give the time or period of the balance.",
    ),
    "run.too-many-nodes": CodeMeaning(
        "error",
        "The model has more nodes than a run with a thermostat, a one-way flow, a fit or many members takes.",
        "Merge nodes, or leave these out.",
    ),
    "run.upper-bound": CodeMeaning(
        "remark",
        "In vacuum as printed every coefficient is zero, radiation too.",
        "Read the temperatures as upper bounds.",
    ),
    "run.wind-without-effect": CodeMeaning(
        "remark",
        "A fixed coefficient does not change with the wind.",
        "Give `htc = { length = ... }`.",
    ),
    "run.worker-lost": CodeMeaning(
        "error",
        "A worker of a cluster ended while it was at work.",
        "Start it again, with more memory if it had too little.",
    ),
    "studio.not-now": CodeMeaning(
        "error",
        "The studio cannot do this at present.",
        "Do first what the message says.",
    ),
    "unit.ambiguous": CodeMeaning(
        "error",
        "The unit is read as another one than was probably meant: mK is the millikelvin, gr the grain.",
        "Write (m K), or g.",
    ),
    "unit.not-thermal": CodeMeaning(
        "error",
        "The unit has a dimension that no thermal network has, such as light.",
        "Give a unit of the quantity that is requested.",
    ),
    "unit.scale-for-difference": CodeMeaning(
        "error",
        "A temperature in degC or degF stands where a difference is needed.",
        "Write it in [K].",
    ),
    "unit.scale-in-product": CodeMeaning(
        "error",
        "A scale with an offset is multiplied or divided.",
        "Write K for degC, degR for degF.",
    ),
    "unit.unknown": CodeMeaning(
        "error",
        "Nobody knows the unit.",
        "Take the one that the message names.",
    ),
    "unit.wrong-dimension": CodeMeaning(
        "error",
        "The unit is of another quantity than its place needs, or is missing.",
        "Write the quantity with a unit of the message.",
    ),
    "value.contradicts": CodeMeaning(
        "error",
        "Values contradict one another: areas, directions, or an amount counted twice.",
        "Correct one of them.",
    ),
    "value.excludes-another": CodeMeaning(
        "error",
        "Two values are given of which only one can hold.",
        "Leave one out.",
    ),
    "value.incomplete": CodeMeaning(
        "error",
        "A value needs another one beside it, or is given twice.",
        "Give the pair of the message, or leave one out.",
    ),
    "value.not-an-amount": CodeMeaning(
        "error",
        "The value is neither a number nor a text with a unit.",
        "Write `'4 [s]'`.",
    ),
    "value.outside-range": CodeMeaning(
        "error",
        "A number is not finite, not above zero, or not in the order that its place needs.",
        "Give one in range.",
    ),
    "value.shape": CodeMeaning(
        "error",
        "A list or array has another length or shape than its place needs.",
        "Give one value for each, as the message says.",
    ),
    "value.without-effect": CodeMeaning(
        "error",
        "A value would change nothing here, or belongs to another kind of element, file or command.",
        "Leave it out, or give what it belongs to.",
    ),
    "value.wrong-kind": CodeMeaning(
        "error",
        "An argument, option or key holds another kind of thing than it takes.",
        "Give what the message requests.",
    ),
    "verdict.criteria": CodeMeaning(
        "error",
        "Criteria of a verdict do not apply to the data, or leave out more than they may.",
        "Change the criteria, or state why.",
    ),
    "verdict.from-memory": CodeMeaning(
        "remark",
        "A limit is quoted from memory, so a verdict on it is not decided.",
        "Check the number in its source and mark it read.",
    ),
    "verdict.log-of-another-test": CodeMeaning(
        "remark",
        "The log of a test is identical to that of another.",
        "Give each test its own log.",
    ),
    "verdict.no-criteria": CodeMeaning(
        "remark",
        "A test has a log, and no criteria for it.",
        "Name criteria in the plan.",
    ),
    "verdict.no-limits-of-this-state": CodeMeaning(
        "remark",
        "A part that is switched off leaves its operating limits, and no non-operating limits are given.",
        "State its non-operating limits.",
    ),
    "verdict.no-log": CodeMeaning(
        "remark",
        "Criteria of a test wait for its log.",
        "Run the test and name its log in the plan.",
    ),
}
"""Code -> what it stands for; in the order of the alphabet."""
