// See image.hpp. Numbers are little-endian; every list stands behind its length. The writer is interop/fmu/image.py.
#include "fmu/image.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>

namespace thermid {

namespace {

void need(bool ok) {
    if (!ok) throw std::invalid_argument("resources/model.bin is damaged, or of another version of thermid");
}

class Reader {
  public:
    explicit Reader(std::vector<char> bytes) : bytes_(std::move(bytes)) {}
    bool done() const { return at_ == bytes_.size(); }
    std::vector<int> ints() {
        const size_t n = count(sizeof(int32_t));
        std::vector<int> out(n);
        for (int& x : out) {
            int32_t v;
            take(&v, sizeof v);
            x = v;
        }
        return out;
    }
    std::vector<double> reals() {
        std::vector<double> out(count(sizeof(double)));
        if (!out.empty()) take(out.data(), out.size() * sizeof(double));
        return out;
    }
    std::string text() {
        std::string out(count(1), ' ');
        if (!out.empty()) take(&out[0], out.size());
        return out;
    }
    size_t count(size_t each) {
        uint64_t n;
        take(&n, sizeof n);
        need(n <= (bytes_.size() - at_) / each);
        return static_cast<size_t>(n);
    }

  private:
    std::vector<char> bytes_;
    size_t at_ = 0;
    void take(void* to, size_t size) {
        need(size <= bytes_.size() - at_);
        std::memcpy(to, bytes_.data() + at_, size);
        at_ += size;
    }
};

Probe probe_of(const int* x) { return {x[0], {x[1], x[2], x[3]}, {x[4], x[5], x[6]}}; }

void columns(const std::vector<int>& flat, int width, std::initializer_list<std::vector<int>*> to, size_t rows) {
    need(flat.size() == rows * width);
    int k = 0;
    for (auto* column : to) {
        for (size_t r = 0; r < rows; ++r) column->push_back(flat[r * width + k]);
        ++k;
    }
}

void read_rows(Reader& in, Problem& p) {
    p.capacity = in.ints();
    p.coef_input = in.ints();
    p.gain = in.ints();
    p.offset = in.ints();
    need(p.gain.size() == p.offset.size());
    p.n = static_cast<int>(p.capacity.size());
    p.nb = static_cast<int>(p.gain.size());
    p.nc = static_cast<int>(p.coef_input.size());
    std::vector<int> unused;
    Conductors& c = p.con;
    c.kind = in.ints();
    c.a = in.ints();
    c.b = in.ints();
    columns(in.ints(), 4, {&c.c0, &c.c1}, c.kind.size());
    c.table = in.ints();
    need(c.a.size() == c.kind.size() && c.b.size() == c.kind.size() && c.table.size() == c.kind.size());
    Loads& l = p.load;
    l.kind = in.ints();
    l.node = in.ints();
    columns(in.ints(), 4, {&l.c[0], &l.c[1], &l.c[2], &l.c[3]}, l.kind.size());
    l.sensor = in.ints();
    l.table = in.ints();
    l.control = in.ints();
    need(l.node.size() == l.kind.size() && l.sensor.size() == l.kind.size() && l.table.size() == l.kind.size() && l.control.size() == l.kind.size());
    Controls& k = p.control;
    k.kind = in.ints();
    k.sensor = in.ints();
    columns(in.ints(), 3, {&k.c[0], &k.c[1], &k.c[2]}, k.kind.size());
    need(k.sensor.size() == k.kind.size());
}

void read_courses(Reader& in, Problem& p) {
    for (size_t k = in.count(1); k > 0; --k) {
        std::vector<double> x = in.reals(), y = in.reals(), d = in.reals();
        p.tables.push_back({std::move(x), std::move(y), std::move(d)});
    }
    for (const int kind : in.ints()) {
        const std::vector<double> a = in.reals(), b = in.reals();
        Input x;
        x.kind = kind;
        need(kind >= 0 && kind < FOLLOWED);
        if (x.sampled()) {
            need(!a.empty() && a.size() == b.size());
            for (size_t i = 0; i < a.size(); ++i) need(std::isfinite(a[i]) && std::isfinite(b[i]) && (i == 0 || a[i] > a[i - 1]));
            x.set_samples(a.data(), b.data(), static_cast<int>(a.size()));
        } else {
            need(a.size() == (kind == SINE ? 4u : 1u));
            x.mean = a[0];
            if (kind == SINE) {
                x.amplitude = a[1];
                x.period = a[2];
                x.phase = a[3];
                need(x.period > 0.0);
            }
        }
        p.inputs.push_back(std::move(x));
    }
}

void read_controls(Reader& in, Problem& p) {
    const std::vector<int> states = in.ints();
    need(states.size() == 1 && states[0] >= 0 && states[0] <= p.n);
    p.states = states[0];
    p.machines = in.ints();
    for (size_t k = in.count(1); k > 0; --k) {
        const std::vector<int> x = in.ints();
        need(x.size() >= 12);
        p.factors.push_back({x[0], probe_of(&x[1]), x[8], x[9], x[10], x[11], {x.begin() + 12, x.end()}});
    }
    for (size_t k = in.count(1); k > 0; --k) {
        const std::vector<int> x = in.ints();
        const std::vector<double> sign = in.reals();
        need(x.size() == 12 && sign.size() == 1);
        p.guards.push_back({x[0], x[1], x[2], probe_of(&x[3]), x[10], sign[0], x[11]});
    }
    for (size_t k = in.count(1); k > 0; --k) {
        const std::vector<double> period = in.reals();
        const std::vector<int> x = in.ints();
        need(period.size() == 1 && x.size() == 2);
        p.samplers.push_back({period[0], x[0], x[1]});
    }
    for (size_t k = in.count(1); k > 0; --k) {
        const std::vector<int> x = in.ints();
        need(!x.empty());
        Drive f;
        f.base = x[0];
        f.factors.assign(x.begin() + 1, x.end());
        f.input = static_cast<int>(p.inputs.size());
        Input follows;
        follows.kind = FOLLOWED;
        follows.mean = 1.0;
        p.inputs.push_back(follows);
        p.followers.push_back(f);
    }
}

void read_variables(Reader& in, Image& m) {
    const std::vector<int> flat = in.ints();
    need(flat.size() % 2 == 0);
    m.power_begin = in.ints();
    m.power_row = in.ints();
    need(!m.power_begin.empty() && m.power_begin.front() == 0 && m.power_begin.back() == static_cast<int>(m.power_row.size()));
    for (size_t k = 1; k < m.power_begin.size(); ++k) need(m.power_begin[k - 1] <= m.power_begin[k]);
    for (int r : m.power_row) need(r >= 0 && r < m.problem.load.size());
    int watched = 0;
    for (const Guard& g : m.problem.guards) watched += g.delay < 0;
    const int places[VARIABLE_KINDS] = {1, static_cast<int>(m.start.size()), m.problem.nodes(), m.problem.n, m.problem.nb,
                                        static_cast<int>(m.power_begin.size()) - 1, m.problem.switches(), watched};
    for (size_t k = 0; k < flat.size(); k += 2) {
        need(flat[k] >= 0 && flat[k] < VARIABLE_KINDS && flat[k + 1] >= 0 && flat[k + 1] < places[flat[k]]);
        need(flat[k] != RATE || m.problem.capacity[flat[k + 1]] >= 0);
        m.variables.push_back({flat[k], flat[k + 1]});
    }
}

}  // namespace

std::shared_ptr<const Image> read_image(const std::string& path) {
    std::ifstream file(path, std::ios::binary);
    if (!file) throw std::invalid_argument("there is no model at " + path);
    std::vector<char> bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
    static const char MARK[] = {'T', 'H', 'E', 'R', 'M', 'I', 'D', '1'};
    need(bytes.size() > sizeof MARK && std::equal(MARK, MARK + sizeof MARK, bytes.begin()));
    Reader in({bytes.begin() + sizeof MARK, bytes.end()});
    auto out = std::make_shared<Image>();
    Image& m = *out;
    m.token = in.text();
    for (size_t k = in.count(1); k > 0; --k) m.nodes.push_back(in.text());
    read_rows(in, m.problem);
    read_courses(in, m.problem);
    read_controls(in, m.problem);
    m.problem.prepare();
    need(m.problem.n <= Problem::LARGEST && static_cast<int>(m.nodes.size()) == m.problem.nodes());
    const std::vector<int> steps = in.ints();
    need(steps.size() % 3 == 0);
    for (size_t k = 0; k < steps.size(); k += 3) m.program.steps.push_back({steps[k], steps[k + 1], steps[k + 2]});
    m.program.numbers = in.reals();
    m.program.coefficient = in.ints();
    need(static_cast<int>(m.program.coefficient.size()) == m.problem.nc);
    m.start = in.reals();
    m.program.check(m.start.size());
    m.initial = in.reals();
    need(static_cast<int>(m.initial.size()) == m.problem.n);
    read_variables(in, m);
    need(in.done());
    return out;
}

}  // namespace thermid
