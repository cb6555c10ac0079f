// The table of laws: heat of one conductor or load, and its first derivatives.
// Each law is written once over a scalar type: with double it serves the integrator, with Dual (a directional
// derivative) it gives the exact second derivatives that the dense output's sensitivities need.
#pragma once
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "ensemble_lanes.hpp"

namespace thermid {

struct Dual {
    double v = 0.0, e = 0.0;
    Dual() = default;
    Dual(double value, double eps = 0.0) : v(value), e(eps) {}
};
inline Dual operator+(Dual a, Dual b) { return {a.v + b.v, a.e + b.e}; }
inline Dual operator-(Dual a, Dual b) { return {a.v - b.v, a.e - b.e}; }
inline Dual operator*(Dual a, Dual b) { return {a.v * b.v, a.e * b.v + a.v * b.e}; }
inline Dual operator/(Dual a, Dual b) { return {a.v / b.v, (a.e - a.v / b.v * b.e) / b.v}; }
inline Dual exp(Dual a) { double g = std::exp(a.v); return {g, g * a.e}; }
inline Dual sqrt(Dual a) { double g = std::sqrt(a.v); return {g, 0.5 * a.e / g}; }
inline Dual log(Dual a) { return {std::log(a.v), a.e / a.v}; }
inline double value(double a) { return a; }
inline double value(Dual a) { return a.v; }

// e^m for e > 0; quarter powers (laminar natural convection) need no logarithm.
inline double power(double e, double m) { return m == 0.125 ? std::sqrt(std::sqrt(std::sqrt(e))) : std::pow(e, m); }
inline Dual power(Dual e, Dual m) {
    double g = power(e.v, m.v);
    return {g, g * (m.v * e.e / e.v + (m.e != 0.0 ? m.e * std::log(e.v) : 0.0))};
}

// Table g(x): straight lines between knots, or cubic Hermite where slopes are given; constant outside. Knots may lie as close together as a law needs them; equal buckets
// lead to them, most of which hold at most one, so that a look-up costs about as much as a power.
struct Table {
    std::vector<double> x, y, d;
    struct Bend { double x, jump; };  // a knot where the slope jumps, and by how much
    std::vector<Bend> bends;

    Table(std::vector<double> knots, std::vector<double> values, std::vector<double> slopes)
        : x(std::move(knots)), y(std::move(values)), d(std::move(slopes)) {
        const int m = static_cast<int>(x.size()), buckets = std::min(2 * m, 4096);
        if (m < 1 || y.size() != x.size() || (!d.empty() && d.size() != x.size())) throw std::invalid_argument("tables: knots, values and slopes differ in length");
        if (!std::isfinite(x.back() - x.front())) throw std::invalid_argument("tables: knots must be finite");
        for (int i = 1; i < m; ++i) {
            if (!(x[i] > x[i - 1])) throw std::invalid_argument("tables: knots must increase");
            const double w = x[i] - x[i - 1], jump = (y[i] - y[i - 1]) / w;
            if (d.empty()) pieces_.push_back({x[i - 1], y[i - 1], jump, 0.0, 0.0});
            else pieces_.push_back({x[i - 1], y[i - 1], d[i - 1], (3.0 * jump - 2.0 * d[i - 1] - d[i]) / w, (d[i - 1] + d[i] - 2.0 * jump) / (w * w)});
        }
        pieces_.push_back({x.back(), y.back(), 0.0, 0.0, 0.0});  // beyond the last knot, and before the first
        pieces_.push_back({x.front(), y.front(), 0.0, 0.0, 0.0});
        find_bends();
        if (m > 1) per_kelvin_ = buckets / (x.back() - x.front());
        if (!std::isfinite(per_kelvin_)) per_kelvin_ = 0.0;  // knots so close that one bucket serves
        first_.assign(buckets + 2, 0);
        for (int i = 0; i < m; ++i) ++first_[bucket(x[i]) + 1];
        for (int k = 1; k < buckets + 2; ++k) first_[k] += first_[k - 1];
    }

    LaneTable view() const {
        return {pieces_.data(), first_.data(), x.front(), x.back(), per_kelvin_, static_cast<int>(first_.size()) - 2, static_cast<int>(x.size())};
    }

    void eval(double at, double& g, double& g1, double& g2) const {
        g1 = g2 = 0.0;
        if (!(at >= x.front())) { g = y.front(); return; }  // at a knot stands the piece after it
        if (at >= x.back()) { g = y.back(); return; }
        const LanePiece& p = pieces_[find(at)];
        const double t = at - p.x;
        g = p.c0 + t * (p.c1 + t * (p.c2 + t * p.c3));
        g1 = p.c1 + t * (2.0 * p.c2 + 3.0 * t * p.c3);
        g2 = 2.0 * p.c2 + 6.0 * t * p.c3;
    }
    void eval(double at, double& g, double& g1) const { double g2; eval(at, g, g1, g2); }
    // The same, first on the piece of the time before.
    void eval(double at, double& g, double& g1, int& piece) const {
        if (!(at > pieces_[piece].x && at < pieces_[piece + 1].x)) {
            if (!(at > x.front() && at < x.back())) return eval(at, g, g1);
            piece = find(at);
        }
        const LanePiece& p = pieces_[piece];
        const double t = at - p.x;
        g = p.c0 + t * (p.c1 + t * (p.c2 + t * p.c3));
        g1 = p.c1 + t * (2.0 * p.c2 + 3.0 * t * p.c3);
    }
    void eval(Dual at, Dual& g, Dual& g1) const {
        double a, b, c;
        eval(at.v, a, b, c);
        g = {a, b * at.e};
        g1 = {b, c * at.e};
    }

  private:
    std::vector<LanePiece> pieces_;
    std::vector<int> first_;  // bucket -> knots in the buckets before it
    double per_kelvin_ = 0.0;

    // Where a table has no values it has no bends. Rounding of cubic pieces leaves a little of a jump.
    void find_bends() {
        const int m = static_cast<int>(x.size());
        auto slope = [&](int piece, double at) {
            const LanePiece& p = pieces_[piece];
            const double t = at - p.x;
            return p.c1 + t * (2.0 * p.c2 + 3.0 * t * p.c3);
        };
        for (int i = 0; i < m; ++i) {
            const double before = i > 0 ? slope(i - 1, x[i]) : 0.0, after = i < m - 1 ? slope(i, x[i]) : 0.0;
            if (std::fabs(after - before) > 1e-9 * (std::fabs(before) + std::fabs(after))) bends.push_back({x[i], after - before});
        }
    }

    int find(double at) const {  // between the first knot and the last
        const int k = bucket(at);
        int lo = std::max(first_[k] - 1, 0), hi = std::min(first_[k + 1], static_cast<int>(x.size()) - 1);
        while (hi - lo > 1) {
            const int mid = (lo + hi) / 2;
            (pieces_[mid].x <= at ? lo : hi) = mid;
        }
        return lo;
    }
    int bucket(double at) const { return std::min(static_cast<int>((at - x.front()) * per_kelvin_), static_cast<int>(first_.size()) - 2); }
};

enum ConductorKind { LINEAR = 0, POWER, RADIATION, FLOW, TABLE_MEAN, TABLE_DIFF, GAS, NATURAL, POTENTIAL, HINGE_MEAN, HINGE_DIFF, CONDUCTOR_KINDS };
enum LoadKind { SIGNAL = 0, POLY, EXP, TABLE, THERMOSTAT, PROPORTIONAL, LOAD_KINDS };
enum InputKind { SAMPLED_LINEAR = 0, SAMPLED_HOLD, SINE, CONSTANT, INPUT_KINDS };

// Laws of two coefficients, and how many tables stand one behind the other for a law.
inline bool is_hinge(int kind) { return kind == HINGE_MEAN || kind == HINGE_DIFF; }
inline bool has_second(int kind) { return kind == POWER || kind == GAS || kind == NATURAL || is_hinge(kind); }
inline int tables_of(int kind) { return kind == NATURAL ? 3 : kind == POTENTIAL ? 2 : kind == TABLE_MEAN || kind == TABLE_DIFF || kind == GAS ? 1 : 0; }

constexpr double COLDEST = -1e-6;  // what the error of steps may leave of a node that rests at 0 K [K]
constexpr double GAS_ANCHOR = 300.0;  // temperature to which the coefficients of gas laws refer [K]
constexpr double SMOOTH2 = 1e-4;  // (0.01 K)^2: |dT|^c1 has no second derivative at dT = 0, where runs start

// (u)+, rounded over ROUND on either side, and its slope: a table of straight lines is a sum of these, one for each of its points, so
// that its points may move with their derivatives.
constexpr double ROUND = 1e-3;  // [K]
template <class X>
inline void hinge(X u, X& g, X& g1) {
    if (!(value(u) > -ROUND)) { g = g1 = X(0.0); return; }
    if (value(u) >= ROUND) { g = u; g1 = X(1.0); return; }
    const X w = u + X(ROUND);
    g = w * w * X(0.25 / ROUND);
    g1 = w * X(0.5 / ROUND);
}

// Conductor: heat a->b is c0 * phi; q_a, q_b are dq/dTa and dq/dTb; q_1 is dq/dc1.
template <class X>
struct Conduct { X q, phi, qa, qb, q1; };

template <class X>
inline Conduct<X> conductor(int kind, X ta, X tb, X c0, X c1, const thermid::Table* table) {
    Conduct<X> r;
    const X d = ta - tb;
    r.q1 = X(0.0);
    switch (kind) {
        case POWER: {
            const X e = d * d + X(SMOOTH2), p = power(e, c1 * X(0.5));
            r.phi = d * p;
            r.qa = c0 * p * (X(1.0) + c1 * d * d / e);
            r.qb = X(0.0) - r.qa;
            break;
        }
        case RADIATION: {
            const X a2 = ta * ta, b2 = tb * tb;
            r.phi = (a2 + b2) * (ta + tb) * d;
            r.qa = X(4.0) * c0 * a2 * ta;
            r.qb = X(-4.0) * c0 * b2 * tb;
            break;
        }
        case TABLE_MEAN: {
            X g, g1;
            table->eval((ta + tb) * X(0.5), g, g1);
            r.phi = g * d;
            r.qa = c0 * (X(0.5) * g1 * d + g);
            r.qb = c0 * (X(0.5) * g1 * d - g);
            break;
        }
        case TABLE_DIFF: {
            X g, g1;
            table->eval(d, g, g1);
            r.phi = g * d;
            r.qa = c0 * (g1 * d + g);
            r.qb = X(0.0) - r.qa;
            break;
        }
        case GAS: {  // gas at rest: c0 the conductance of the continuum, c1 that of free molecules over it, which goes with pressure
            using std::sqrt;
            const X tm = (ta + tb) * X(0.5);
            X g, g1;
            table->eval(tm, g, g1);
            const X s = sqrt(tm * X(1.0 / GAS_ANCHOR)), k = g * s, w = c1 + k, share = c1 / w;
            const X dt = X(0.5) * d * share * (g1 - g * (g1 * s + k / (tm * X(2.0))) / w);
            r.phi = d * g * share;
            r.qa = c0 * (dt + g * share);
            r.qb = c0 * (dt - g * share);
            r.q1 = c0 * d * g * k / (w * w);
            break;
        }
        case NATURAL: {  // free convection beyond conduction: tables of Nu over signed Ra^(1/4), k and Ra^(1/4) over film temperature
            const X tm = (ta + tb) * X(0.5), e = d * d + X(SMOOTH2), y = power(e, X(0.125)), y3 = X(1.0) / (y * y * y), w = d * y3;
            X n, n1, g, g1, f, f1;
            table[1].eval(tm, g, g1);
            table[2].eval(tm, f, f1);
            table[0].eval(c1 * f * w, n, n1);
            const X rise = d * g * n1 * c1, dt = X(0.5) * (d * g1 * n + rise * f1 * w);
            const X dd = g * n + rise * f * y3 * (X(1.0) - X(0.75) * d * d / e);
            r.phi = d * g * n;
            r.qa = c0 * (dt + dd);
            r.qb = c0 * (dt - dd);
            r.q1 = c0 * d * g * n1 * f * w;
            break;
        }
        case POTENTIAL: {  // each end has a table: integrals of k over temperature, or the temperature that belongs to an enthalpy
            X g, g1, f, f1;
            table[0].eval(ta, g, g1);
            table[1].eval(tb, f, f1);
            r.phi = g - f;
            r.qa = c0 * g1;
            r.qb = X(0.0) - c0 * f1;
            break;
        }
        case HINGE_MEAN: {  // c1 the mean temperature where it begins
            X g, g1;
            hinge((ta + tb) * X(0.5) - c1, g, g1);
            const X bend = X(0.5) * g1 * d;
            r.phi = g * d;
            r.qa = c0 * (bend + g);
            r.qb = c0 * (bend - g);
            r.q1 = X(-1.0) * c0 * g1 * d;
            break;
        }
        case HINGE_DIFF: {  // c1 the difference where it begins
            X g, g1;
            hinge(d - c1, g, g1);
            r.phi = g * d;
            r.qa = c0 * (g1 * d + g);
            r.qb = X(0.0) - r.qa;
            r.q1 = X(-1.0) * c0 * g1 * d;
            break;
        }
        default:  // LINEAR, FLOW
            r.phi = d;
            r.qa = c0;
            r.qb = X(0.0) - c0;
    }
    r.q = c0 * r.phi;
    return r;
}

// dq/dc1 of a POWER conductor, wanted only where the exponent is a parameter; gas laws have theirs at hand.
template <class X>
inline X conductor_exponent(X ta, X tb, X q) {
    using std::log;
    const X d = ta - tb;
    return X(0.5) * q * log(d * d + X(SMOOTH2));
}

// Load: power, its slope in the sensor temperature, and dp/dc.
template <class X>
struct Heat { X p, pt, pc[4]; };

template <class X>
inline Heat<X> load(int kind, X t, const X c[4], const thermid::Table* table, bool on) {
    using std::exp;
    Heat<X> r;
    r.p = r.pt = r.pc[0] = r.pc[1] = r.pc[2] = r.pc[3] = X(0.0);
    switch (kind) {
        case SIGNAL: r.p = c[0]; r.pc[0] = X(1.0); break;
        case POLY: {
            const X x = t - c[3];
            r.pc[0] = X(1.0) + x * (c[1] + c[2] * x);
            r.pc[1] = c[0] * x;
            r.pc[2] = c[0] * x * x;
            r.pt = c[0] * (c[1] + X(2.0) * c[2] * x);
            r.pc[3] = X(0.0) - r.pt;
            r.p = c[0] * r.pc[0];
            break;
        }
        case EXP: {
            const X x = t - c[3];
            r.pc[0] = exp(c[1] * x);
            r.p = c[0] * r.pc[0];
            r.pc[1] = r.p * x;
            r.pt = r.p * c[1];
            r.pc[3] = X(0.0) - r.pt;
            break;
        }
        case TABLE: {
            X g, g1;
            table->eval(t, g, g1);
            r.p = c[0] * g;
            r.pt = c[0] * g1;
            r.pc[0] = g;
            break;
        }
        case THERMOSTAT:
            if (on) { r.p = c[0]; r.pc[0] = X(1.0); }
            break;
        case PROPORTIONAL: {
            const X p = c[0] * (c[1] - t);
            if (!(value(p) > 0.0)) break;
            if (value(p) >= value(c[2])) { r.p = c[2]; r.pc[2] = X(1.0); break; }
            r.p = p;
            r.pt = X(0.0) - c[0];
            r.pc[0] = c[1] - t;
            r.pc[1] = c[0];
            break;
        }
    }
    return r;
}

}  // namespace thermid
