// Bindings of the integrator of large networks.
#include <chrono>

#include "bindings/bind.hpp"
#include "large/large.hpp"

namespace thermid {

using namespace nb::literals;

namespace {

struct PyLarge {
    int status, node, method;
    double time, rate, longest;
    long steps, rejected, evaluations, iterations;
    nb::object traces, fields, final_temperatures, final_states, load_energy, boundary_energy, turnings;
};

void padded(const Reals& g, const Links& l, std::vector<double>& out) {
    need(g.size() == static_cast<size_t>(l.n), "links: a grid needs one conductance per cell and direction");
    out.assign(static_cast<size_t>(l.n) + l.plane, 0.0);
    std::copy(g.data(), g.data() + l.n, out.begin() + l.plane);
}

// links: (shape, gx, gy, gz) of a grid, or (indptr, indices, values).
void read_links(nb::tuple given, int n, Links& l) {
    l.n = n;
    if (nb::len(given) == 4) {
        auto [shape, gx, gy, gz] = nb::cast<std::tuple<Ints, Reals, Reals, Reals>>(given);
        need(shape.size() == 3 && shape(0) > 0 && shape(1) > 0 && shape(2) > 0, "links: a grid has three sizes");
        need(static_cast<long long>(shape(0)) * shape(1) * shape(2) == n, "links: the grid does not have as many cells as capacities");
        l.row = shape(2);
        l.plane = shape(1) * shape(2);
        padded(gx, l, l.gx);
        padded(gy, l, l.gy);
        padded(gz, l, l.gz);
        for (int i = 0; i < n; ++i) {
            const bool last[3] = {i / l.plane == shape(0) - 1, i / l.row % shape(1) == shape(1) - 1, i % l.row == l.row - 1};
            const double g[3] = {gx(i), gy(i), gz(i)};
            for (int k = 0; k < 3; ++k)
                need(g[k] >= 0.0 && std::isfinite(g[k]) && (!last[k] || g[k] == 0.0), "links: conductances must not be negative, zero at the last cell");
        }
        return;
    }
    auto [indptr, indices, values] = nb::cast<std::tuple<Ints, Ints, Reals>>(given);
    need(indptr.size() == static_cast<size_t>(n) + 1 && indices.size() == values.size(), "links: indptr, indices and values do not fit");
    l.indptr = copy<int>(indptr);
    l.indices = copy<int>(indices);
    l.value = copy<double>(values);
    need(l.indptr[0] == 0 && l.indptr[n] == static_cast<int>(l.indices.size()), "links: indptr does not fit");
    for (int i = 0; i < n; ++i) need(l.indptr[i] <= l.indptr[i + 1], "links: indptr must not decrease");
    for (int i : l.indices) need(i >= 0 && i < n, "links: no such node");
    for (double g : l.value) need(g >= 0.0 && std::isfinite(g), "links: conductances must not be negative");
}

void make_large(LargeProblem* self, Reals capacity, nb::tuple links, In<int32_t, 2> row_groups, Reals row_exponents, Ints a, Ints b, Reals c0,
                In<int32_t, 2> load_groups, Ints node, In<double, 2> c, In<double, 2> d, int tags, Ints boundary_input, Reals boundary_offset, nb::list tables,
                nb::list inputs, Ints store) {
    LargeProblem p;
    p.capacity = copy<double>(capacity);
    p.tags = tags;
    read_links(links, static_cast<int>(capacity.size()), p.links);
    need(row_groups.shape(1) == 6 && row_exponents.size() == row_groups.shape(0), "rows: groups must be (groups, 6), with an exponent each");
    need(a.size() == b.size() && a.size() == c0.size(), "rows: arrays differ in length");
    for (size_t g = 0; g < row_groups.shape(0); ++g)
        p.rows.push_back({row_groups(g, 0), row_groups(g, 1), row_groups(g, 2), row_groups(g, 3), row_exponents(g), row_groups(g, 4), row_groups(g, 5)});
    p.a = copy<int>(a);
    p.b = copy<int>(b);
    p.c0 = copy<double>(c0);
    need(load_groups.shape(1) == 7, "loads: groups must be (groups, 7)");
    need(c.shape(0) == 4 && c.shape(1) == node.size(), "loads: coefficients must be (4, rows)");
    need(d.shape(0) == 3 && d.shape(1) == node.size(), "loads: coefficients of controls must be (3, rows)");
    for (size_t g = 0; g < load_groups.shape(0); ++g)
        p.loads.push_back({load_groups(g, 0), load_groups(g, 1), load_groups(g, 2), load_groups(g, 3), load_groups(g, 4), load_groups(g, 5), load_groups(g, 6)});
    p.node = copy<int>(node);
    for (int k = 0; k < 3; ++k) p.d[k].assign(d.data() + k * node.size(), d.data() + (k + 1) * node.size());
    for (int k = 0; k < 4; ++k) p.c[k].assign(c.data() + k * node.size(), c.data() + (k + 1) * node.size());
    p.boundary_input = copy<int>(boundary_input);
    p.boundary_offset = copy<double>(boundary_offset);
    p.tables = read_tables(tables);
    p.inputs = read_inputs(inputs);
    p.store = copy<int>(store);
    p.prepare();
    new (self) LargeProblem(std::move(p));
}

Observed read_observed(const LargeProblem& p, Ints kind, Ints indptr, Ints indices, Reals weights) {
    Observed seen{copy<int>(kind), copy<int>(indptr), copy<int>(indices), copy<double>(weights)};
    need(seen.indptr.size() == seen.kind.size() + 1 && seen.indptr[0] == 0, "observed: indptr does not fit");
    for (size_t k = 0; k < seen.kind.size(); ++k) need(seen.indptr[k] <= seen.indptr[k + 1], "observed: indptr must not decrease");
    need(seen.indptr.back() == static_cast<int>(seen.indices.size()) && seen.indices.size() == seen.weights.size(), "observed: lengths differ");
    for (int i : seen.indices) need(i >= 0 && i < 2 * p.n + p.nb, "observed: no such node or boundary");
    return seen;
}

void check_times(Reals times, double t0, double t_end) {
    for (size_t i = 0; i < times.size(); ++i)
        need(times(i) >= (i ? times(i - 1) : t0) && times(i) <= t_end, "output times must increase and lie in [t0, t_end]");
}

PyLarge integrate_large(const LargeProblem& p, Reals T0, double t0, double t_end, Reals times, Ints kind, Ints indptr, Ints indices, Reals weights,
                        Reals field_times, int method, double tolerance, double input_atol, double max_step, long max_steps, Reals breaks, bool turnings) {
    need(T0.size() == static_cast<size_t>(p.n), "T0: wrong length");
    need(std::isfinite(t0) && std::isfinite(t_end) && t_end >= t0, "t_end must not lie before t0");
    need(tolerance > 0.0 && input_atol > 0.0 && max_step > 0.0 && method >= AUTO && method <= TRBDF2, "tolerances and max_step must be positive");
    check_times(times, t0, t_end);
    check_times(field_times, t0, t_end);
    check_times(breaks, t0, t_end);
    const Observed seen = read_observed(p, kind, indptr, indices, weights);
    LargeOptions o;
    o.tolerance = tolerance;
    o.input_atol = input_atol;
    o.max_step = max_step;
    o.max_steps = max_steps;
    o.method = method;
    o.turnings = turnings;
    o.breaks = copy<double>(breaks);
    o.poll = [] {
        nb::gil_scoped_acquire held;
        poll_interrupt();
    };
    const size_t nt = times.size(), nf = field_times.size(), no = seen.kind.size(), n = p.n;
    std::unique_ptr<double[]> traces(new double[nt * no + 1]), fields(new double[nf * n + 1]);
    LargeResult r;
    r.traces = traces.get();
    r.fields = fields.get();
    const std::vector<double> at = copy<double>(times), field_at = copy<double>(field_times);
    {
        nb::gil_scoped_release free;
        LargeRun run(p, o);
        run.run(T0.data(), t0, t_end, at, seen, field_at, r);
    }
    PyLarge out{r.status, r.node, r.method, r.time, r.rate, r.longest, r.steps, r.rejected, r.evaluations, r.iterations, {}, {}, {}, {}, {}, {}, {}};
    out.traces = array(std::move(traces), {nt, no});
    out.fields = array(std::move(fields), {nf, n});
    out.final_temperatures = reals(r.final_t);
    out.final_states = reals(r.final_state);
    out.load_energy = reals(r.load_energy);
    out.boundary_energy = reals(r.boundary_energy);
    out.turnings = turnings_of(r.turnings);
    return out;
}

// Heat into every node, what its rows add to the diagonal of the Jacobian (positive cools), symmetric conductance of rows between two nodes,
// power per load, heat into each boundary.
nb::tuple heat_large(const LargeProblem& p, Reals T, double t) {
    need(T.size() == static_cast<size_t>(p.n), "T: wrong length");
    Field at(p.links);
    std::copy(T.data(), T.data() + p.n, at.data());
    std::vector<double> u, heat(p.n), slope(p.n, 0.0);
    for (const Input& in : p.inputs) u.push_back(in.at(t));
    RowHeat rows(p);
    for (size_t k = 0; k < p.special.size(); ++k) rows.t[k] = at[p.special[k]];
    rows.evaluate(p, u.data(), true);
    p.links.flow(at.data(), heat.data());
    for (size_t k = 0; k < p.special.size(); ++k) {
        heat[p.special[k]] += rows.heat[k];
        slope[p.special[k]] += rows.slope[k];
    }
    return nb::make_tuple(reals(heat), reals(slope), reals(rows.pair), reals(rows.power), reals(rows.outflow));
}

}  // namespace

void bind_large(nb::module_& m) {
    nb::class_<PyLarge>(m, "LargeResult")
        .def_ro("status", &PyLarge::status).def_ro("node", &PyLarge::node).def_ro("method", &PyLarge::method).def_ro("time", &PyLarge::time)
        .def_ro("rate", &PyLarge::rate).def_ro("longest", &PyLarge::longest).def_ro("steps", &PyLarge::steps)
        .def_ro("rejected", &PyLarge::rejected).def_ro("evaluations", &PyLarge::evaluations).def_ro("iterations", &PyLarge::iterations)
        .def_ro("traces", &PyLarge::traces).def_ro("fields", &PyLarge::fields)
        .def_ro("final_temperatures", &PyLarge::final_temperatures).def_ro("final_states", &PyLarge::final_states).def_ro("load_energy", &PyLarge::load_energy)
        .def_ro("boundary_energy", &PyLarge::boundary_energy).def_ro("turnings", &PyLarge::turnings);
    nb::class_<LargeProblem>(m, "LargeProblem")
        .def("__init__", &make_large, "capacity"_a, "links"_a, "row_groups"_a, "row_exponents"_a, "row_a"_a, "row_b"_a, "row_coef"_a,
             "load_groups"_a, "load_node"_a, "load_coef"_a, "load_control"_a, "tags"_a, "boundary_input"_a, "boundary_offset"_a, "tables"_a, "inputs"_a, "store"_a)
        .def("integrate", &integrate_large, "T0"_a, "t0"_a, "t_end"_a, "times"_a, "observed_kind"_a, "observed_indptr"_a, "observed_indices"_a,
             "observed_weights"_a, "field_times"_a, nb::kw_only(), "method"_a = 0, "tolerance"_a = 1e-3, "input_atol"_a = 1e-4,
             "max_step"_a = std::numeric_limits<double>::infinity(), "max_steps"_a = 1000000L, "breaks"_a, "turnings"_a = false)
        .def("heat", &heat_large, "T"_a, "t"_a);
    m.attr("LARGE_AUTO") = static_cast<int>(AUTO);
    m.attr("LARGE_RKC2") = static_cast<int>(RKC2);
    m.attr("LARGE_TRBDF2") = static_cast<int>(TRBDF2);
}

}  // namespace thermid
