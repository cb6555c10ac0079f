// The modal solution for Python.
#include "bindings/bind.hpp"
#include "modal/modal.hpp"

namespace thermid {

using namespace nb::literals;

namespace {

nb::tuple modal(const Problem& p, Reals coef, Reals T0, double t0, double t_end, Reals times, Ints nodes, bool turnings, std::optional<Weights> sums) {
    need(coef.size() == static_cast<size_t>(p.nc), "coef: wrong length");
    need(T0.size() == static_cast<size_t>(p.n), "T0: wrong length");
    need(std::isfinite(t0) && std::isfinite(t_end) && t_end >= t0, "t_end must not lie before t0");
    for (size_t i = 0; i < times.size(); ++i)
        need(times(i) >= (i ? times(i - 1) : t0) && times(i) <= t_end, "output_times must increase and lie in [t0, t_end]");
    for (size_t i = 0; i < nodes.size(); ++i) need(nodes(i) >= 0 && nodes(i) < p.nodes(), "output_nodes: no such node");
    const size_t nt = times.size(), no = nodes.size();
    std::unique_ptr<double[]> traces(new double[nt * no + 1]);
    const Sums extra = sums_of(sums, p.nodes());
    Result r;
    r.traces = traces.get();
    Modal(p, coef.data()).run(T0.data(), t0, t_end, times.data(), static_cast<long>(nt), nodes.data(), static_cast<int>(no), poll_interrupt, r,
                          turnings ? &extra : nullptr);
    return nb::make_tuple(r.status, r.node, r.time, r.steps, array(std::move(traces), {nt, no}), reals(r.final_t), reals(r.load_energy),
                          reals(r.boundary_energy), turnings_of(r.turnings));
}

}  // namespace

void bind_modal(nb::module_& m) {
    m.def("modal", &modal, "problem"_a, "coef"_a, "T0"_a, "t0"_a, "t_end"_a, "output_times"_a, "output_nodes"_a,
          "turnings"_a = false, "sums"_a = nb::none());
}

}  // namespace thermid
