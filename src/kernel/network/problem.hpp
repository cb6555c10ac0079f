// The network as flat arrays, and the evaluation of its right-hand side and derivatives.
#pragma once
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "network/inputs.hpp"
#include "network/laws.hpp"
#include "algebra/sparse.hpp"

namespace thermid {

// One way in which a coefficient enters a row. what: 0..3 the law's own coefficient, 4 through the temperature of
// end a (for a load: of its law), 5 through that of end b (for a load: of its control's sensor), 6..8 a control's coefficient.
struct Entry { int row, what, coef; };

struct Conductors {
    std::vector<int> kind, a, b, c0, c1, table, original;
    std::vector<int> place;  // of the first table of each among all that conductors look up, and behind it their number
    int size() const { return static_cast<int>(kind.size()); }
};

// The law of a load and its control, -1 for none; the law follows the temperature of `sensor`.
struct Loads {
    std::vector<int> kind, node, c[4], sensor, table, control;
    std::vector<int> felt;  // nodes that they follow: of every law, then of every control
    int size() const { return static_cast<int>(kind.size()); }
};

// Thermostats and proportional controllers; several loads may have one. node: of the first of these, for messages.
struct Controls {
    std::vector<int> kind, sensor, c[3], node;
    int size() const { return static_cast<int>(kind.size()); }
};

// What a control reads: c0 + sum c_k T_k over up to three nodes (-1: none), all of them coefficients.
struct Probe { int c0, node[3], c[3]; };

// What a control gives: its probe between two limits, a table of it, or the value that belongs to the state of a machine.
enum FactorKind { CLAMP = 0, LOOKUP, OF_STATE, FACTOR_KINDS };
struct Factor {
    int kind;
    Probe of;
    int low, high, table, machine;
    std::vector<int> values;  // coefficients, one for each state
};

// A way from one state of a machine to another: where its probe passes a level upwards (sign 1) or downwards (-1), or so long after the state
// began. Thermostats are machines of two states.
struct Guard {
    int machine, from, to;
    Probe of;
    int level;
    double sign;
    int delay;  // coefficient; -1 where the probe decides
};

// An input that follows temperatures: a product of factors, and of another input (-1: none).
struct Drive {
    int base = -1;
    std::vector<int> factors;
    int input = -1;
    std::vector<int> coefs;          // coefficients that follow it
    std::vector<Entry> con, load;    // where these enter
    std::vector<int> nodes, place;   // unknown nodes that it moves, and of every node the place among them, -1
    std::vector<int> entry;          // (nodes, factors, 3): places in the Jacobian's pattern, -1
};

// A node of control that takes a factor's value at every multiple of a period, and keeps it between.
struct Sampler { double period; int node, factor; };

// An input that moves a boundary: fu[place] += factor * (qa, qb)[at].
struct Push { int place, at; double factor; };

// A jump of a held input whose instant is looked for: it lies the coefficient times `interval` after `time`, where the input's table has it.
struct Edge { int input; double time, interval; int coef; };

struct Problem {
    int n = 0, nb = 0, nc = 0;  // unknowns, boundaries, coefficients
    int states = 0;             // the last so many unknowns are states of controls: no temperatures
    std::vector<int> capacity, coef_input, gain, offset;
    Conductors con;  // sorted by kind
    Loads load;
    Controls control;
    std::vector<Table> tables;
    std::vector<Input> inputs;
    std::vector<Edge> edges;
    // The problem with its edges where coefficients put them, none of them before the one that it follows.
    Problem at_edges(const double* coef) const;

    // Derived: where coefficients enter, which coefficients follow an input, nodes without capacity and their rows.
    std::vector<Entry> con_entry, load_entry;
    std::vector<int> timed, massless, thermostats;  // thermostats: which controls are
    std::vector<Factor> factors;
    std::vector<Drive> followers;
    std::vector<int> machines;       // the state in which each begins; they stand behind the controls in Evaluation::on
    std::vector<Guard> guards;       // of thermostats, then of machines
    std::vector<Sampler> samplers;
    bool is_state(int i) const { return i >= n - states && i < n; }
    int switches() const { return control.size() + static_cast<int>(machines.size()); }
    int switch_node(int l) const { return l < control.size() ? control.node[l] : -1; }
    std::vector<int> bent_conductors, bent_loads;  // tables with knees, and proportional heaters
    bool knees() const { return !bent_conductors.empty() || !bent_loads.empty() || !bent_factors.empty(); }
    std::vector<int> bent_factors;
    std::vector<int> moving, moved;              // inputs that are not constant, and the coefficients that follow these
    int kind_begin[CONDUCTOR_KINDS + 1] = {};  // conductors of a kind stand together
    // Conductors that bring heat to a node (r), or take it away (their number + r: the place of -q in Evaluation::q).
    std::vector<int> meet_begin, meet_row;
    // The Jacobian's pattern; each entry is a signed sum of row slopes (those of qa, then those of qb), and loads add their own.
    Pattern pattern;
    Elimination elimination;
    std::vector<int> slope_begin, slope_at, load_place;
    std::vector<double> slope_sign;
    // The same as places among qa, qb, -qa, -qb and a zero: the first of each entry, then for further ones the entry and the place.
    std::vector<int> slope_first, slope_further;

    // Values of the pattern from the slopes of the rows (qa, qb, room for as many again, 0).
    void sum_slopes(double* qab, const double* loads, double* v) const;

    void pushes_of(const Entry& e, const double* coef, std::vector<Push>& out) const;  // what becomes of an entry of a boundary

    int nodes() const { return n + nb; }
    std::vector<std::pair<int, int>> holds() const;  // massless node, node that holds its heat
    // Whether a load's control takes the law's first coefficient for its full power.
    bool limited(int r) const { return load.control[r] >= 0 && control.kind[load.control[r]] == PROPORTIONAL && control.c[2][load.control[r]] == load.c[0][r]; }
    static constexpr int LARGEST = 5000;  // unknowns that the small integrator and a dense Jacobian are meant for
    void prepare();  // checks everything, sorts and derives; throws std::invalid_argument

  private:
    void find_pattern();
    void prepare_controls();
};

// Parameter derivatives of the coefficients, CSR (coefficients, parameters); empty when np == 0.
struct CoefJacobian {
    int np = 0;
    std::vector<int> indptr, indices;
    std::vector<double> data;
    bool any(int j) const { return np > 0 && indptr[j + 1] > indptr[j]; }
};

// Entries of parameters, and where each of them adds to df/dp (n, np).
struct Scatter {
    std::vector<Entry> con, load;
    void build(const Problem& p, const CoefJacobian& d);
    // y[place] += factor * scale * the heat per coefficient, phi, of constant coefficients of conductors: most entries are such
    void add_plain(const double* phi, double scale, double* y) const {
        for (const Part& x : plain_) y[x.place] += x.factor * (scale * phi[x.from]);
    }
    // y[place] += factor * the value of its entry: the other conductors', then loads'
    void add(double* y) const {
        for (const Part& x : parts_) y[x.place] += x.factor * value[x.from];
    }
    const CoefJacobian* derivatives = nullptr;
    std::vector<Entry> other;   // conductors' entries that are not plain
    std::vector<double> value;  // of each of these, and of each load's
    bool exponents = false;     // some are

  private:
    struct Part { int place, from; double factor; };
    std::vector<Part> plain_, parts_;
};

// State of one evaluation: effective coefficients, temperatures of all nodes, and what the rows say about them.
struct Evaluation {
    const Problem* p;
    const double* coef;                 // as passed
    std::vector<double> u, ceff;        // inputs; effective coefficients, then a zero and an infinity for unused slots
    std::vector<double> t;              // (nodes)
    std::vector<double> q, phi, qab;    // conductors; q, then -q; qa, qb, room for their negatives, 0
    double *qa, *qb;                    // the first two quarters of qab
    std::vector<double> power, slope;   // loads; their slopes in the temperature of the law, then of the control
    std::vector<uint8_t> on;            // states of thermostats (controls), then of machines
    std::vector<double> factor, bend;   // value of each factor, and its slope in what its probe reads
    std::vector<std::vector<double>> pull;  // of each follower: heat into its nodes per unit of it
    std::vector<double> f;              // heat into each unknown node
    std::vector<int> piece;             // of each table that conductors look up, where they stand
    bool quarter = false;               // the exponent of every power law is 1/4, always

    Evaluation(const Problem& problem, const double* coefficients);
    Evaluation(const Evaluation&) = delete;
    void renew();            // coefficients have changed where they were passed
    void set_inputs();       // u -> ceff, boundary temperatures
    void move_inputs();      // the same after a change of moving inputs alone
    void rows();             // t -> rows and f
    double probe(const Probe& x) const;
    void follow();           // t -> factors, the inputs that follow them, their coefficients and boundaries
    double others(const Drive& f, size_t k) const;  // what its k-th factor is multiplied by
    void find_pull();        // from rows
    template <class F> void factor_slope(int k, F add) const;  // add(coefficient, slope of factor k in it as it was passed)
    template <class F> void each_pull(F add) const;  // add(follower, its factor's number, slope in the probe, probe)
    void follow_slopes(double* v) const;             // adds to values of the pattern what followers make of temperatures
    void follow_parameters(const CoefJacobian& d, double* fp, double scale) const;
    void follow_inputs(double* fu) const;            // hands what follows on to the inputs behind it
    void follow_rows(double w, const double* dir, double* conductors, double* loads) const;
    template <class X, class Temperature, class Coefficient>
    Controlled<X> load(int r, Temperature t, Coefficient c) const;  // t(node), c(place)
    Controlled<double> load(int r) const;
    double put_load(int r);  // power and slopes of one load into their places; returns the power
    // Adds w times the heats of conductors and loads after temperatures of all nodes have fallen by delta, to first order.
    void shift(double w, const double* delta, double* conductors, double* loads) const;
    // Adds w times what heats gain, to first order, when all temperatures rise by dir.
    void lean(double w, const double* dir, double* conductors, double* loads) const;
    void jacobian(double* j) const;  // d f / d t, (n, n)
    void slopes(double* v);          // the same as values of the pattern
    // Derivative of row quantity in the coefficient of an entry.
    double con_slope(const Entry& e) const;
    double load_slope(const Entry& e) const;
    // fp[i*np + p] += scale * df_i/dp by coefficients, boundaries and inputs held.
    void add_parameters(Scatter& s, double* fp, double scale) const;
    // fu[k*n + i] = df_i/du_k, by boundaries that move and by other entries
    void input_slopes(const std::vector<Push>& pushes, const std::vector<Entry>& con, const std::vector<Entry>& load, double* fu) const;
};

template <class X, class Temperature, class Coefficient>
inline Controlled<X> Evaluation::load(int r, Temperature at, Coefficient value) const {
    const Loads& l = p->load;
    const Controls& k = p->control;
    const int j = l.control[r];
    X c[4], d[3];
    for (int i = 0; i < 4; ++i) c[i] = value(l.c[i][r]);
    for (int i = 0; i < 3 && j >= 0; ++i) d[i] = value(k.c[i][j]);
    return thermid::load<X>(l.kind[r], j < 0 ? -1 : k.kind[j], at(l.sensor[r]), at(l.felt[l.size() + r]), c, d, Tables{p->tables.data() + l.table[r]},
                            j >= 0 && on[j], p->limited(r));
}

// Second derivatives, for a direction of (t, u): that of the Jacobian (values of the pattern) and, added to g (n, np), that of df/dp.
class SecondOrder {
  public:
    SecondOrder(const Problem& p);
    SecondOrder(const SecondOrder&) = delete;
    bool add(const Evaluation& at, const double* dir_t, const double* dir_u, Scatter& s, double* jacobian, double* g);  // false: J stays

  private:
    std::vector<double> dt_, dc_, dab_, d0_, d1_, dl_;
    std::vector<double> du_, factor_, bend_;  // directions of inputs, of factors and of their slopes
    std::vector<std::vector<double>> pull_;   // of what followers pull
    void follow(const Evaluation& at, const double* dir_u);
    void followed(const Evaluation& at, const CoefJacobian& d, double* jacobian, double* g);
    double *da_, *db_;  // the first two quarters of dab_
    void conductors(const Evaluation& at, bool exponents);
    void loads(const Evaluation& at);
    std::vector<double> dlc_;  // of the loads' coefficients and those of their controls (loads, 9), as in Entry::what
};

}  // namespace thermid
