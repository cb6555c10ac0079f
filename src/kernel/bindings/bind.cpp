// Python bindings: arrays in, arrays out. Shapes and indices are checked here; messages of failed runs are made in Python.
#include <cmath>

#include "bindings/bind.hpp"
#include "network/followers.hpp"

using namespace thermid;
using namespace nb::literals;

namespace {

struct PyResult {
    int status, node;
    double time;
    long filled, steps, rejected, newton, factorisations;
    nb::object traces, sensitivities, final_temperatures, final_sensitivities, on, event_times, event_controls, event_states, event_before;
    nb::object load_energy, boundary_energy, conductor_energy, turnings;
};

void make_problem(Problem* self, Ints capacity, Ints coef_input, Ints gain, Ints offset, Ints ckind, Ints ca, Ints cb,
                  In<int32_t, 2> ccoef, Ints ctable, Ints lkind, Ints lnode, In<int32_t, 2> lcoef, Ints lsensor, Ints ltable,
                  Ints lcontrol, Ints kkind, Ints ksensor, In<int32_t, 2> kcoef,
                  nb::list tables, nb::list inputs, std::optional<nb::dict> follow, nb::list edges) {
    auto p = std::make_unique<Problem>();
    p->n = static_cast<int>(capacity.size());
    p->nb = static_cast<int>(gain.size());
    p->nc = static_cast<int>(coef_input.size());
    need(offset.size() == gain.size(), "boundaries: gain and offset differ in length");
    p->capacity = copy<int>(capacity);
    p->coef_input = copy<int>(coef_input);
    p->gain = copy<int>(gain);
    p->offset = copy<int>(offset);
    const size_t m = ckind.size(), l = lkind.size();
    need(ca.size() == m && cb.size() == m && ctable.size() == m && ccoef.shape(0) == m && (m == 0 || ccoef.shape(1) == 4),
         "conductors: arrays differ in length, or coef is not (rows, 4)");
    const size_t controls = kkind.size();
    need(ksensor.size() == controls && kcoef.shape(0) == controls && (controls == 0 || kcoef.shape(1) == 3),
         "controls: arrays differ in length, or coef is not (rows, 3)");
    need(lnode.size() == l && lsensor.size() == l && ltable.size() == l && lcontrol.size() == l && lcoef.shape(0) == l && (l == 0 || lcoef.shape(1) == 4),
         "loads: arrays differ in length, or coef is not (rows, 4)");
    p->con.kind = copy<int>(ckind);
    p->con.a = copy<int>(ca);
    p->con.b = copy<int>(cb);
    p->con.table = copy<int>(ctable);
    for (size_t r = 0; r < m; ++r) {
        p->con.c0.push_back(ccoef(r, 0));
        p->con.c1.push_back(ccoef(r, 1));
    }
    p->load.kind = copy<int>(lkind);
    p->load.node = copy<int>(lnode);
    p->load.table = copy<int>(ltable);
    for (size_t r = 0; r < l; ++r) {
        p->load.sensor.push_back(lsensor(r) < 0 ? lnode(r) : lsensor(r));
        for (int k = 0; k < 4; ++k) p->load.c[k].push_back(lcoef(r, k));
    }
    p->load.control = copy<int>(lcontrol);
    p->control.kind = copy<int>(kkind);
    p->control.sensor = copy<int>(ksensor);
    for (size_t j = 0; j < controls; ++j)
        for (int k = 0; k < 3; ++k) p->control.c[k].push_back(kcoef(j, k));
    p->tables = read_tables(tables);
    p->inputs = read_inputs(inputs);
    if (follow) read_controls(*p, *follow);
    for (nb::handle h : edges) {
        const auto [input, time, interval, coef] = nb::cast<std::tuple<int, double, double, int>>(h);
        p->edges.push_back({input, time, interval, coef});
    }
    p->prepare();
    new (self) Problem(std::move(*p));
}

bool increase(const double* t, size_t m, double t0, double t_end) {
    int bad = 0;
    for (size_t i = 1; i < m; ++i) bad |= !(t[i] >= t[i - 1]);
    return m == 0 || (!bad && t[0] >= t0 && t[m - 1] <= t_end);
}

PyResult integrate(const Problem& p, Reals coef, Reals T0, double t0, double t_end, Reals times, Ints nodes, std::optional<Csr> dcoef,
                   std::optional<In<double, 2>> dT0, bool energy, std::optional<Ints> on, std::optional<Weights> sums, nb::kwargs options) {
    need(coef.size() == static_cast<size_t>(p.nc), "coef: wrong length");
    need(T0.size() == static_cast<size_t>(p.n), "T0: wrong length");
    need(std::isfinite(t0) && std::isfinite(t_end) && t_end >= t0, "t_end must not lie before t0");
    Options o = options_of(options);
    need(increase(times.data(), times.size(), t0, t_end), "output_times must increase and lie in [t0, t_end]");
    for (size_t i = 0; i < nodes.size(); ++i) need(nodes(i) >= 0 && nodes(i) < p.nodes(), "output_nodes: no such node");
    CoefJacobian d = jacobian_of(p, dcoef);
    if (dT0) {
        if (!dcoef) {
            d.np = static_cast<int>(dT0->shape(1));
            d.indptr.assign(p.nc + 1, 0);
        }
        need(dT0->shape(0) == static_cast<size_t>(p.n) && dT0->shape(1) == static_cast<size_t>(d.np), "dT0: must be (nodes, parameters)");
    }
    o.energy = energy;
    o.sums = sums_of(sums, p.nodes());
    o.on = thermostats_of(p, on);
    o.poll = poll_interrupt;
    const size_t nt = times.size(), no = nodes.size(), np = d.np;
    const auto [traces, to] = room(nb::make_tuple(nt, no));
    const auto [sens, slopes] = np ? room(nb::make_tuple(nt, no, np)) : std::pair<nb::object, double*>{nb::none(), nullptr};
    Result r;
    r.traces = to;
    r.sens = slopes;
    const At at(p, coef.data());
    Integrator run(at.problem, coef.data(), d, o);
    {
        nb::gil_scoped_release others;  // threads of the caller go on; what the run reads is its own, or fixed
        run.run(T0.data(), dT0 ? dT0->data() : nullptr, t0, t_end, times.data(), static_cast<long>(nt), nodes.data(), static_cast<int>(no), r);
    }
    PyResult out{r.status, r.node, r.time, r.filled, r.steps, r.rejected, r.newton, r.factorisations, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}};
    out.traces = traces;
    out.sensitivities = sens;
    out.final_temperatures = reals(r.final_t);
    out.final_sensitivities = np ? array<double>(r.final_s, {static_cast<size_t>(p.n), np}) : nb::none();
    out.on = ints(r.on);
    std::vector<double> et;
    std::vector<int> el, es, eb;
    for (const Event& e : r.events) {
        et.push_back(e.time);
        el.push_back(e.load);
        es.push_back(e.on);
        eb.push_back(e.before);
    }
    out.event_times = reals(et);
    out.event_controls = ints(el);
    out.event_states = ints(es);
    out.event_before = ints(eb);
    out.load_energy = reals(r.load_energy);
    out.boundary_energy = reals(r.boundary_energy);
    out.conductor_energy = reals(r.conductor_energy);
    out.turnings = turnings_of(r.turnings);
    return out;
}

void evaluate_at(Evaluation& e, double t) {
    for (size_t k = 0; k < e.p->inputs.size(); ++k) e.u[k] = e.p->inputs[k].at(t);
    e.set_inputs();
}

// Thermostats follow their hysteresis: first on at or below the lower threshold, later switched at either.
void follow(Evaluation& e, bool first) {
    const Controls& l = e.p->control;
    for (int r : e.p->thermostats) {
        const double t = e.t[l.sensor[r]];
        if (t <= e.ceff[l.c[0][r]]) e.on[r] = 1;
        else if (first || t >= e.ceff[l.c[1][r]]) e.on[r] = 0;
    }
}

nb::tuple rhs(const Problem& p, Reals coef, Reals T, double t, std::optional<Csr> dcoef, std::optional<Ints> on) {
    need(coef.size() == static_cast<size_t>(p.nc), "coef: wrong length");
    need(T.size() == static_cast<size_t>(p.n), "T: wrong length");
    const CoefJacobian d = jacobian_of(p, dcoef);
    Evaluation e(p, coef.data());
    evaluate_at(e, t);
    std::copy(T.data(), T.data() + p.n, e.t.begin());
    follow(e, true);
    if (on) {
        need(on->size() == static_cast<size_t>(p.switches()), "on: one entry for each control");
        for (int r = 0; r < p.switches(); ++r) if ((*on)(r) >= 0) e.on[r] = static_cast<uint8_t>((*on)(r));
    }
    e.rows();
    const size_t n = p.n;
    std::vector<double> j(n * n), fp(n * d.np);
    e.jacobian(j.data());
    e.f.resize(n);
    if (d.np) {
        Scatter s;
        s.con = p.con_entry;
        s.load = p.load_entry;
        s.build(p, d);
        e.add_parameters(s, fp.data(), 1.0);
    }
    for (const Sampler& x : p.samplers) {  // as if it sampled without end
        const Factor& own = p.factors[x.factor];
        const double by = e.bend[x.factor];
        e.f[x.node] = e.factor[x.factor] - e.t[x.node];
        j[x.node * n + x.node] = -1.0;
        for (int m = 0; m < 3; ++m)
            if (own.of.node[m] >= 0 && own.of.node[m] < p.n) j[x.node * n + own.of.node[m]] += by * e.ceff[own.of.c[m]];
        for (int q = 0; q < d.np; ++q) fp[static_cast<size_t>(x.node) * d.np + q] = 0.0;
        e.factor_slope(x.factor, [&](int c, double slope) {
            for (int k = d.np ? d.indptr[c] : 0; d.np && k < d.indptr[c + 1]; ++k) fp[static_cast<size_t>(x.node) * d.np + d.indices[k]] += slope * d.data[k];
        });
    }
    return nb::make_tuple(reals(e.f), array<double>(j, {n, n}), d.np ? array<double>(fp, {n, static_cast<size_t>(d.np)}) : nb::none());
}

nb::object rows_of(const Problem& p, Reals coef, In<double, 2> T, Reals t, bool loads, std::optional<In<int32_t, 2>> on) {
    need(coef.size() == static_cast<size_t>(p.nc), "coef: wrong length");
    need(T.shape(1) == static_cast<size_t>(p.nodes()) && T.shape(0) == t.size(), "T: must be (times, nodes and boundaries)");
    Evaluation e(p, coef.data());
    const size_t m = t.size(), k = loads ? p.load.size() : p.con.size();
    need(!on || (on->shape(0) == m && on->shape(1) == static_cast<size_t>(p.switches())), "on: must be (times, controls)");
    std::unique_ptr<double[]> out(new double[m * k + 1]);
    for (size_t i = 0; i < m; ++i) {
        evaluate_at(e, t(i));
        std::copy(T.data() + i * p.nodes(), T.data() + (i + 1) * p.nodes(), e.t.begin());
        follow(e, i == 0);
        if (on)
            for (int r = 0; r < p.switches(); ++r)
                if ((*on)(i, r) >= 0) e.on[r] = static_cast<uint8_t>((*on)(i, r));
        e.rows();
        for (size_t r = 0; r < k; ++r) out[i * k + (loads ? r : p.con.original[r])] = loads ? e.power[r] : e.q[r];
    }
    return array(std::move(out), {m, k});
}

nb::tuple tableau() {
    std::vector<double> a(&A[0][0], &A[0][0] + STAGES * STAGES), b(WEIGHT, WEIGHT + STAGES), e(EMBEDDED, EMBEDDED + STAGES), c(NODE, NODE + STAGES);
    return nb::make_tuple(array<double>(a, {STAGES, STAGES}), reals(b), reals(e), reals(c));
}

}  // namespace

NB_MODULE(_kernel, m) {
    m.doc() = "Integrator of lumped thermal networks with forward sensitivities, sampled inputs and thermostats.";
    nb::class_<PyResult>(m, "Result")
        .def_ro("status", &PyResult::status).def_ro("node", &PyResult::node).def_ro("time", &PyResult::time)
        .def_ro("filled", &PyResult::filled).def_ro("steps", &PyResult::steps).def_ro("rejected", &PyResult::rejected)
        .def_ro("newton_iterations", &PyResult::newton).def_ro("factorisations", &PyResult::factorisations)
        .def_ro("traces", &PyResult::traces).def_ro("sensitivities", &PyResult::sensitivities)
        .def_ro("final_temperatures", &PyResult::final_temperatures).def_ro("final_sensitivities", &PyResult::final_sensitivities)
        .def_ro("on", &PyResult::on).def_ro("event_times", &PyResult::event_times).def_ro("event_controls", &PyResult::event_controls)
        .def_ro("event_states", &PyResult::event_states).def_ro("event_before", &PyResult::event_before).def_ro("load_energy", &PyResult::load_energy)
        .def_ro("boundary_energy", &PyResult::boundary_energy).def_ro("conductor_energy", &PyResult::conductor_energy)
        .def_ro("turnings", &PyResult::turnings);
    nb::class_<Problem>(m, "Problem")
        .def("__init__", &make_problem, "capacity"_a, "coef_input"_a, "boundary_gain"_a, "boundary_offset"_a, "conductor_kind"_a,
             "conductor_a"_a, "conductor_b"_a, "conductor_coef"_a, "conductor_table"_a, "load_kind"_a, "load_node"_a, "load_coef"_a,
             "load_sensor"_a, "load_table"_a, "load_control"_a, "control_kind"_a, "control_sensor"_a, "control_coef"_a, "tables"_a, "inputs"_a, "follow"_a = nb::none(), "edges"_a = nb::list())
        .def("integrate", &integrate, "coef"_a, "T0"_a, "t0"_a, "t_end"_a, "output_times"_a, "output_nodes"_a, nb::kw_only(),
             "dcoef"_a = nb::none(), "dT0"_a = nb::none(), "energy"_a = true, "on"_a = nb::none(), "sums"_a = nb::none(), "options"_a)
        .def("rhs", &rhs, "coef"_a, "T"_a, "t"_a, "dcoef"_a = nb::none(), "on"_a = nb::none())
        .def("flows", [](const Problem& p, Reals c, In<double, 2> T, Reals t) { return rows_of(p, c, T, t, false, {}); }, "coef"_a, "T_all"_a, "t"_a)
        .def("load_powers", [](const Problem& p, Reals c, In<double, 2> T, Reals t, std::optional<In<int32_t, 2>> on) {
            return rows_of(p, c, T, t, true, on); }, "coef"_a, "T_all"_a, "t"_a, "on"_a = nb::none())
        .def_prop_ro("nodes", [](const Problem& p) { return p.n; }).def_prop_ro("boundaries", [](const Problem& p) { return p.nb; })
        .def_prop_ro("coefficients", [](const Problem& p) { return p.nc; })
        .def_prop_ro("products", [](const Problem& p) { return p.elimination.full ? std::pow(p.n, 3) / 3.0 : p.elimination.products(); });
    bind_ensemble(m);
    m.def("tableau", &tableau);
    bind_laws(m);
    bind_modal(m);
    bind_large(m);
    bind_leastsquares(m);
    const char* in[] = {"SAMPLED_LINEAR", "SAMPLED_HOLD", "SINE", "CONSTANT", "FOLLOWED"};
    for (int k = 0; k < INPUT_KINDS; ++k) m.attr(in[k]) = k;
    const char* st[] = {"OK", "MAX_STEPS", "STEP_UNDERFLOW", "NEWTON_FAILED", "NON_FINITE", "RUN_AWAY", "SINGULAR_NODE", "BAD_INPUT", "CHATTER", "TOO_HOT"};
    for (int k = 0; k <= TOO_HOT; ++k) m.attr(st[k]) = k;
}
