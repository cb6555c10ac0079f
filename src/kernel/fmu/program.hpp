// Coefficients from values that a host may set: a straight line of operations, each on results before it, with its derivative in one direction.
#pragma once
#include <cmath>
#include <stdexcept>
#include <vector>

namespace thermid {

struct Program {
    enum Operation { NUMBER = 0, NAME, ADD, SUBTRACT, MULTIPLY, DIVIDE, NEGATE, POWER, LEAST, LARGEST, ROOT, EXPONENTIAL, LOGARITHM, OPERATIONS };
    struct Step { int operation, a, b; };
    std::vector<Step> steps;
    std::vector<double> numbers;
    std::vector<int> coefficient;  // step of each

    void check(size_t names) const {
        for (size_t k = 0; k < steps.size(); ++k) {
            const Step& s = steps[k];
            const auto before = [&](int at) { return at >= 0 && static_cast<size_t>(at) < k; };
            const auto among = [&](int at, size_t n) { return at >= 0 && static_cast<size_t>(at) < n; };
            bool ok = false;
            if (s.operation == NUMBER) ok = among(s.a, numbers.size());
            else if (s.operation == NAME) ok = among(s.a, names);
            else if (s.operation == NEGATE || (s.operation >= ROOT && s.operation < OPERATIONS)) ok = before(s.a);
            else if (s.operation > NAME && s.operation < OPERATIONS) ok = before(s.a) && before(s.b);
            if (!ok) throw std::invalid_argument("the formulas of the model are damaged");
        }
        for (int at : coefficient)
            if (at < 0 || static_cast<size_t>(at) >= steps.size()) throw std::invalid_argument("the formulas of the model are damaged");
    }

    // value: one of each step, kept for `slopes`.
    void values(const double* name, std::vector<double>& value, std::vector<double>& out) const {
        value.resize(steps.size());
        for (size_t k = 0; k < steps.size(); ++k) {
            const Step& s = steps[k];
            switch (s.operation) {
                case NUMBER: value[k] = numbers[s.a]; break;
                case NAME: value[k] = name[s.a]; break;
                case ADD: value[k] = value[s.a] + value[s.b]; break;
                case SUBTRACT: value[k] = value[s.a] - value[s.b]; break;
                case MULTIPLY: value[k] = value[s.a] * value[s.b]; break;
                case DIVIDE: value[k] = value[s.a] / value[s.b]; break;
                case NEGATE: value[k] = -value[s.a]; break;
                case LEAST: value[k] = value[s.b] < value[s.a] ? value[s.b] : value[s.a]; break;
                case LARGEST: value[k] = value[s.b] > value[s.a] ? value[s.b] : value[s.a]; break;
                case ROOT: value[k] = std::sqrt(value[s.a]); break;
                case EXPONENTIAL: value[k] = std::exp(value[s.a]); break;
                case LOGARITHM: value[k] = std::log(value[s.a]); break;
                default: value[k] = std::pow(value[s.a], value[s.b]);
            }
        }
        for (size_t j = 0; j < coefficient.size(); ++j) out[j] = value[coefficient[j]];
    }

    // Derivatives of coefficients as names move by `move`.
    void slopes(const std::vector<double>& value, const double* move, std::vector<double>& slope, std::vector<double>& out) const {
        slope.resize(steps.size());
        for (size_t k = 0; k < steps.size(); ++k) {
            const Step& s = steps[k];
            switch (s.operation) {
                case NUMBER: slope[k] = 0.0; break;
                case NAME: slope[k] = move[s.a]; break;
                case ADD: slope[k] = slope[s.a] + slope[s.b]; break;
                case SUBTRACT: slope[k] = slope[s.a] - slope[s.b]; break;
                case MULTIPLY: slope[k] = slope[s.a] * value[s.b] + value[s.a] * slope[s.b]; break;
                case DIVIDE: slope[k] = std::isinf(value[s.b]) ? 0.0 : (slope[s.a] - value[k] * slope[s.b]) / value[s.b]; break;
                case NEGATE: slope[k] = -slope[s.a]; break;
                case LEAST: slope[k] = slope[value[s.b] < value[s.a] ? s.b : s.a]; break;
                case LARGEST: slope[k] = slope[value[s.b] > value[s.a] ? s.b : s.a]; break;
                case ROOT: slope[k] = slope[s.a] == 0.0 ? 0.0 : 0.5 * slope[s.a] / value[k]; break;
                case EXPONENTIAL: slope[k] = value[k] * slope[s.a]; break;
                case LOGARITHM: slope[k] = slope[s.a] / value[s.a]; break;
                default:
                    slope[k] = slope[s.a] == 0.0 ? 0.0 : value[s.b] * std::pow(value[s.a], value[s.b] - 1.0) * slope[s.a];
                    if (slope[s.b] != 0.0) slope[k] += value[k] * std::log(value[s.a]) * slope[s.b];
            }
        }
        for (size_t j = 0; j < coefficient.size(); ++j) out[j] = slope[coefficient[j]];
    }
};

}  // namespace thermid
