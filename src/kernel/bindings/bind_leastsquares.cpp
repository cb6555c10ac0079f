// Bindings of the least squares: readings once, then one evaluation after the other.
#include "bindings/bind.hpp"

using namespace thermid;
using namespace nb::literals;

namespace {

struct PySquares {
    int status, node;
    double time, cost, chi_square;
    long steps, rejected;
    nb::object triangle, rotated, sums, mesh;
};

void make_readings(Readings* self, const Problem& p, Reals times, Ints nodes, Ints node_begin, Ints index, Ints index_begin, Reals values,
                   std::optional<Ints> scaled) {
    Readings made;
    need(node_begin.size() > 0 && node_begin.size() == index_begin.size(), "readings: one range of nodes and of samples for each channel");
    const int channels = made.channels = static_cast<int>(node_begin.size()) - 1;
    need(node_begin(0) == 0 && node_begin(channels) == static_cast<int>(nodes.size()), "readings: ranges of nodes do not fit");
    need(index_begin(0) == 0 && index_begin(channels) == static_cast<int>(index.size()) && index.size() == values.size(),
         "readings: ranges of samples do not fit");
    need(!scaled || scaled->size() == static_cast<size_t>(channels), "readings: scaled must say one thing for each channel");
    made.times = copy<double>(times);
    made.terms = static_cast<int>(nodes.size());
    for (size_t k = 1; k < times.size(); ++k) need(times(k) >= times(k - 1), "readings: times must increase");
    for (size_t k = 0; k < nodes.size(); ++k) need(nodes(k) >= 0 && nodes(k) < p.nodes(), "readings: no such node");
    for (int c = 0; c < channels; ++c) {
        need(node_begin(c) < node_begin(c + 1) && index_begin(c) <= index_begin(c + 1), "readings: ranges must increase");
        const int *from = index.data() + index_begin(c), *to = index.data() + index_begin(c + 1);
        for (const int* k = from; k < to; ++k)
            need(*k >= 0 && *k < static_cast<int>(times.size()) && (k == from || *k > k[-1]), "readings: samples must increase and be of the times");
        const int node = nodes(node_begin(c));
        // a channel whose scale is looked for counts its node by a weight of its own
        const bool alone = !(scaled && (*scaled)(c) != 0) && node_begin(c + 1) == node_begin(c) + 1 && node < p.n && p.capacity[node] >= 0;
        auto same = [&](const ReadingGroup& g) { return g.alone == alone && g.index.size() == static_cast<size_t>(to - from) && std::equal(from, to, g.index.begin()); };
        auto g = std::find_if(made.groups.begin(), made.groups.end(), same);
        if (g == made.groups.end()) {
            g = made.groups.insert(g, ReadingGroup());
            g->alone = alone;
            g->index.assign(from, to);
            g->begin.push_back(0);
        }
        g->channels.push_back(c);
        for (int k = node_begin(c); k < node_begin(c + 1); ++k) {
            size_t at = std::find(g->nodes.begin(), g->nodes.end(), nodes(k)) - g->nodes.begin();
            if (alone || at == g->nodes.size()) {
                at = g->nodes.size();
                g->nodes.push_back(nodes(k));
            }
            g->at.push_back(static_cast<int>(at));
            g->term.push_back(k);
        }
        g->begin.push_back(static_cast<int>(g->at.size()));
    }
    for (ReadingGroup& g : made.groups) {
        const size_t n = g.index.size(), m = g.channels.size();
        g.values.resize(n * m);
        for (size_t first = 0; first < n; first += 256)  // by stretches that stay in the cache
            for (size_t c = 0; c < m; ++c) {
                const double* from = values.data() + index_begin(g.channels[c]);
                for (size_t i = first; i < std::min(n, first + 256); ++i) g.values[i * m + c] = from[i];
            }
    }
    new (self) Readings(std::move(made));
}

PySquares least_squares(const Problem& p, const Readings& readings, Reals coef, Reals T0, double t0, double t_end, Reals sigma, Reals bias,
                        Ints bias_column, Reals weight, In<double, 2> slope, int loss, double knee, std::optional<Csr> dcoef,
                        std::optional<In<double, 2>> dT0, std::optional<Reals> mesh, std::optional<Ints> on, nb::kwargs options) {
    const size_t channels = readings.channels;
    need(coef.size() == static_cast<size_t>(p.nc) && T0.size() == static_cast<size_t>(p.n), "coef or T0: wrong length");
    need(std::isfinite(t0) && std::isfinite(t_end) && t_end >= t0, "t_end must not lie before t0");
    need(readings.times.empty() || (readings.times.front() >= t0 && readings.times.back() <= t_end), "readings must lie in [t0, t_end]");
    need(knee > 0.0, "knee must be positive");
    Options o = options_of(options);
    need(loss >= SQUARE && loss <= CAUCHY, "loss: no such kind");
    need(sigma.size() == channels && bias.size() == channels && bias_column.size() == channels, "sigma, bias, bias_column: one for each channel");
    CoefJacobian d = jacobian_of(p, dcoef);
    if (dT0) need(dcoef && dT0->shape(0) == static_cast<size_t>(p.n) && dT0->shape(1) == static_cast<size_t>(d.np), "dT0: must be (nodes, parameters)");
    need(weight.size() == static_cast<size_t>(readings.terms), "weight: one for each node of a channel");
    need(slope.shape(0) == weight.size() && slope.shape(1) == static_cast<size_t>(d.np), "slope: must be (weights, parameters)");
    for (size_t c = 0; c < channels; ++c) need(sigma(c) > 0.0 && bias_column(c) >= -1 && bias_column(c) < static_cast<int>(channels), "sigma must be positive, bias_column small");
    Weighing w{sigma.data(), bias.data(), bias_column.data(), 0, weight.data(), slope.data(), loss, knee};
    for (size_t c = 0; c < channels; ++c) w.biases = std::max(w.biases, bias_column(c) + 1);
    o.energy = false;
    o.poll = poll_interrupt;
    if (mesh) o.mesh = copy<double>(*mesh);
    o.on = thermostats_of(p, on);
    LeastSquares squares(readings, w, d.np);
    Result r;
    const At at(p, coef.data());
    Integrator run(at.problem, coef.data(), d, o, &squares);
    run.run(T0.data(), dT0 ? dT0->data() : nullptr, t0, t_end, readings.times.data(), static_cast<long>(readings.times.size()), nullptr, 0, r);
    squares.finish();
    const size_t n = squares.columns();
    std::vector<double> triangle(n * n), rotated(n);
    for (size_t k = 0; k < n; ++k) {
        std::copy(squares.triangle().row(static_cast<int>(k)), squares.triangle().row(static_cast<int>(k)) + n, triangle.begin() + k * n);
        rotated[k] = squares.triangle().row(static_cast<int>(k))[n];
    }
    return {r.status, r.node, r.time, squares.cost, squares.chi_square, r.steps, r.rejected, array<double>(triangle, {n, n}), reals(rotated),
            array<double>(squares.sums, {channels, 7}), reals(r.mesh)};
}

}  // namespace

void thermid::bind_leastsquares(nb::module_& m) {
    nb::class_<Readings>(m, "Readings")
        .def("__init__", &make_readings, "problem"_a, "times"_a, "nodes"_a, "node_begin"_a, "index"_a, "index_begin"_a, "values"_a,
             "scaled"_a = nb::none());
    nb::class_<PySquares>(m, "Squares")
        .def_ro("status", &PySquares::status).def_ro("node", &PySquares::node).def_ro("time", &PySquares::time)
        .def_ro("steps", &PySquares::steps).def_ro("rejected", &PySquares::rejected)
        .def_ro("cost", &PySquares::cost).def_ro("chi_square", &PySquares::chi_square)
        .def_ro("triangle", &PySquares::triangle).def_ro("rotated", &PySquares::rotated).def_ro("sums", &PySquares::sums)
        .def_ro("mesh", &PySquares::mesh);
    m.def("least_squares", &least_squares, "problem"_a, "readings"_a, "coef"_a, "T0"_a, "t0"_a, "t_end"_a, nb::kw_only(), "sigma"_a, "bias"_a,
          "bias_column"_a, "weight"_a, "slope"_a, "loss"_a = 0, "knee"_a = 1.0, "dcoef"_a = nb::none(), "dT0"_a = nb::none(),
          "mesh"_a = nb::none(), "on"_a = nb::none(), "options"_a);
    const char* names[] = {"SQUARE", "SOFT_L1", "HUBER", "CAUCHY"};
    for (int k = 0; k <= CAUCHY; ++k) m.attr(names[k]) = k;
}
