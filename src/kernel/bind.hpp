// What every binding needs: arrays in, arrays out, and checks of shapes.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "problem.hpp"

namespace thermid {

namespace nb = nanobind;

template <class T, int D>
using In = nb::ndarray<const T, nb::ndim<D>, nb::c_contig, nb::device::cpu>;
using Reals = In<double, 1>;
using Ints = In<int32_t, 1>;
using Csr = std::tuple<Ints, Ints, Reals, int>;

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

// Room for large outputs. numpy asks the system for large pages; without them half the time of filling it goes into page faults.
inline std::pair<nb::object, double*> room(nb::tuple shape) {
    nb::object made = nb::module_::import_("numpy").attr("empty")(shape);
    return {made, nb::cast<nb::ndarray<double, nb::c_contig, nb::device::cpu>>(made).data()};
}

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

void bind_modal(nb::module_& m);
void bind_leastsquares(nb::module_& m);

// Lets the interrupt key end a long run.
inline void poll_interrupt() {
    if (PyErr_CheckSignals() != 0) throw nb::python_error();
}

}  // namespace thermid
