// What follows temperatures, from Python: probes, factors, machines with their guards, samplers and the inputs made of them.
#include "bindings/bind.hpp"

namespace thermid {

namespace {
// Place of the constant, then of each node the node and the place of what it is multiplied by.
Probe probe_of(const std::vector<int>& x) {
    need(x.size() == 7, "controls: a probe has seven numbers");
    return {x[0], {x[1], x[2], x[3]}, {x[4], x[5], x[6]}};
}
}  // namespace

void read_controls(Problem& p, const nb::dict& given) {
    p.states = nb::cast<int>(given["states"]);
    need(p.states >= 0 && p.states < p.n, "controls: more states than nodes");
    p.machines = nb::cast<std::vector<int>>(given["machines"]);
    for (nb::handle h : nb::cast<nb::list>(given["factors"])) {
        const auto [kind, of, low, high, table, machine, values] = nb::cast<std::tuple<int, std::vector<int>, int, int, int, int, std::vector<int>>>(h);
        p.factors.push_back({kind, probe_of(of), low, high, table, machine, values});
    }
    for (nb::handle h : nb::cast<nb::list>(given["guards"])) {
        const auto [machine, from, to, of, level, sign, delay] = nb::cast<std::tuple<int, int, int, std::vector<int>, int, double, int>>(h);
        p.guards.push_back({machine, from, to, probe_of(of), level, sign, delay});
    }
    for (nb::handle h : nb::cast<nb::list>(given["samplers"])) {
        const auto [period, node, factor] = nb::cast<std::tuple<double, int, int>>(h);
        p.samplers.push_back({period, node, factor});
    }
    for (nb::handle h : nb::cast<nb::list>(given["followers"])) {
        auto [base, factors] = nb::cast<std::tuple<int, std::vector<int>>>(h);
        Drive f;
        f.base = base;
        f.factors = factors;
        f.input = static_cast<int>(p.inputs.size());
        Input in;
        in.kind = FOLLOWED;
        in.mean = 1.0;
        p.inputs.push_back(in);
        p.followers.push_back(f);
    }
}

}  // namespace thermid
