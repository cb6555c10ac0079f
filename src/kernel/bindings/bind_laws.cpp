// Bindings of the table of laws: its rows by name, and the heat of one conductor with its derivatives.
#include "bindings/bind.hpp"
#include "ensemble/ensemble.hpp"

namespace thermid {

using namespace nb::literals;

namespace {

// Name -> (kind, coefficients, tables, linear in temperatures, one way).
template <size_t N>
nb::dict rows_by_name(nb::module_& m, const LawRow (&rows)[N]) {
    nb::dict out;
    for (size_t k = 0; k < N; ++k) {
        const LawRow& r = rows[k];
        m.attr(r.kind) = static_cast<int>(k);
        out[r.name] = nb::make_tuple(static_cast<int>(k), r.coefficients, r.tables, (r.traits & STRAIGHT) != 0, (r.traits & ONE_WAY) != 0);
    }
    return out;
}

void need_row(int kind, size_t tables, In<double, 2> c, size_t m) {
    need(kind >= 0 && kind < CONDUCTOR_KINDS, "conductor: no such kind");
    need(tables >= static_cast<size_t>(tables_of(kind)), "conductor: this law needs more tables");
    need(c.shape(0) == m && c.shape(1) == 2, "conductor: coefficients must be (temperatures, 2)");
}

// (5, temperatures): heat, its derivatives in both temperatures, in c0 and in c1. by: of what the derivative of all that is wanted instead:
// 0 and 1 the temperatures, 2 and 3 the coefficients.
nb::object conductor_heat(int kind, Reals hot, Reals cold, In<double, 2> c, nb::list tables, int by) {
    const size_t m = hot.size();
    need(cold.size() == m, "conductor: temperatures differ in length");
    const std::vector<Table> at = read_tables(tables);
    need_row(kind, at.size(), c, m);
    std::unique_ptr<double[]> out(new double[5 * m + 1]);
    auto write = [&](size_t i, double q, double qa, double qb, double phi, double q1) {
        const double of[5] = {q, qa, qb, phi, q1};
        for (int k = 0; k < 5; ++k) out[k * m + i] = of[k];
    };
    for (size_t i = 0; i < m; ++i) {
        if (by < 0) {
            const auto y = conductor<true>(kind, hot(i), cold(i), c(i, 0), c(i, 1), at.data());
            write(i, y.q, y.qa, y.qb, y.phi, y.q1);
        } else {
            const auto y = conductor<true>(kind, Dual(hot(i), by == 0), Dual(cold(i), by == 1), Dual(c(i, 0), by == 2), Dual(c(i, 1), by == 3), at.data());
            write(i, y.q.e, y.qa.e, y.qb.e, y.phi.e, y.q1.e);
        }
    }
    return array(std::move(out), {size_t(5), m});
}

// The same by the lane code: heat, heat per c0, dq/dTa, dq/dTb, and the derivatives of the last two in Ta, Tb, Ta, Tb.
nb::object conductor_lanes(int kind, Reals hot, Reals cold, In<double, 2> c, nb::list tables, const std::string& simd) {
    need(hot.size() == LANES && cold.size() == LANES, "conductor_lanes: eight temperatures at a time");
    const std::vector<Table> at = read_tables(tables);
    need_row(kind, at.size(), c, LANES);
    const LaneCode* code = lane_code(simd);
    need(code, "simd: this machine has no such instructions");
    std::vector<LaneTable> views;
    for (const Table& t : at) views.push_back(t.view());
    double in[4 * LANES], to[8 * LANES];
    for (int l = 0; l < LANES; ++l)
        for (int k = 0; k < 4; ++k) in[k * LANES + l] = k == 0 ? hot(l) : k == 1 ? cold(l) : c(l, k - 2);
    code->conductor(kind, views.data(), in, to);
    return array<double>(std::vector<double>(to, to + 8 * LANES), {size_t(8), size_t(LANES)});
}

}  // namespace

void bind_laws(nb::module_& m) {
    m.attr("CONDUCTOR_LAWS") = rows_by_name(m, CONDUCTOR_LAWS);
    m.attr("LOAD_LAWS") = rows_by_name(m, LOAD_LAWS);
    m.attr("CONTROL_LAWS") = rows_by_name(m, CONTROL_LAWS);
    m.attr("GAS_ANCHOR") = GAS_ANCHOR;
    m.attr("SMOOTHING") = std::sqrt(SMOOTH2);
    m.def("conductor_heat", &conductor_heat, "kind"_a, "hot"_a, "cold"_a, "coefficients"_a, "tables"_a, "by"_a = -1);
    m.def("conductor_lanes", &conductor_lanes, "kind"_a, "hot"_a, "cold"_a, "coefficients"_a, "tables"_a, "simd"_a = "auto");
}

}  // namespace thermid
