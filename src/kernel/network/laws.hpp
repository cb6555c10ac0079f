// The table of laws: heat of one conductor or load, and its first derivatives.
// Each law is one function over a scalar type X: with double it serves the integrator and large networks, with Dual (a directional
// derivative) it gives exact second derivatives, with a vector of lanes it serves eight members of an ensemble at once. A new law is such
// a function and a row in THERMID_CONDUCTORS or THERMID_LOADS; names, coefficients and tables are columns of that row, which Python reads.
#pragma once
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include "ensemble/ensemble_lanes.hpp"
#include "network/scalars.hpp"

namespace thermid {

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
    // Largest slope: of a piece at its ends, or where its own slope turns. Pieces without values have none.
    double steepest() const {
        double worst = 0.0;
        for (size_t i = 0; i + 1 < x.size(); ++i) {
            const LanePiece& p = pieces_[i];
            const double width = x[i + 1] - x[i], turn = p.c3 != 0.0 ? -p.c2 / (3.0 * p.c3) : 0.0;
            for (double t : {0.0, std::min(std::max(turn, 0.0), width), width}) {
                const double slope = p.c1 + t * (2.0 * p.c2 + 3.0 * t * p.c3);
                if (slope > worst) worst = slope;
            }
        }
        return worst;
    }
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

enum InputKind { SAMPLED_LINEAR = 0, SAMPLED_HOLD, SINE, CONSTANT, FOLLOWED, INPUT_KINDS };

constexpr double COLDEST = -1e-6;  // what the error of steps may leave of a node that rests at 0 K [K]
constexpr double GAS_ANCHOR = 300.0;  // temperature to which the coefficients of gas laws refer [K]
constexpr double SMOOTH2 = 1e-4;  // (0.01 K)^2: |dT|^c1 has no second derivative at dT = 0, where runs start

// A table's value and slope, and where laws look up their tables, one behind the other.
template <class X>
struct Looked { X g, g1; };
struct Tables {
    const Table* first;
    template <class X>
    THERMID_INLINE Looked<X> at(int k, X x) const {
        Looked<X> r;
        first[k].eval(x, r.g, r.g1);
        return r;
    }
};
struct KeptTables {  // each first on the piece of the time before
    const Table* first;
    int* piece;
    THERMID_INLINE Looked<double> at(int k, double x) const {
        Looked<double> r;
        first[k].eval(x, r.g, r.g1, piece[k]);
        return r;
    }
};

// ---- Laws of conductors

// Heat from a to b is q = c0 phi; qa, qb and q1 are dq/dTa, dq/dTb and dq/dc1.
template <class X>
struct Conduct { X q, phi, qa, qb, q1; };

struct Linear {  // c0 (Ta - Tb); of a flow it is what b gains, and a keeps its heat
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C, const T&) {
        const X d = ta - tb;
        return {c0 * d, d, c0, -c0, number<X>(0.0)};
    }
};

struct Power {  // c0 d (d^2 + s)^(c1/2), d = Ta - Tb
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C c1, const T&) {
        const X d = ta - tb, dd = d * d, e = dd + SMOOTH2;
        const Roots<X> r = Elementary<X>::roots(e, dd, c1);
        const X phi = d * r.power, qa = c0 * r.power * (1.0 + exponent_of<X>(c1) * r.share);
        return {c0 * phi, phi, qa, -qa, 0.5 * (c0 * phi) * Elementary<X>::logarithm(e)};
    }
};

struct Radiation {  // c0 (Ta^4 - Tb^4)
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C, const T&) {
        const X a2 = ta * ta, b2 = tb * tb, phi = (a2 + b2) * (ta + tb) * (ta - tb);
        return {c0 * phi, phi, 4.0 * c0 * a2 * ta, -4.0 * c0 * b2 * tb, number<X>(0.0)};
    }
};

// What a conductance g is over: the mean of both temperatures, or the first less the second.
struct Mean {
    static constexpr double OF_A = 0.5, OF_B = 0.5;
    template <class X>
    static THERMID_INLINE X of(X ta, X tb) { return (ta + tb) * 0.5; }
    template <class X>
    static THERMID_INLINE Conduct<X> heat(X d, X c0, Looked<X> x) {
        const X bend = 0.5 * x.g1 * d, phi = x.g * d;
        return {c0 * phi, phi, c0 * (bend + x.g), c0 * (bend - x.g), number<X>(0.0)};
    }
};
struct Difference {
    static constexpr double OF_A = 1.0, OF_B = -1.0;
    template <class X>
    static THERMID_INLINE X of(X ta, X tb) { return ta - tb; }
    template <class X>
    static THERMID_INLINE Conduct<X> heat(X d, X c0, Looked<X> x) {
        const X phi = x.g * d, qa = c0 * (x.g1 * d + x.g);
        return {c0 * phi, phi, qa, -qa, number<X>(0.0)};
    }
};

template <class Over>
struct Tabulated {  // c0 g(u) (Ta - Tb)
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C, const T& tables) { return Over::heat(ta - tb, c0, tables.at(0, Over::of(ta, tb))); }
};

// c0 (u - c1)+ (Ta - Tb), the corner rounded over ROUND on either side: a table of straight lines is a sum of these, one for each of its
// points, so that its points may move with their derivatives.
constexpr double ROUND = 1e-3;  // [K]
template <class Over>
struct Hinge {
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C c1, const T&) {
        const X d = ta - tb, u = Over::of(ta, tb) - c1, w = u + ROUND, none = number<X>(0.0);
        const auto near = u > number<X>(-ROUND), past = u >= number<X>(ROUND);
        const Looked<X> x{pick(past, u, pick(near, w * w * (0.25 / ROUND), none)), pick(past, number<X>(1.0), pick(near, w * (0.5 / ROUND), none))};
        Conduct<X> r = Over::heat(d, c0, x);
        r.q1 = -(c0 * x.g1 * d);
        return r;
    }
};

struct Gas {  // gas at rest: c0 the conductance of the continuum, c1 that of free molecules over it, which goes with pressure
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C c1, const T& tables) {
        const X tm = (ta + tb) * 0.5, d = ta - tb;
        const Looked<X> g = tables.at(0, tm);
        const X s = Elementary<X>::root(tm * (1.0 / GAS_ANCHOR)), k = g.g * s, w = c1 + k, share = c1 / w;
        const X dt = 0.5 * d * share * (g.g1 - g.g * (g.g1 * s + k / (2.0 * tm)) / w), phi = d * g.g * share;
        return {c0 * phi, phi, c0 * (dt + g.g * share), c0 * (dt - g.g * share), c0 * d * g.g * k / (w * w)};
    }
};

struct Natural {  // free convection beyond conduction: tables of Nu over signed Ra^(1/4), k and Ra^(1/4) over film temperature
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C c1, const T& tables) {
        const X tm = (ta + tb) * 0.5, d = ta - tb, dd = d * d, e = dd + SMOOTH2;
        const Roots<X> r = Elementary<X>::roots(e, dd, Quarter{});
        const X y3 = 1.0 / (r.power * r.power * r.power), w = d * y3;
        const Looked<X> g = tables.at(1, tm), f = tables.at(2, tm), n = tables.at(0, c1 * f.g * w);
        const X rise = d * g.g * n.g1 * c1, dt = 0.5 * (d * g.g1 * n.g + rise * f.g1 * w), phi = d * g.g * n.g;
        const X across = g.g * n.g + rise * f.g * y3 * (1.0 - 0.75 * r.share);
        return {c0 * phi, phi, c0 * (dt + across), c0 * (dt - across), c0 * d * g.g * n.g1 * f.g * w};
    }
};

struct Potential {  // each end has a table: integrals of k over temperature, or the temperature that belongs to an enthalpy
    template <class X, class C, class T>
    static THERMID_INLINE Conduct<X> heat(X ta, X tb, X c0, C, const T& tables) {
        const Looked<X> g = tables.at(0, ta), f = tables.at(1, tb);
        const X phi = g.g - f.g;
        return {c0 * phi, phi, c0 * g.g1, -(c0 * f.g1), number<X>(0.0)};
    }
};

// How a conductor stands in a network: linear in temperatures; heat to its second end only; a knee where what it is over passes c1, or a
// point of its table where straight lines meet.
enum ConductorTrait { PLAIN = 0, STRAIGHT = 1, ONE_WAY = 2, KNEE_OF_MEAN = 4, KNEE_OF_DIFFERENCE = 8, KNEE_OF_ENDS = 16 };

// One row for each law: its number, function, name, coefficients, tables and traits. Rows of one law stand together, in this order.
#define THERMID_CONDUCTORS(ROW)                                                          \
    ROW(LINEAR, Linear, "linear", 1, 0, STRAIGHT)                                        \
    ROW(POWER, Power, "power", 2, 0, PLAIN)                                              \
    ROW(RADIATION, Radiation, "radiation", 1, 0, PLAIN)                                  \
    ROW(FLOW, Linear, "flow", 1, 0, STRAIGHT | ONE_WAY)                                  \
    ROW(TABLE_MEAN, Tabulated<Mean>, "table", 1, 1, KNEE_OF_MEAN)                        \
    ROW(TABLE_DIFF, Tabulated<Difference>, "table of difference", 1, 1, KNEE_OF_DIFFERENCE) \
    ROW(GAS, Gas, "gas", 2, 1, PLAIN)                                                    \
    ROW(NATURAL, Natural, "natural", 2, 3, PLAIN)                                        \
    ROW(POTENTIAL, Potential, "potential", 1, 2, KNEE_OF_ENDS)                           \
    ROW(HINGE_MEAN, Hinge<Mean>, "hinge", 2, 0, KNEE_OF_MEAN)                            \
    ROW(HINGE_DIFF, Hinge<Difference>, "hinge of difference", 2, 0, KNEE_OF_DIFFERENCE)

// ---- Laws of loads: what a load gives, and the share of it that its control lets through

// Power, its slope in the temperature of the law, and dp/dc.
template <class X>
struct Heat { X p, pt, pc[4]; };

struct Signal {  // c0
    template <class X, class T>
    static THERMID_INLINE Heat<X> heat(X, const X c[4], const T&) {
        const X none = number<X>(0.0);
        return {c[0], none, {number<X>(1.0), none, none, none}};
    }
};

struct Polynomial {  // c0 (1 + c1 x + c2 x^2), x = T - c3
    template <class X, class T>
    static THERMID_INLINE Heat<X> heat(X t, const X c[4], const T&) {
        const X x = t - c[3], unit = 1.0 + x * (c[1] + c[2] * x), slope = c[0] * (c[1] + 2.0 * c[2] * x);
        return {c[0] * unit, slope, {unit, c[0] * x, c[0] * x * x, -slope}};
    }
};

struct Exponential {  // c0 exp(c1 (T - c2))
    template <class X, class T>
    static THERMID_INLINE Heat<X> heat(X t, const X c[4], const T&) {
        const X x = t - c[2], unit = Elementary<X>::exponential(c[1] * x), p = c[0] * unit, slope = p * c[1];
        return {p, slope, {unit, p * x, -slope, number<X>(0.0)}};
    }
};

struct TabulatedPower {  // c0 g(T)
    template <class X, class T>
    static THERMID_INLINE Heat<X> heat(X t, const X c[4], const T& tables) {
        const Looked<X> x = tables.at(0, t);
        const X none = number<X>(0.0);
        return {c[0] * x.g, c[0] * x.g1, {x.g, none, none, none}};
    }
};

// One row for each law: its number, function, name, coefficients and tables.
#define THERMID_LOADS(ROW)                               \
    ROW(SIGNAL, Signal, "signal", 1, 0)                  \
    ROW(POLY, Polynomial, "polynomial", 4, 0)            \
    ROW(EXP, Exponential, "exponential", 3, 0)           \
    ROW(TABLE, TabulatedPower, "table", 1, 1)

// The share of a load's power, from 0 to 1, its slope in the sensor's temperature, and ds/dc.
template <class X>
struct Share { X s, st, sc[3]; };

struct Thermostat {  // all while it is on, else nothing; c0, c1: where it switches on and off
    template <class X>
    static THERMID_INLINE Share<X> share(X, const X[3], bool on) {
        const X none = number<X>(0.0);
        return {number<X>(on ? 1.0 : 0.0), none, {none, none, none}};
    }
};

struct Proportional {  // c0 (c1 - T) / c2: gain, set point and full power, which is negative where it cools
    template <class X>
    static THERMID_INLINE Share<X> share(X t, const X c[3], bool) {
        const X gap = c[1] - t, wanted = c[0] * gap, none = number<X>(0.0), per = 1.0 / c[2], part = wanted * per;
        const auto some = wanted * c[2] > none, full = wanted * c[2] >= c[2] * c[2];  // no power, no share: nothing is divided by zero
        auto within = [&](X band, X top) { return pick(some, pick(full, top, band), none); };
        return {within(part, number<X>(1.0)), within(-c[0] * per, none), {within(gap * per, none), within(c[0] * per, none), within(-part * per, none)}};
    }
};

// One row for each control: its number, function, name and coefficients.
#define THERMID_CONTROLS(ROW)                            \
    ROW(THERMOSTAT, Thermostat, "thermostat", 2)         \
    ROW(PROPORTIONAL, Proportional, "proportional", 3)

// ---- The tables of laws

#define THERMID_KIND(KIND, ...) KIND,
enum ConductorKind { THERMID_CONDUCTORS(THERMID_KIND) CONDUCTOR_KINDS };
enum LoadKind { THERMID_LOADS(THERMID_KIND) LOAD_KINDS };
enum ControlKind { THERMID_CONTROLS(THERMID_KIND) CONTROL_KINDS };
#undef THERMID_KIND

struct LawRow { const char *kind, *name; int coefficients, tables, traits; };
#define THERMID_LAW_ROW(KIND, LAW, NAME, COEFFICIENTS, TABLES, TRAITS) {#KIND, NAME, COEFFICIENTS, TABLES, TRAITS},
#define THERMID_LOAD_ROW(KIND, LAW, NAME, COEFFICIENTS, TABLES) {#KIND, NAME, COEFFICIENTS, TABLES, PLAIN},
#define THERMID_CONTROL_ROW(KIND, CONTROL, NAME, COEFFICIENTS) {#KIND, NAME, COEFFICIENTS, 0, PLAIN},
constexpr LawRow CONDUCTOR_LAWS[] = {THERMID_CONDUCTORS(THERMID_LAW_ROW)};
constexpr LawRow LOAD_LAWS[] = {THERMID_LOADS(THERMID_LOAD_ROW)};
constexpr LawRow CONTROL_LAWS[] = {THERMID_CONTROLS(THERMID_CONTROL_ROW)};
#undef THERMID_CONTROL_ROW
#undef THERMID_LAW_ROW
#undef THERMID_LOAD_ROW

constexpr int MOST_TABLES = 3;  // of one law

constexpr bool has_second(int kind) { return CONDUCTOR_LAWS[kind].coefficients > 1; }
constexpr int tables_of(int kind) { return CONDUCTOR_LAWS[kind].tables; }
constexpr bool is(int kind, int trait) { return (CONDUCTOR_LAWS[kind].traits & trait) != 0; }
constexpr bool has_knee(int kind) { return is(kind, KNEE_OF_MEAN | KNEE_OF_DIFFERENCE | KNEE_OF_ENDS); }

// Calls f with the law of a kind.
#define THERMID_CASE(KIND, LAW, ...) case KIND: f(LAW{}); return;
template <class F>
THERMID_INLINE void with_conductor(int kind, F f) {
    switch (kind) { THERMID_CONDUCTORS(THERMID_CASE) }
}
template <class F>
THERMID_INLINE void with_load(int kind, F f) {
    switch (kind) { THERMID_LOADS(THERMID_CASE) }
}
template <class F>
THERMID_INLINE void with_control(int kind, F f) {
    switch (kind) { THERMID_CONTROLS(THERMID_CASE) }
}
#undef THERMID_CASE

// Heat of one conductor; dq/dc1, which may cost a logarithm, where it is SOUGHT.
template <bool SOUGHT = false, class X>
inline Conduct<X> conductor(int kind, X ta, X tb, X c0, X c1, const Table* tables) {
    Conduct<X> r{};
    with_conductor(kind, [&](auto law) {
        const Conduct<X> x = law.heat(ta, tb, c0, c1, Tables{tables});
        r = {x.q, x.phi, x.qa, x.qb, SOUGHT ? x.q1 : number<X>(0.0)};
    });
    return r;
}

// Power of a load under its control: slopes in the temperatures of law and sensor, and in the coefficients of both.
template <class X>
struct Controlled { X p, pt, ps, pc[4], sc[3]; };

// c: of the law; d: of the control; control: its kind, or -1 for none. limited: d2 is the law's own c0, so that within the band the power is
// gain times what is missing, whatever c0 is: its derivative there is zero, and not what rounding leaves of two that cancel.
template <class X, class T>
THERMID_INLINE Controlled<X> load(int kind, int control, X t, X sensor, const X c[4], const X d[3], const T& tables, bool on, bool limited) {
    Heat<X> w{};
    with_load(kind, [&](auto law) { w = law.heat(t, c, tables); });
    const X none = number<X>(0.0);
    if (control < 0) return {w.p, w.pt, none, {w.pc[0], w.pc[1], w.pc[2], w.pc[3]}, {none, none, none}};
    Share<X> k{};
    with_control(control, [&](auto law) { k = law.share(sensor, d, on); });
    const X by_c0 = limited ? pick(k.s >= number<X>(1.0), w.pc[0], none) : w.pc[0] * k.s;
    return {w.p * k.s, w.pt * k.s, w.p * k.st, {by_c0, w.pc[1] * k.s, w.pc[2] * k.s, w.pc[3] * k.s}, {w.p * k.sc[0], w.p * k.sc[1], w.p * k.sc[2]}};
}

}  // namespace thermid
