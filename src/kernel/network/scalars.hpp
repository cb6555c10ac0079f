// What laws compute with: doubles, dual numbers and, through Elementary, lanes of doubles side by side.
#pragma once
#include <cmath>

// Laws are written into the loops that use them: the lane code is compiled for instructions that other code must not meet.
#if defined(__GNUC__)
#define THERMID_INLINE inline __attribute__((always_inline))
#else
#define THERMID_INLINE inline
#endif

namespace thermid {

// A value and its derivative in one direction, of doubles or of lanes.
template <class V>
struct DualOf {
    V v, e;
    THERMID_INLINE DualOf() : v(V{}), e(V{}) {}
    THERMID_INLINE DualOf(double x) : v(x - V{}), e(V{}) {}
    THERMID_INLINE DualOf(V value, V slope) : v(value), e(slope) {}
    friend THERMID_INLINE DualOf operator+(DualOf a, DualOf b) { return {a.v + b.v, a.e + b.e}; }
    friend THERMID_INLINE DualOf operator-(DualOf a, DualOf b) { return {a.v - b.v, a.e - b.e}; }
    friend THERMID_INLINE DualOf operator-(DualOf a) { return {-a.v, -a.e}; }
    friend THERMID_INLINE DualOf operator*(DualOf a, DualOf b) { return {a.v * b.v, a.e * b.v + a.v * b.e}; }
    friend THERMID_INLINE DualOf operator/(DualOf a, DualOf b) {
        const V q = a.v / b.v;
        return {q, (a.e - q * b.e) / b.v};
    }
    friend THERMID_INLINE auto operator>(DualOf a, DualOf b) { return a.v > b.v; }
    friend THERMID_INLINE auto operator>=(DualOf a, DualOf b) { return a.v >= b.v; }
};
using Dual = DualOf<double>;

template <class X>
THERMID_INLINE X number(double x) { return x - X{}; }
template <class M, class X>
THERMID_INLINE X pick(M yes, X a, X b) { return yes ? a : b; }
template <class M, class V>
THERMID_INLINE DualOf<V> pick(M yes, DualOf<V> a, DualOf<V> b) { return {yes ? a.v : b.v, yes ? a.e : b.e}; }

struct Quarter {};  // the exponent 1/4 of laminar natural convection, whose powers need no logarithm
template <class X>
THERMID_INLINE X exponent_of(X m) { return m; }
template <class X>
THERMID_INLINE X exponent_of(Quarter) { return number<X>(0.25); }

// e^(m/2), and the share d^2/e of e = d^2 + s.
template <class X>
struct Roots { X power, share; };

// Elementary functions; those of lanes stand in ensemble_numbers.inc.
template <class X>
struct Elementary;
template <>
struct Elementary<double> {
    static THERMID_INLINE double exponential(double x) { return std::exp(x); }
    static THERMID_INLINE double logarithm(double x) { return std::log(x); }
    static THERMID_INLINE double root(double x) { return std::sqrt(x); }
    static THERMID_INLINE double times_logarithm(double a, double x) { return a != 0.0 ? a * std::log(x) : 0.0; }
    static THERMID_INLINE Roots<double> roots(double e, double dd, Quarter) { return {std::sqrt(std::sqrt(std::sqrt(e))), dd / e}; }
    static THERMID_INLINE Roots<double> roots(double e, double dd, double m) {
        return {m == 0.25 ? std::sqrt(std::sqrt(std::sqrt(e))) : std::pow(e, 0.5 * m), dd / e};
    }
};
template <class V>
struct Elementary<DualOf<V>> {
    using Of = Elementary<V>;
    static THERMID_INLINE DualOf<V> exponential(DualOf<V> x) { const V g = Of::exponential(x.v); return {g, g * x.e}; }
    static THERMID_INLINE DualOf<V> logarithm(DualOf<V> x) { return {Of::logarithm(x.v), x.e / x.v}; }
    static THERMID_INLINE DualOf<V> root(DualOf<V> x) { const V g = Of::root(x.v); return {g, 0.5 * x.e / g}; }
    static THERMID_INLINE Roots<DualOf<V>> roots(DualOf<V> e, DualOf<V> dd, Quarter m) {
        const Roots<V> r = Of::roots(e.v, dd.v, m);
        const V grown = e.e / e.v;
        return {{r.power, 0.125 * r.power * grown}, {r.share, (1.0 - r.share) * grown}};  // d^2 and e grow alike
    }
    static THERMID_INLINE Roots<DualOf<V>> roots(DualOf<V> e, DualOf<V> dd, DualOf<V> m) {
        const Roots<V> r = Of::roots(e.v, dd.v, m.v);
        const V grown = e.e / e.v;
        return {{r.power, 0.5 * r.power * (m.v * grown + Of::times_logarithm(m.e, e.v))}, {r.share, (1.0 - r.share) * grown}};
    }
};

}  // namespace thermid
