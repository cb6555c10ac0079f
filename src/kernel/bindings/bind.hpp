// What every binding needs: arrays in, arrays out, and checks of shapes.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "integrator/integrator.hpp"

namespace thermid {

namespace nb = nanobind;

template <class T, int D>
using In = nb::ndarray<const T, nb::ndim<D>, nb::c_contig, nb::device::cpu>;
using Reals = In<double, 1>;
using Ints = In<int32_t, 1>;
using Csr = std::tuple<Ints, Ints, Reals, int>;
using Weights = std::tuple<Ints, Ints, Reals>;

inline void need(bool ok, const char* message) {
    if (!ok) throw std::invalid_argument(message);
}

template <class T, class A>
std::vector<T> copy(const A& a) {
    return std::vector<T>(a.data(), a.data() + a.size());
}

template <class T>
nb::object array(std::unique_ptr<T[]> data, std::initializer_list<size_t> shape) {
    T* raw = data.release();
    nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<T*>(p); });
    return nb::cast(nb::ndarray<nb::numpy, T>(raw, shape, owner));
}

std::pair<nb::object, double*> room(nb::tuple shape);  // for large outputs

template <class T, class V>
nb::object array(const std::vector<V>& v, std::initializer_list<size_t> shape) {
    std::unique_ptr<T[]> data(new T[v.size() + 1]);
    std::copy(v.begin(), v.end(), data.get());
    return array(std::move(data), shape);
}

template <class V>
nb::object reals(const std::vector<V>& v) { return array<double>(v, {v.size()}); }
template <class V>
nb::object ints(const std::vector<V>& v) { return array<int32_t>(v, {v.size()}); }

inline CoefJacobian jacobian_of(const Problem& p, const std::optional<Csr>& csr) {
    CoefJacobian d;
    if (!csr) return d;
    const auto& [indptr, indices, data, np] = *csr;
    need(np >= 0 && indptr.size() == static_cast<size_t>(p.nc) + 1, "dcoef: indptr needs one entry more than there are coefficients");
    need(indices.size() == data.size() && indptr(0) == 0 && indptr(p.nc) == static_cast<int>(data.size()), "dcoef: indptr, indices and data do not fit");
    d.np = np;
    d.indptr = copy<int>(indptr);
    d.indices = copy<int>(indices);
    d.data = copy<double>(data);
    for (int j = 0; j < p.nc; ++j) need(d.indptr[j] <= d.indptr[j + 1], "dcoef: indptr must not decrease");
    for (int i : d.indices) need(i >= 0 && i < np, "dcoef: no such parameter");
    return d;
}

// What every kind of run may be told of its steps, by name.
inline Options options_of(const nb::kwargs& given) {
    Options o;
    for (const auto [key, value] : given) {
        const std::string name = nb::cast<std::string>(key);
        if (name == "rtol") o.rtol = nb::cast<double>(value);
        else if (name == "atol") o.atol = nb::cast<double>(value);
        else if (name == "input_atol") o.input_atol = nb::cast<double>(value);
        else if (name == "max_step") o.max_step = nb::cast<double>(value);
        else if (name == "max_steps") o.max_steps = nb::cast<long>(value);
        else if (name == "turnings") o.turnings = nb::cast<bool>(value);
        else if (name != "breaks") throw nb::type_error(("no such option: " + name).c_str());
        else if (!value.is_none()) o.breaks = copy<double>(nb::cast<Reals>(value));
    }
    need(o.rtol >= 0.0 && o.atol > 0.0 && o.input_atol > 0.0 && o.max_step > 0.0, "tolerances and max_step must be positive");
    return o;
}

// Weighted sums of temperatures, as CSR over nodes and boundaries.
inline Sums sums_of(const std::optional<Weights>& given, int nodes) {
    Sums out;
    if (!given) return out;
    const auto& [begin, node, weight] = *given;
    need(begin.size() > 0 && begin(0) == 0 && node.size() == weight.size() && begin(begin.size() - 1) == static_cast<int>(node.size()), "sums: do not fit");
    out.begin = copy<int>(begin);
    out.node = copy<int>(node);
    out.weight = copy<double>(weight);
    for (int k = 0; k < out.size(); ++k) need(out.begin[k] <= out.begin[k + 1], "sums: begin must not decrease");
    for (int i : out.node) need(i >= 0 && i < nodes, "sums: no such node");
    return out;
}

// Columns, times and temperatures of turning points.
inline nb::tuple turnings_of(const std::vector<Turnings::Point>& found) {
    std::vector<int> column;
    std::vector<double> time, kelvin;
    for (const Turnings::Point& p : found) {
        column.push_back(p.column);
        time.push_back(p.time);
        kelvin.push_back(p.kelvin);
    }
    return nb::make_tuple(ints(column), reals(time), reals(kelvin));
}

inline std::vector<int> thermostats_of(const Problem& p, const std::optional<Ints>& on) {
    if (!on) return {};
    need(on->size() == static_cast<size_t>(p.switches()), "on: one entry for each control");
    return copy<int>(*on);
}

void read_controls(Problem& p, const nb::dict& given);
void bind_laws(nb::module_& m);
void bind_modal(nb::module_& m);
void bind_leastsquares(nb::module_& m);
void bind_ensemble(nb::module_& m);
void bind_large(nb::module_& m);

inline std::vector<Table> read_tables(const nb::list& tables) {
    std::vector<Table> out;
    for (nb::handle h : tables) {
        auto [x, y, d] = nb::cast<std::tuple<Reals, Reals, Reals>>(h);
        need(x.size() > 0 && x.size() == y.size() && (x.size() == d.size() || d.size() == 0), "tables: knots, values and slopes differ in length");
        for (size_t i = 1; i < x.size(); ++i) need(x(i) > x(i - 1), "tables: knots must increase");
        out.push_back({copy<double>(x), copy<double>(y), copy<double>(d)});
    }
    return out;
}

inline std::vector<Input> read_inputs(const nb::list& inputs) {
    std::vector<Input> out;
    for (nb::handle h : inputs) {
        auto [kind, a, b] = nb::cast<std::tuple<int, Reals, Reals>>(h);
        need(kind >= 0 && kind < FOLLOWED, "inputs: no such kind");
        Input in;
        in.kind = kind;
        if (in.sampled()) {
            need(a.size() > 0 && a.size() == b.size(), "inputs: times and values differ in length, or are empty");
            for (size_t i = 0; i < a.size(); ++i) {
                need(std::isfinite(a(i)) && std::isfinite(b(i)), "inputs: times and values must be finite");
                need(i == 0 || a(i) > a(i - 1), "inputs: times must increase");
            }
            in.set_samples(a.data(), b.data(), static_cast<int>(a.size()));
        } else {
            need(a.size() == (kind == SINE ? 4u : 1u), "inputs: SINE takes mean, amplitude, period, phase; CONSTANT takes its value");
            in.mean = a(0);
            if (kind == SINE) {
                in.amplitude = a(1);
                in.period = a(2);
                in.phase = a(3);
                need(in.period > 0.0, "inputs: the period must be positive");
            }
        }
        out.push_back(std::move(in));
    }
    return out;
}

// A problem with its edges where coefficients put them; itself where it has none.
struct At {
    std::optional<Problem> moved;
    const Problem& problem;
    At(const Problem& p, const double* coef) : moved(p.edges.empty() ? std::nullopt : std::optional<Problem>(p.at_edges(coef))), problem(moved ? *moved : p) {}
};

// Lets the interrupt key end a long run, which goes on without the interpreter's lock.
inline void poll_interrupt() {
    nb::gil_scoped_acquire held;
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

}  // namespace thermid
