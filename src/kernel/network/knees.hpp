// Where a proportional heater reaches an end of its band its power has a knee, and so has a table of straight lines at each of its points.
// The error estimate of a step sees a tenth to a fortieth of what that does, and near one place in the step nothing. So that error is
// reckoned, and a step that passes a knee is made short enough: up to just before the knee, then over it, then on.
#pragma once
#include <algorithm>
#include <cmath>

#include "network/laws.hpp"

namespace thermid {

// What a row follows over a step: values at its ends, and their slopes times its length.
struct Sweep {
    double t0, t1, a, b;
    double at(double x) const { return t0 + x * (a + x * (3.0 * (t1 - t0) - 2.0 * a - b + x * (a + b - 2.0 * (t1 - t0)))); }
    double slope(double x) const { return a + x * (2.0 * (3.0 * (t1 - t0) - 2.0 * a - b) + 3.0 * x * (a + b - 2.0 * (t1 - t0))); }
    // Where it turns within the step; 1 where it does not.
    double turn() const {
        if (!(a * b < 0.0)) return 1.0;
        double low = 0.0, high = 1.0;
        for (int k = 0; k < 40; ++k) {
            const double x = 0.5 * (low + high);
            (slope(x) * a > 0.0 ? low : high) = x;
        }
        return low;
    }
};

// What a conductor with a knee is over, from both ends' temperatures.
inline Sweep knee_of(int kind, const Sweep& a, const Sweep& b) {
    const bool mean = is(kind, KNEE_OF_MEAN);
    const double x = mean ? Mean::OF_A : Difference::OF_A, y = mean ? Mean::OF_B : Difference::OF_B;
    return {x * a.t0 + y * b.t0, x * a.t1 + y * b.t1, x * a.a + y * b.a, x * a.b + y * b.b};
}

struct Knee {
    double error = 0.0, least = 0.0, where = 0.0;  // of the step's end [K]: for the knee where it lies, at the worst place; part of the step before it
    double steepest = 0.0;                         // `felt` of that knee

    // The quadrature of (x - where)+ by the method's weights errs by at most 0.041, less near the ends of the step.
    // felt: by how much the step's end is off for each kelvin past the knee [K/K].
    void pass(const Sweep& s, double turn, double level, double felt) {
        const double before = s.t0 - level, end = turn < 1.0 ? s.at(turn) : s.t1;
        const bool above = before >= 0.0;  // as a table has it: at a knot stands the piece after it
        if (above == (s.t1 >= level) && above == (end >= level)) return;
        double low = 0.0, high = above == (end >= level) ? 1.0 : turn;
        for (int k = 0; k < 40 && before != 0.0; ++k) {
            const double x = 0.5 * (low + high);
            ((s.at(x) - level) * before > 0.0 ? low : high) = x;
        }
        const double whole = felt * std::max(std::fabs(s.t1 - s.t0), std::fabs(end - level));
        // A step that falls from a knee begins with the slopes of the other side, and its dense output bends by them.
        const double here = before == 0.0 ? 0.041 * whole : whole * std::min(0.041, 0.25 * std::min(low, 1.0 - low));
        if (here <= error) return;
        error = here;
        least = 0.041 * whole;
        where = low;
        steepest = std::max(steepest, felt);
    }
    // power: what the load would give without its control [W].
    template <class Felt>
    void heater(const Sweep& s, double gain, double setpoint, double full, double power, Felt felt) {
        if (gain == 0.0 || full == 0.0) return;
        const double turn = s.turn(), third = turn < 1.0 ? s.at(turn) : s.t1;
        const double low = std::min({s.t0, s.t1, third}), high = std::max({s.t0, s.t1, third});
        for (double level : {setpoint, setpoint - full / gain})
            if (low <= level && level <= high) pass(s, turn, level, std::fabs(gain / full * power) * felt());
    }
    // Of what is kept between two limits; felt: for one unit of it all along the step.
    template <class Felt>
    void limits(const Sweep& s, double least_value, double most_value, Felt felt) {
        const double turn = s.turn(), third = turn < 1.0 ? s.at(turn) : s.t1;
        const double low = std::min({s.t0, s.t1, third}), high = std::max({s.t0, s.t1, third});
        for (double level : {least_value, most_value})
            if (low <= level && level <= high) pass(s, turn, level, felt());
    }
    // felt: as above, for a slope that jumps by one.
    template <class Felt>
    void table(const Sweep& s, const Table& t, Felt felt) {
        const double turn = s.turn(), third = turn < 1.0 ? s.at(turn) : s.t1;
        const double low = std::min({s.t0, s.t1, third}), high = std::max({s.t0, s.t1, third});
        auto bend = std::lower_bound(t.bends.begin(), t.bends.end(), low, [](const Table::Bend& b, double x) { return b.x < x; });
        if (bend == t.bends.end() || !(bend->x <= high)) return;
        const double each = felt();
        for (; bend != t.bends.end() && bend->x <= high; ++bend) pass(s, turn, bend->x, each * std::fabs(bend->jump));
    }
    // Of a conductor with tables or a hinge; felt: for one watt all along the step [K/W].
    template <class Felt>
    void conductor(int kind, const Sweep& a, const Sweep& b, double c0, double c1, const Table* tables, Felt felt) {
        if (is(kind, KNEE_OF_ENDS)) {
            auto each = [&] { return std::fabs(c0) * felt(); };
            table(a, tables[0], each);
            table(b, tables[1], each);
            return;
        }
        const Sweep seen = knee_of(kind, a, b);
        const double apart = std::max(std::fabs(a.t0 - b.t0), std::fabs(a.t1 - b.t1));
        auto each = [&] { return std::fabs(c0) * apart * felt(); };
        if (tables_of(kind)) return table(seen, tables[0], each);
        const double turn = seen.turn(), third = turn < 1.0 ? seen.at(turn) : seen.t1;
        if (std::min({seen.t0, seen.t1, third}) <= c1 && c1 <= std::max({seen.t0, seen.t1, third})) pass(seen, turn, c1, each());
    }
    // The next length to try: up to just before the knee, or so short that it may be passed. It is shorter by more than what a step is
    // lengthened by to end where it must, else the same step would be tried for ever.
    double retry(double h, double allowed) const {
        const double passing = 0.8 * h * std::sqrt(std::min(1.0, allowed / least));
        return std::min(0.9 * h, where * h > passing ? where * h - 0.5 * passing : passing);
    }
};

}  // namespace thermid
