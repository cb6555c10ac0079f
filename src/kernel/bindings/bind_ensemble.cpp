// Python binding of ensembles.
#include "bindings/bind.hpp"
#include "ensemble/ensemble.hpp"

namespace thermid {

using namespace nb::literals;

namespace {

void make_ensemble(Ensemble* self, const Problem& p, In<double, 2> coef, In<double, 2> T0, double t0, double t_end, Reals times, Ints nodes,
                   const std::string& simd, nb::kwargs options) {
    const size_t members = coef.shape(1);
    need(members > 0, "coef: an ensemble needs at least one member");
    need(coef.shape(0) == static_cast<size_t>(p.nc), "coef: must be (coefficients, members)");
    need(T0.shape(0) == static_cast<size_t>(p.n) && T0.shape(1) == members, "T0: must be (nodes, members)");
    need(std::isfinite(t0) && std::isfinite(t_end) && t_end >= t0, "t_end must not lie before t0");
    const Options o = options_of(options);
    need(times.size() > 0, "output_times must not be empty");
    for (size_t i = 0; i < times.size(); ++i)
        need(times(i) >= (i ? times(i - 1) : t0) && times(i) <= t_end, "output_times must increase and lie in [t0, t_end]");
    for (size_t i = 0; i < nodes.size(); ++i) need(nodes(i) >= 0 && nodes(i) < p.n, "output_nodes: no such node");
    new (self) Ensemble(p, simd, o, copy<double>(coef), copy<double>(T0), static_cast<long>(members), t0, t_end, copy<double>(times), copy<int>(nodes));
}

nb::object advance(Ensemble& e, long rows, int threads) {
    need(rows > 0 && threads > 0, "rows and threads must be positive");
    const size_t m = std::min<long>(rows, static_cast<long>(e.setup.times.size()) - e.done), nodes = e.setup.observed.size(), groups = (e.setup.members + LANES - 1) / LANES;
    std::unique_ptr<double[]> out(new double[groups * m * nodes * LANES + 1]);
    {
        nb::gil_scoped_release free;
        e.advance(rows, threads, out.get(), [] {
            nb::gil_scoped_acquire held;
            poll_interrupt();
        });
    }
    return array(std::move(out), {groups, m, nodes, LANES});
}

// Members, columns, times and temperatures of turning points.
nb::tuple turnings(const Ensemble& e) {
    std::vector<int> member;
    std::vector<Turnings::Point> points;
    for (const Ensemble::Turning& x : e.turnings()) {
        member.push_back(static_cast<int>(x.member));
        points.push_back(x.point);
    }
    const nb::tuple rest = turnings_of(points);
    return nb::make_tuple(ints(member), rest[0], rest[1], rest[2]);
}

// Times, switches and new states of a member's switchings, and the states of all switches at its end.
nb::tuple switchings(const Ensemble& e, long member) {
    std::vector<double> times;
    std::vector<int> which, states;
    for (const Event& x : e.events.at(member)) {
        times.push_back(x.time);
        which.push_back(x.load);
        states.push_back(x.on);
    }
    return nb::make_tuple(reals(times), ints(which), ints(states), ints(e.on.at(member)));
}

}  // namespace

void bind_ensemble(nb::module_& m) {
    nb::class_<Ensemble>(m, "Ensemble")
        .def("__init__", &make_ensemble, "problem"_a, "coef"_a, "T0"_a, "t0"_a, "t_end"_a, "output_times"_a, "output_nodes"_a, nb::kw_only(),
             "simd"_a = "auto", "options"_a, nb::keep_alive<1, 2>())
        .def("advance", &advance, "rows"_a, "threads"_a = 1)
        .def_prop_ro("status", [](const Ensemble& e) { return ints(e.status); }).def_prop_ro("node", [](const Ensemble& e) { return ints(e.node); })
        .def_prop_ro("time", [](const Ensemble& e) { return reals(e.time); })
        .def_prop_ro("alone", [](const Ensemble& e) { return ints(std::vector<int>(e.alone.begin(), e.alone.end())); })
        .def("ended", [](const Ensemble& e, long member) { return reals(e.ended.at(member)); }, "member"_a)
        .def("switchings", &switchings, "member"_a)
        .def_prop_ro("turnings", &turnings)
        .def_ro("steps", &Ensemble::steps).def_ro("rejected", &Ensemble::rejected)
        .def_prop_ro("simd", [](const Ensemble& e) { return std::string(e.setup.code.name); });
    m.def("instruction_sets", [] { nb::list out; for (const std::string& s : instruction_sets()) out.append(s); return out; });
}

}  // namespace thermid
