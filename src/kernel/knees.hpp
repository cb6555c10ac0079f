// Where a proportional heater reaches an end of its band its power has a knee, and so has a table that moves at each of its points. The
// error estimate of a step sees a tenth to a fortieth of what that does, and near one place in the step nothing. So that error is reckoned,
// and a step that passes a knee is made short enough.
#pragma once
#include <algorithm>
#include <cmath>

#include "laws.hpp"

namespace thermid {

// A sensor over a step: temperatures at its ends, and their slopes times its length.
struct Sweep {
    double t0, t1, a, b;
    double at(double x) const { return t0 + x * (a + x * (3.0 * (t1 - t0) - 2.0 * a - b + x * (a + b - 2.0 * (t1 - t0)))); }
};

// What a conductor with a knee is over, from both ends' temperatures.
inline Sweep knee_of(int kind, const Sweep& a, const Sweep& b) {
    const bool mean = is(kind, KNEE_OF_MEAN);
    const double x = mean ? Mean::OF_A : Difference::OF_A, y = mean ? Mean::OF_B : Difference::OF_B;
    return {x * a.t0 + y * b.t0, x * a.t1 + y * b.t1, x * a.a + y * b.a, x * a.b + y * b.b};
}

struct Knee {
    double error = 0.0, least = 0.0, where = 0.0;  // of the step's end [K]: for the knee where it lies, at the worst place; part of the step before it

    // The quadrature of (x - where)+ by the method's weights errs by at most 0.041, less near the ends of the step.
    void pass(const Sweep& s, double level, double gain, double h, double inertia) {
        if (!((s.t0 - level) * (s.t1 - level) < 0.0)) return;
        double low = 0.0, high = 1.0;
        for (int k = 0; k < 40; ++k) {
            const double x = 0.5 * (low + high);
            ((s.at(x) - level) * (s.t0 - level) > 0.0 ? low : high) = x;
        }
        const double whole = gain * std::fabs(s.t1 - s.t0) * h / inertia, here = whole * std::min(0.041, 0.25 * std::min(low, 1.0 - low));
        if (here <= error) return;
        error = here;
        least = 0.041 * whole;
        where = low;
    }
    // bend: by how much the power's slope in the sensor's temperature changes at either end of the band [W/K].
    void heater(const Sweep& s, double gain, double setpoint, double full, double bend, double h, double inertia) {
        if (gain == 0.0 || full == 0.0) return;
        pass(s, setpoint, bend, h, inertia);
        pass(s, setpoint - full / gain, bend, h, inertia);
    }
    // The next length to try: up to just before the knee, or so short that it may be passed.
    double retry(double h, double allowed) const {
        const double passing = 0.8 * h * std::sqrt(std::min(1.0, allowed / least));
        return where * h > passing ? where * h - 0.5 * passing : passing;
    }
};

}  // namespace thermid
