// A model as data: the file that `thermid export --as fmu` writes into an FMU, and what the library makes of it.
#pragma once
#include <memory>
#include <string>
#include <vector>

#include "fmu/program.hpp"
#include "network/problem.hpp"

namespace thermid {

// What a value reference stands for, with a place: of a name, a node or boundary, a boundary, a load, a switch, an event indicator.
enum VariableKind { TIME = 0, VALUE, TEMPERATURE, RATE, HEAT, LOAD_POWER, MODE, INDICATOR, VARIABLE_KINDS };
struct Variable { int kind, place; };

struct Image {
    std::string token;               // what the model description must hold too
    std::vector<std::string> nodes;  // names of nodes and boundaries, for messages
    Problem problem;
    Program program;
    std::vector<double> start, initial;  // of names; of unknown nodes
    std::vector<Variable> variables;     // by value reference
    std::vector<int> power_begin, power_row;  // rows of each load
};

// Throws std::invalid_argument where the bytes are no such file, or damaged.
std::shared_ptr<const Image> read_image(const std::string& path);

}  // namespace thermid
